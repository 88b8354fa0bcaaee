"""A prediction's light beside that of a system with other lenses: how unlike, and with which prisms least so."""

import itertools
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.geometry import blurred
from analysis.explain.prisms import TURNS_DEG, Prisms
from analysis.explain.symmetry import is_even
from analysis.explain.tracing import SHARP_SIDE
from analysis.simulate.daylight import Daylight, sun_source
from analysis.simulate.system import LENS_PLACES, System
from analysis.simulate.tally import Field
from analysis.simulate.tracer import Settings, trace

SPREADS_DEG: Final = (0.0, 3.0, 4.5, 6.5, 9.0, 12.0, 16.0)
"""Rms widths by which all light is spread as it leaves, as by a rough surface."""
HAZES: Final = (0.0, 0.07, 0.15, 0.25, 0.4)
"""What is tried; the lens that is supposed without a prediction is among them."""
SUNS: Final = 3
"""So many of a system's tests are compared, from the lowest sun to the highest."""
RAYS: Final = 16_000
"""Rays for each sun."""
SAMPLES: Final = 1_024
"""Entries of the lens tables: a quarter of what is traced later. (With 256 to 2,048 of them a box is unlike another
author's prediction by the same to .003, with other rays to .004.)"""
SUN_SAMPLES: Final = 2_048
"""Entries of each sun's tables."""
_TRACED_HAZE: Final = 0.3
"""A haze that is traced; its change is taken as linear in it."""
_DARK: Final = 0.02
"""Share of the brightest direction that is added before directions are compared by their logarithms."""
_BEHIND: Final = 1.2
"""Prisms that look one way are given up where those that look another are unlike by so many times less. (Of 49 systems
of five authors in none those that came out best had begun more than 1.12 times behind.)"""
BETTER: Final = 0.92
"""Another lens is taken if it is unlike the prediction by less than so much of what the supposed one is."""


@dataclass(frozen=True)
class Predicted:
    """What a prediction shows of one system.

    Attributes
    ----------
    days, seen : shape (T, P, G) [cd]
        Its tests, and the sun part predicted for each on the grid of `analysis.explain.fields`.
    sky : shape (T, P, G) [cd]
        The sky part, where only the sum with it was predicted: ``seen`` is the sum then. Else zero.
    to_deg
        The largest gamma at which it is known.
    distance_m, field
        Whether it is of the far field, or of the near one at that distance.
    """

    days: list[Daylight]
    seen: Floats
    sky: Floats
    distance_m: float
    field: Field
    to_deg: float = 90.0


@dataclass(frozen=True)
class Likened:
    """A system as its prediction shows it.

    Attributes
    ----------
    spread_deg
        What it sends out is spread by so much more than is traced (rms).
    even
        Whether predictions of the case are even about the sun's plane (`symmetry`), and so know no pattern.
    alike
        Whether the systems of the case are hardly unlike their predictions, all together.
    """

    system: System
    spread_deg: float = 0.0
    even: bool = False
    alike: bool = False

    def spread(self, light: Floats) -> Floats:
        """A light (T, P, G) [cd] of the traced system as the prediction would show it."""
        return blurred(light, self.spread_deg) if self.spread_deg else light


def look_at(system: System, what: Predicted, tracers: Executor) -> "Look | None":
    """A few of a system's tests, from the lowest sun to the highest; ``None`` without lenses, or without sun."""
    places = [p for p in LENS_PLACES.get(system.kind, ()) if getattr(system, p).kind in ("prismatic", "diffusing")]
    lit = [k for k, day in enumerate(what.days) if day.beam_lx > 0.0 and np.any(what.seen[k] > 0.0)]
    if not places or not lit:
        return None
    lit.sort(key=lambda k: what.days[k].sun_altitude_deg)
    even = is_even(what.days, what.seen, what.sky, system.rotation_deg)
    chosen = _spread(lit)
    seen, rest = (
        replace(what, days=[what.days[k] for k in some], seen=what.seen[some], sky=what.sky[some])
        for some in (chosen, _spread([k for k in lit if k not in chosen]))
    )
    others = Look(system, places, rest, even, tracers) if rest.days else None
    return Look(system, places, seen, even, tracers, others)


def _spread(lit: list[int]) -> list[int]:
    """No more than so many of a list, as far apart in it as can be."""
    return sorted({lit[round(x)] for x in np.linspace(0, len(lit) - 1, min(SUNS, len(lit)))})


class Look:
    """A system's sun part with other lenses, beside the predicted one; those to choose from are traced side by side.

    ``others`` are as many of its tests again under which nothing is looked for.
    """

    def __init__(
        self,
        system: System,
        places: list[str],
        what: Predicted,
        even: bool,
        tracers: Executor,
        others: "Look | None" = None,
    ) -> None:
        self.others = others
        self.system, self.places, self.field, self.even, self.tracers = system, places, what.field, even, tracers
        self.prismatic = all(getattr(system, place).kind == "prismatic" for place in places)
        self.days, self.raw = what.days, what.seen
        self.source = sun_source(what.days)
        self.use = Settings(
            rays=RAYS,
            samples=SAMPLES,
            sun_samples=SUN_SAMPLES,
            sharp_side=SHARP_SIDE,
            distance_m=what.distance_m,
            bounces=1,
        )
        self.known_to = int(np.searchsorted(GAMMA_DEG, what.to_deg, side="right"))
        self.sky = what.sky
        self.suns = np.maximum(_flux(what.seen) - _flux(what.sky), 0.0)
        self.seen = _logs(what.seen[..., : self.known_to])
        self.known: dict[Prisms, tuple[float, float]] = {}
        self.supposed = Prisms.of([getattr(system, place) for place in places])

    def begun(self) -> float:
        """How unlike the least unlike of all places is where prisms are begun to be looked for."""
        return self.unlike(self.least(list(itertools.chain.from_iterable(self.supposed.beginnings()))))

    def patterned(self) -> Prisms:
        """The least unlike that knows directions in the lens's plane.

        Prisms of one side never become those of the other on the way: each is looked for by itself.
        """
        return self.turned(self.best([self.least(begun) for begun in self.supposed.beginnings()]))

    def patternless(self, like: Prisms) -> Prisms:
        """The least unlike that knows none, begun at what is best with them."""
        return self.best([like._replace(isotropic=True, turn=0)])

    def light(self, system: System) -> Floats:
        """Its sun part, (T, P, G) [cd]."""
        assert self.source is not None
        tally = trace(system, self.source, self.use)
        return tally.intensity(GAMMA_DEG[None, :], C_DEG[:, None], self.field).candela

    def unlike(self, prisms: Prisms) -> float:
        """How unlike the prediction, with the spread and the haze of the last lens that fit best."""
        return self.looked(prisms)[0]

    def looked(self, prisms: Prisms) -> tuple[float, float]:
        """The same, and the spread [deg] with which it is so (the haze is a cosine lobe; ASTM D1003)."""
        if prisms not in self.known:
            light = self.light(prisms.under(self.system, self.places))
            lobe = _flux(light) * np.cos(np.radians(GAMMA_DEG)) / np.pi
            looks = {w: self.hazed(Likened(self.system, w).spread(light), lobe) for w in SPREADS_DEG}
            best = min(looks, key=looks.__getitem__)
            spread = best if looks[best] < BETTER * looks[0.0] else 0.0  # noise of few rays is spread, too
            self.known[prisms] = looks[spread], spread
        return self.known[prisms]

    def hazed(self, light: Floats, lobe: Floats) -> float:
        """How unlike the prediction a light is with the haze of the last lens that fits best."""
        return min(self.beside((1.0 - h) * light + h * lobe) for h in HAZES)

    def best(self, begun: list[Prisms]) -> Prisms:
        """The least unlike that is reached from any beginning, in steps of slope, tilt and turn.

        All go side by side, and those that fall far behind go no further.
        """
        while True:
            self.least([near for prisms in begun for near in prisms.beside()])  # side by side; they are known then
            better = [self.least([prisms, *prisms.beside()]) for prisms in begun]
            best = self.least(better)
            if better == begun:
                return best
            begun = [prisms for prisms in better if self.unlike(prisms) <= _BEHIND * self.unlike(best)]

    def least(self, prisms: list[Prisms]) -> Prisms:
        """The least unlike of several."""
        unlike = list(self.tracers.map(self.unlike, prisms))
        return prisms[int(np.argmin(unlike))]

    def turned(self, prisms: Prisms) -> Prisms:
        """The least unlike of those turned by every other step, made better; as it is, if turns do not help."""
        best = self.least([prisms._replace(turn=k) for k in range(0, len(TURNS_DEG), 2)])
        return self.best([best]) if self.unlike(best) < BETTER * self.unlike(prisms) else prisms

    def far_and_wide(self, system: System) -> float:
        """How unlike a system is, those of its tests included under which nothing was looked for."""
        looks = [self] if self.others is None else [self, self.others]
        squares = [len(look.days) * look.beside(look.light(system)) ** 2 for look in looks]
        return float(np.sqrt(sum(squares) / sum(len(look.days) for look in looks)))

    def beside(self, light: Floats) -> float:
        """Rms difference of the logarithms, with the sky's light where the prediction has it."""
        if np.any(self.sky):
            light = self.sky + light * self.suns / np.maximum(_flux(light), 1e-12)
        return float(np.sqrt(np.mean((_logs(light[..., : self.known_to]) - self.seen) ** 2)))

    def hazy(self, prisms: Prisms, even: bool) -> Likened:
        """The system with such prisms if they are much better than the supposed, and the haze that fits best.

        Where predictions are ``even``, the supposed have no pattern either.
        """
        supposed = self.supposed._replace(isotropic=True) if even else self.supposed
        if self.unlike(prisms) > BETTER * self.unlike(supposed):
            prisms, system = supposed, supposed.under(self.system, self.places) if even else self.system
        else:
            system = prisms.under(self.system, self.places)
        found = Likened(system, self.looked(prisms)[1], even)
        plain = found.spread(self.light(system))
        hazier = (system.with_settings({f"{p}.haze": _TRACED_HAZE}) for p in self.places)
        more = [(found.spread(self.light(other)) - plain) / _TRACED_HAZE for other in hazier]

        def unlike(hazes: tuple[float, ...]) -> float:
            return self.beside(plain + sum(x * m for x, m in zip(hazes, more, strict=True)))

        best = min(itertools.product(HAZES, repeat=len(self.places)), key=unlike)
        if unlike(best) > BETTER * self.beside(plain):
            return found
        hazes = {f"{p}.haze": h for p, h in zip(self.places, best, strict=True)}
        return replace(found, system=system.with_settings(hazes))


def _flux(light: Floats) -> Floats:
    """Flux below the horizon of each light (T, P, G), (T, 1, 1) [lm]."""
    return np.asarray(np.sum(light * solid_angle(), axis=(1, 2), keepdims=True))


def _logs(light: Floats) -> Floats:
    """Logarithms of a light (T, P, G) over its brightest, those of dark directions drawn together; mean zero."""
    brightest = np.maximum(light.max(axis=(1, 2), keepdims=True), 1e-12)
    logs = np.log(np.maximum(light, 0.0) / brightest + _DARK)
    return np.asarray(logs - logs.mean(axis=(1, 2), keepdims=True))
