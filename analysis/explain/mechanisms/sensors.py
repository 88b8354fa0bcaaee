"""Sensors: what they make of the light that falls on them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Reported, Stage, Term, told
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Scene

_ALL = ("goniometer", "roof", "sky")


_NAMES = {"goniometer": "the goniometer's sensors", "roof": "the roof meter", "sky": "the luminance readings"}


def _by_kind(scene: Scene) -> tuple[Branch, ...]:
    """One branch per kind of channel that occurs, and per meter: a cause sits in one instrument, not in all."""
    ways = [Branch(_NAMES[k], k) for k in scene.kinds]
    r = scene.readings
    for kind in scene.kinds:
        channels = np.unique(r.channel[r.kind == kind])
        if kind != "goniometer" and len(channels) > 1:
            ways += [Branch(r.case.channels[k].id, int(k)) for k in channels]
    return tuple(ways)


def _with_level(scene: Scene) -> tuple[Branch, ...]:
    """`_by_kind`, with the middle and the top of the readings as reference levels."""
    ways = []
    for way in _by_kind(scene):
        rows = _acts(scene, way)
        top = float(np.max(scene.readings.simulated[rows]))
        ways.append(replace(way, facts={"level": _level(scene, rows), "top": top}))
    return tuple(ways)


def _acts(scene: Scene, branch: Branch) -> NDArray[np.bool_]:
    return _is_in(scene, branch.value)


def _is_in(scene: Scene, which: str | int | tuple[int, ...]) -> NDArray[np.bool_]:
    """Rows of a kind of channel (its name), or of one channel or several (their numbers); shape (N,)."""
    r = scene.readings
    return np.asarray(r.kind == which if isinstance(which, str) else np.isin(r.channel, which))


def _has_camera(scene: Scene, branch: Branch) -> bool:
    return bool(np.any(scene.is_camera & _acts(scene, branch)))


def _level(scene: Scene, rows: NDArray[np.bool_]) -> float:
    """Geometric middle of the readings that are well above noise."""
    y = scene.readings.measured[rows & (scene.readings.measured > 5 * scene.readings.noise)]
    return float(np.exp(np.mean(np.log(y)))) if len(y) else 1.0


class DarkOffset(Mechanism):
    """A constant is added to every reading, light or no light: the same of all sensors, or of each its own."""

    id = "dark-offset"
    stage = Stage.SENSORS
    bends = True
    leaves_out = "The sensors read something in the dark."
    parameters = (Parameter("offset", "the channel's unit", "reading in the dark", -1e6, 1e6, 1.0, (-1.0, 1.0)),)
    source = "y + o; y_i + o_i for each sensor i"
    tie_breaker = "a reading with the sensors covered"
    kinds = _ALL

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """One kind of instrument; on the arm also each sensor by itself."""
        sensors = np.unique(scene.readings.channel[scene.is_gonio]).tolist()
        return (*_by_kind(scene), *((Branch("each sensor its own", tuple(sensors)),) if len(sensors) > 1 else ()))

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """An offset of a hundredth of the middle reading is usual; each sensor's begins where its readings say."""
        acts = _acts(scene, branch)
        usual = 0.03 * _level(scene, acts)
        unit = scene.readings.case.channels[int(scene.readings.channel[acts][0])].unit
        factor = float(scene.readings.unit_factor[acts][0])
        p = replace(self.parameters[0], unit=unit, low=-20 * usual, high=20 * usual, sigma=usual, per_unit=1 / factor)
        if not isinstance(branch.value, tuple):
            return (replace(p, starts=(-usual, usual)),)
        found = np.clip(_own_offsets(scene, branch.value), p.low, p.high)
        return tuple(
            replace(p, name=f"offset_{scene.readings.case.channels[k].id}", starts=(float(start),))
            for k, start in zip(branch.value, found, strict=True)
        )

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Add the offset."""
        if isinstance(branch.value, tuple):
            mine = np.array([scene.readings.channel == k for k in branch.value], dtype=np.float64)
            return np.asarray(values + p @ mine)
        return values + np.where(_acts(scene, branch), p[0], 0.0)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        if isinstance(branch.value, tuple):
            least, most = np.min(p), np.max(p)
            return f"The sensors do not read zero in the dark: they carry offsets from {least:+.3g} to {most:+.3g}."
        return f"Every reading of {branch.label} carries an offset of {p[0]:+.3g}: they do not read zero in the dark."


def _own_offsets(scene: Scene, channels: tuple[int, ...]) -> Floats:
    """What a line through each sensor's readings over their predictions says of it in the dark; tests have gains."""
    r = scene.readings
    ratio = r.measured / np.maximum(r.simulated, 1e-9)
    gain = np.ones(len(r.case.tests))
    for k in np.unique(r.test[scene.is_gonio]):
        gain[k] = np.median(ratio[scene.is_gonio & (r.test == k)])
    found = []
    for k in channels:
        rows = np.flatnonzero(scene.is_gonio & (r.channel == k))
        light = np.maximum(r.simulated[rows], 1e-9)
        weight = 1.0 / np.hypot(light, 1e-2 * light.max())
        lines = np.column_stack([np.ones_like(light), light]) * weight[:, None]
        left = (r.measured[rows] / np.maximum(gain[r.test[rows]], 1e-9) - light) * weight
        found.append(float(np.linalg.lstsq(lines, left, rcond=None)[0][0]))
    return np.array(found)


_CHANGE_OVER = 0.15
"""Half width [ln of level] over which a meter changes its range: upwards later than downwards."""

BENDS = ("bent", "hyperbolic")
"""Forms of a response that bends towards bright light: by its level, or by ever less of it."""


class Nonlinearity(Mechanism):
    """The response is not proportional: a power of the light, bent towards bright light, or other beyond a range."""

    id = "nonlinearity"
    stage = Stage.SENSORS
    bends = True
    leaves_out = "The response is not proportional to the light."
    parameters = (Parameter("p", "1", "p in y^(1+p)", -0.5, 0.5, 0.05, (-0.04, 0.04)),)
    response = replace(parameters[0], sigma=0.1)  # of a camera's curve, or of a roof meter
    bend = Parameter("bend", "1", "relative error of the brightest reading", -0.8, 0.8, 0.1, (-0.3, -0.05, 0.05, 0.3))
    step = Parameter("step", "1", "relative error of all readings in the upper range", -0.4, 0.4, 0.04, (-0.04, 0.04))
    range_at = Parameter(
        "range_at", "1", "ln of the level at which ranges change, over the middle level", -3.0, 3.0, 1.2, (0.0,)
    )
    gradual = replace(step, sigma=0.1, starts=(-0.1, 0.1))
    over = Parameter("over", "1", "ln of the levels over which the response changes", 0.2, 4.0, 0.8, (0.6, 1.6), 1.0)
    true_at = Parameter(
        "true_at", "1", "ln of the level that is read rightly, over the middle level", -4.0, 4.0, 1.0, (0.0,)
    )
    source = (
        "y (y/y0)^p, y0 the geometric middle of the readings; y (1 + b y/top); y / (1 + c y/top); y (1 + s) in the "
        "upper range, reached at once or over a factor of light; "
        "CIE/ISO 19476 f3 (linearity), f11 (range change)"
    )
    tie_breaker = "the same readings once more through a neutral filter"
    kinds = _ALL

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """A power, a bend or a step, of one kind of instrument; on the arm also a step that takes its time.

        A camera has no ranges: what steps there is its exposures.
        """
        powers = _with_level(scene)
        forms = {
            "bent": "bent",
            "hyperbolic": "bent less and less",
            "ranges": "by ranges",
            "gradual": "from one response to another",
        }
        ways = [(b, form) for b in powers for form in BENDS]
        ways += [(b, "ranges") for b in powers if not _has_camera(scene, b)]
        ways += [(b, "gradual") for b in powers if b.value == "goniometer"]
        return (*powers, *(Branch(f"{b.label}, {forms[form]}", (b.value, form), b.facts) for b, form in ways))

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Those of the form; a single meter was calibrated at some level that nobody knows."""
        if isinstance(branch.value, tuple):
            if branch.value[1] in BENDS:
                return (self.bend,)
            within = self._range_within(scene, branch)
            return (self.step, within) if branch.value[1] == "ranges" else (self.gradual, within, self.over)
        return self.parameters if branch.value == "goniometer" else (self.response, self.true_at)

    def _range_within(self, scene: Scene, branch: Branch) -> Parameter:
        """Ranges change where there are readings on both sides: a step below all of them is a gain."""
        seen = scene.readings.simulated[_is_in(scene, branch.value[0])]
        low, high = np.log(np.maximum(np.quantile(seen, (0.25, 0.95)), 1e-9) / branch.facts["level"])
        low, high = min(low, -0.01), max(high, 0.01)
        return replace(self.range_at, low=low, high=high, starts=tuple(low + (high - low) * np.array([0.1, 0.4, 0.7])))

    def blurs(self, p: Floats, branch: Branch) -> bool:
        """Whether only the brightest is brighter: below a skylight, so are images that a lens blurs less."""
        return branch.value in {("goniometer", form) for form in BENDS} and float(p[0]) > 0.0

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Bend the response about its middle."""
        which, form = branch.value if isinstance(branch.value, tuple) else (branch.value, "power")
        acts = _is_in(scene, which)
        if form in BENDS:
            bright = np.maximum(values, 0.0) / branch.facts["top"]
            hyperbola = 1.0 / np.maximum(1.0 - p[0] / (1.0 + p[0]) * bright, 0.1)
            return np.where(acts, values * (1.0 + p[0] * bright if form == "bent" else hyperbola), values)
        level = branch.facts["level"] * (np.exp(p[1]) if len(p) > 1 else 1.0)
        beyond = np.log(np.maximum(values, 1e-9 * level) / level)
        over = max(float(p[2]), 1e-3) if form == "gradual" else _CHANGE_OVER
        factor = np.exp(p[0] * beyond) if form == "power" else 1.0 + p[0] * expit(2.0 * beyond / over)
        return np.where(acts, values * factor, values)

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """Of a power also the exponent itself: of four authors two mean 1 + p by that word, two p."""
        found = super().report(p, sd, term)
        power = not isinstance(term.branch.value, tuple)
        return {"exponent": told(1.0 + p[0], float(sd[0]), "1"), **found} if power else found

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say which way."""
        form = branch.value[1] if isinstance(branch.value, tuple) else "power"
        ways = {
            "bent": f"is not proportional: the brightest reading is {p[0]:+.1%} off",
            "hyperbolic": f"is not proportional: the brightest reading is {p[0]:+.1%} off, the next hardly less",
            "ranges": f"changes with the range: in the upper one readings are {p[0]:+.1%} off",
            "gradual": f"changes between dim and bright light: bright readings are {p[0]:+.1%} off",
            "power": f"grows as the {1 + p[0]:.3f}th power of the light instead of in proportion",
        }
        return f"The response of {branch.label} {ways[form]}."


class Saturation(Mechanism):
    """The range ends: large readings are compressed or cut off."""

    id = "saturation"
    stage = Stage.SENSORS
    leaves_out = "The sensors' range ends: large readings are too small."
    parameters = (
        Parameter(
            "compression",
            "1",
            "largest prediction over the level at which the range ends",
            0.0,
            25.0,
            0.5,
            (0.05, 0.2, 0.6, 1.2, 3.0, 8.0),
        ),
    )
    knee = Parameter(
        "slope", "1", "share of the sensitivity that is left beyond", 0.0, 1.0, 0.4, (0.2, 0.6), centre=0.3
    )
    sharpness = Parameter("sharpness", "1", "n: how suddenly the end comes", 1.2, 20.0, 4.0, (2.0, 5.0), centre=4.0)
    smooth = ("gradual", "exponential")
    source = (
        "y/(1+y/Y) (dead time), Y(1-exp(-y/Y)), y/(1+(y/Y)^n)^(1/n), min(y, Y) (converter's end), Y + s (y-Y) "
        "(amplifier's knee)"
    )
    tie_breaker = "the same readings once more through a neutral filter"
    kinds = _ALL

    def why_not(self, scene: Scene) -> str:
        """The end of a roof meter's range has a name of its own."""
        return "for roof meters this is meter-range-limit" if scene.kinds == ("roof",) else ""

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Forms of the end, for one kind of instrument; not for roof meters."""
        forms = (*self.smooth, "rounded", "clipped", "knee")
        ways = [b for b in _with_level(scene) if not np.any(scene.is_roof & _acts(scene, b))]
        return tuple(Branch(f"{b.label}, {f}", (b.value, f), b.facts) for b in ways for f in forms)

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """Beyond a knee, something is left; a rounded end comes more or less suddenly."""
        further = {"knee": (self.knee,), "rounded": (self.sharpness,)}
        return (*self.parameters, *further.get(branch.value[1], ()))

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Compress towards the end of the range."""
        kind, form = branch.value
        acts = _is_in(scene, kind)
        if p[0] <= 0 or not np.any(acts):
            return values
        end = branch.facts["top"] / p[0]
        share = np.maximum(values, 0.0) / end
        if form == "gradual":
            read = end * share / (1.0 + share)
        elif form == "exponential":
            read = end * -np.expm1(-share)
        elif form == "rounded":
            read = end * share / (1.0 + share ** p[1]) ** (1.0 / p[1])
        else:
            read = end * (np.minimum(share, 1.0) + (p[1] * np.maximum(share - 1.0, 0.0) if form == "knee" else 0.0))
        return np.where(acts & (values > 0), read, values)

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """The level at which the range ends is what a data sheet gives."""
        level = term.branch.facts["top"] / max(float(p[0]), 1e-6)
        return {"level": told(level, level * float(sd[0] / max(p[0], 1e-6)), "reading"), **super().report(p, sd, term)}

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how near the end."""
        return (
            f"Large readings of {branch.label} are too small: the brightest reach {p[0]:.0%} of the end of the range."
        )
