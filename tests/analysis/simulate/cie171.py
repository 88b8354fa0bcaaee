"""Openings to the sky in the manner of CIE 171:2006, sections 5.9 to 5.12: both engines beside an integral.

    python3 -m tests.analysis.simulate.cie171

The report's tables are not public, so its arrangements are followed and its numbers are not: a black room of 4 m x 4 m
x 3 m, an unglazed (5.9) or glazed (5.10) opening of 1 m x 1 m or 4 m x 4 m in the roof, or one in the facade of 2 m x 1
m or 4 m x 3 m (5.11, 5.12) that sees sky and ground, and the fifteen CIE general skies. Points, the sun's place (60
degrees, south), the ground (30 % under the sky's light) and the pane (6 mm, index 1.52, clear) are chosen here. For
points of a plane parallel to the opening (the floor; the wall opposite) the illuminance is the integral of
L tau cos^2 / d^2 over the opening: black walls send nothing.

A facade is a roof turned about: the engines get the hemisphere before it, sky above and ground below the horizon.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.radiance.contributions import contributions
from analysis.simulate.source import Luminance, horizontal_illuminance, skies
from analysis.simulate.system import Aperture, Lens, System, Wall
from analysis.simulate.tracer import Settings, trace
from analysis.sky.standard import StandardSky

Floats = NDArray[np.float64]

TYPES = tuple(range(1, 16))
GROUND = 0.3


@dataclass(frozen=True)
class Case:
    """One opening: its section, size [m], distance to the points' plane [m], whether in a facade, whether glazed."""

    section: str
    size_m: tuple[float, float]
    distance_m: float
    facade: bool
    glazed: bool

    @property
    def name(self) -> str:
        """For a table."""
        return f"{self.section} {self.size_m[0]:g} m x {self.size_m[1]:g} m"

    @property
    def points(self) -> Floats:
        """Places (n, 2) on the floor or the opposite wall, from below the opening's centre [m]."""
        x = np.arange(-1.75, 1.76, 0.5)
        y = (-1.0, 0.0, 1.0) if self.facade else (0.0, 1.25)
        return np.array([(a, b) for b in y for a in x])

    @property
    def system(self) -> System:
        """The opening as a skylight: no well to speak of, black sides, a pane or none."""
        none = Lens(kind="none")
        pane = Lens(kind="clear", refractive_index=1.52, thickness_mm=6.0, absorption_per_mm=0.0)
        return System(
            name="opening", aperture=Aperture(size_m=self.size_m), well_depth_m=1e-3, rise_m=0.0, entry=none,
            exit=pane if self.glazed else none, wall=Wall(reflectance=0.0),
        )  # fmt: skip

    def seen(self, kind: int) -> Luminance:
        """Luminance towards the hemisphere before the opening, for a sky that gives 10,000 lx on the horizontal."""
        sky = StandardSky.of_diffuse(kind, 10_000.0, 60.0, 180.0).luminance
        if not self.facade:
            return sky
        ground = GROUND * 10_000.0 / np.pi

        def before(v: Floats) -> Floats:
            up = v[..., 1]  # the opening looks south: its x is east, its y up
            world = np.stack([v[..., 0], -v[..., 2], np.maximum(up, 1e-9)], axis=-1)
            world /= np.linalg.norm(world, axis=-1, keepdims=True)
            return np.where(up > 0.0, sky(world), ground)

        return before


CASES = tuple(
    Case(section, size, distance, facade, glazed)
    for section, facade, glazed, distance, sizes in (
        ("5.9", False, False, 3.0, ((1.0, 1.0), (4.0, 4.0))),
        ("5.10", False, True, 3.0, ((1.0, 1.0), (4.0, 4.0))),
        ("5.11", True, False, 4.0, ((2.0, 1.0), (4.0, 3.0))),
        ("5.12", True, True, 4.0, ((2.0, 1.0), (4.0, 3.0))),
    )
    for size in sizes
)


def pane(cosine: Floats, index: float = 1.52) -> Floats:
    """Transmittance of a clear pane (Fresnel, both polarisations, inter-reflections), apart from the engines."""
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / index**2)
    rs = ((cosine - index * inside) / (cosine + index * inside)) ** 2
    rp = ((inside - index * cosine) / (inside + index * cosine)) ** 2
    return 0.5 * ((1.0 - rs) / (1.0 + rs) + (1.0 - rp) / (1.0 + rp))


def integral(case: Case, luminances: list[Luminance], steps: int = 600) -> Floats:
    """Illuminance [lx] (T, points) by the midpoint rule; halving the steps changes it by less than 2e-4."""
    u, v = ((np.arange(steps) + 0.5) / steps - 0.5 for _ in range(2))
    x, y = (a.ravel() for a in np.meshgrid(u * case.size_m[0], v * case.size_m[1]))
    area = case.size_m[0] * case.size_m[1] / len(x)
    result = np.empty((len(luminances), len(case.points)))
    for k, (px, py) in enumerate(case.points):
        to = np.stack([x - px, y - py, np.full(len(x), case.distance_m)], axis=1)
        d2 = np.sum(to**2, axis=1)
        cosine = case.distance_m / np.sqrt(d2)
        worth = cosine**2 / d2 * area * (pane(cosine) if case.glazed else 1.0)
        to /= np.sqrt(d2)[:, None]
        result[:, k] = [float(np.sum(luminance(to) * worth)) for luminance in luminances]
    return result


def tracer(case: Case, luminances: list[Luminance], rays: int = 4_000_000) -> Floats:
    """The same by our tracer."""
    settings = Settings(rays=rays, distance_m=case.distance_m, flat=True, bounces=1, threads=0)
    found = trace(case.system, skies(luminances), settings).illuminance(case.points[:, 0], case.points[:, 1])
    return found[0]


def radiance(case: Case, luminances: list[Luminance], rays: int = 16_384) -> Floats:
    """The same by Radiance: rays from the points through the opening, drawn in proportion to cos^2 / d^2."""
    rng = np.random.default_rng(3)
    rows, weights = [], []
    for px, py in case.points:
        plastic = 1.32471795724474602596
        k = np.arange(8 * rays)
        x = ((rng.random() + k / plastic) % 1.0 - 0.5) * case.size_m[0]
        y = ((rng.random() + k / plastic**2) % 1.0 - 0.5) * case.size_m[1]
        to = np.stack([x - px, y - py, np.full(len(x), case.distance_m)], axis=1)
        d2 = np.sum(to**2, axis=1)
        worth = case.distance_m**2 / d2**2
        weights.append(worth.mean() * case.size_m[0] * case.size_m[1])
        steps = np.cumsum(worth) / worth.sum()
        pick = np.searchsorted(steps, (np.arange(rays) + rng.random()) / rays).clip(0, len(worth) - 1)
        travel = to[pick] / np.sqrt(d2[pick])[:, None]
        start = np.stack([x[pick], y[pick], np.zeros(rays)], axis=1)
        rows.append(np.concatenate([start - 1e-4 * travel, travel], axis=1))
    sent = np.concatenate(rows)
    found = [contributions(case.system, [], 0.25, sent, rays, sky)[:, 0] for sky in luminances]
    return np.array(found) * np.array(weights)


def errors(case: Case, engine: Callable[[Case, list[Luminance]], Floats], types: tuple[int, ...] = TYPES) -> Floats:
    """(engine - integral) / integral, (skies, points)."""
    luminances = [case.seen(kind) for kind in types]
    return engine(case, luminances) / integral(case, luminances) - 1.0


def main() -> None:
    """Print a table: mean and largest error of all points and skies."""
    for kind in TYPES:
        sky = StandardSky.of_diffuse(kind, 10_000.0, 60.0, 180.0)
        assert abs(horizontal_illuminance(sky.luminance) / 10_000.0 - 1.0) < 5e-3
    print("case | tracer, all 15 skies: mean, largest | Radiance, skies 1, 5, 12: mean, largest")
    for case in CASES:
        ours, theirs = errors(case, tracer), errors(case, radiance, (1, 5, 12))
        told = " | ".join(f"{100 * e.mean():+.2f} %, {100 * np.abs(e).max():.2f} %" for e in (ours, theirs))
        print(f"{case.name} | {told}", flush=True)


if __name__ == "__main__":
    main()
