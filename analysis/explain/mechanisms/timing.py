"""Time: the clocks of roof and room."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.air_error import air_mass
from analysis.explain.images_later import in_tubes, middles, with_height_and_azimuth, with_the_sun
from analysis.explain.mechanisms.base import IMAGES_OF_SIZE, Branch, Mechanism, Stage
from analysis.explain.mechanisms.camera import cameras_side
from analysis.explain.parameter import Parameter
from analysis.explain.readings import sun_at
from analysis.explain.retrace import Path
from analysis.explain.scene import Light, Scene
from analysis.explain.series import looks_one_way, predicted_noise, quiet, series_of, step_min
from analysis.explain.shifts import likely_shifts, saw_the_clouds

_CLEAR_LOSS = 0.25
"""Optical depth of clear air, to divide out the sun's way."""
_HOUR_MIN, _USUAL_MIN = 60.0, 8.0
"""Clocks are off by minutes, or by the hour of summer time."""
HOUR = "the hour alone"
"""What a clock changes where the sun's image is simulated elsewhere: how much of the daylight is the sun's."""
_OF_THE_ROOF = "by the roof's clock"
_RINGS = "below tubes by the sun's height and azimuth"
_NODE_MIN = 10.0
"""The sun's altitude is worked out for offsets so far apart."""
_BEYOND_AIR_LX = 1.3e5
"""Illuminance of the sun outside the air [lx]."""


class ClockOffset(Mechanism):
    """The recording's clock is off, so that the sun stood elsewhere than the simulation put it."""

    id = "clock-offset"
    stage = Stage.TIME
    leaves_out = "The clock of the recording is off: the sun stood elsewhere than it was simulated."
    parameters = (
        Parameter(
            "offset_min",
            "min",
            "true time minus recorded time",
            -180.0,
            180.0,
            8.0,
            (-60.0, -12.0, -3.0, 3.0, 12.0, 60.0),
        ),
    )
    needs = "site and times; for the goniometer also the systems (for a new simulation) or a variant"
    narrow = Parameter(
        "offset_min", "min", "true time minus recorded time", -180.0, 180.0, 8.0, (-60.0, -8.0, -1.5, 1.5, 8.0, 60.0)
    )
    modelled_twice = True
    fitted_ways = 6  # each by either clock
    form_error = 0.2
    local_error = 0.4
    source = "S(t + d), under a steady sky or as the series itself went on; sun by NREL SPA (Reda and Andreas 2004)"
    tie_breaker = "log the time of each reading on both clocks"
    kinds = ("goniometer", "roof", "sky")

    def why_not(self, scene: Scene) -> str:
        """The sun must be known at other times."""
        r = scene.readings
        if r.case.setup.site is None or not r.has_times:
            return "the case gives no site, or the records carry no time"
        if scene.kinds == ("sky",):
            return ""
        if not r.has_parts:
            return "the records do not give the sun and sky parts apart"
        if np.any(scene.is_gonio) and not np.any(scene.is_roof) and not self._of_the_image(scene):
            return (
                "no variant shows the sun at another time, and the systems are not described well "
                "enough to simulate one"
            )
        return ""

    def form_error_in(self, scene: Scene) -> float:
        """Images move otherwise than simulated; between the directions of a picture the sky is only guessed."""
        if scene.kinds == ("sky",):
            return 0.25
        return self.form_error if np.any(scene.is_gonio) else Mechanism.form_error

    def size_error_in(self, scene: Scene, branch: Branch) -> float:
        """Images that are not as sharp as simulated seem to move less."""
        moved = np.any(scene.is_gonio) and not branch.of_case
        return IMAGES_OF_SIZE if moved else super().size_error_in(scene, branch)

    def between_readings_min(self, scene: Scene, p: Floats, branch: Branch) -> float:
        """A random walk whose ends are known is off by the variance of this time, whatever way it went between them.

        A Brownian bridge (Karatzas and Shreve 1991, Brownian Motion and Stochastic Calculus, sec. 5.6).
        """
        if branch.value != "series":
            return 0.0
        step = step_min(scene)
        into = float(p[0]) / step % 1.0
        return step * into * (1.0 - into)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """The sun at another time; where only roof meters were read, also everything predicted at another time.

        Below a skylight illuminances may go by the roof's clock, too: under the sun that the room saw they were others.
        A second instrument saw the clouds that the first saw: of its series nothing but the whole can be late.
        """
        ways = _by_either_clock(self._of_the_image(scene)) if _below(scene) else (Branch(),)
        steady = all(looks_one_way(scene, int(k)) for k in np.unique(scene.readings.channel))
        series = scene.on_the_roof and steady and series_of(scene)
        if not series:
            return ways
        whole = Branch("all daylight", "series")
        (shift,) = self.parameters_in(scene, whole)
        return (whole,) if saw_the_clouds(scene, shift.high) else (*ways, whole)

    @staticmethod
    def _of_the_image(scene: Scene) -> tuple[Branch, ...]:
        """The sun's image as re-simulated, or turned as a whole with the sun; of tubes also by height and azimuth."""
        paths = scene.retraced.paths("clock-offset") if scene.retraced is not None else ()
        traced = tuple(Branch(path.label if k else "", path) for k, path in enumerate(paths))
        if not scene.knows_image:
            return traced
        ways = (*traced, Branch("the image follows the sun", "image"))
        ours = [w for w in ways if not w.of_case] if np.any(in_tubes(scene)) else []
        return (*ways, *(replace(w, label=f"{w.label}, {_RINGS}".lstrip(", "), value=_Rings(w.value)) for w in ours))

    def parameters_in(self, scene: Scene, branch: Branch) -> tuple[Parameter, ...]:
        """A whole series can only be shifted by a few of its own steps, or by the hour of summer time."""
        if branch.value != "series":
            return self.parameters if np.any(scene.is_gonio) else (self.narrow,)
        step = step_min(scene)
        what = "true time minus recorded time"
        starts: tuple[float, ...] = (-3.0 * step, -0.7 * step, -0.2 * step, 0.2 * step, 0.7 * step, 3.0 * step)
        if 3.0 * step < _HOUR_MIN:
            starts = (-_HOUR_MIN, *starts, _HOUR_MIN)
        most = max(8.0 * step, 1.25 * _HOUR_MIN)
        starts = (*starts, *(float(x) for x in scene.remember(likely_shifts, most)))
        return (Parameter("offset_min", "min", what, -most, most, max(2.0 * step, _USUAL_MIN), starts),)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Turn the sky's pattern with the sun, where luminances were read.

        As with all that a camera does, its clock is meant; where it is the prediction, the meter saw what it did not.
        Luminances beside illuminances were read by the same clock.
        """
        if not np.any(scene.is_sky) or branch.value == "series":
            return values
        side = scene.is_sky if scene.on_the_roof else scene.remember(cameras_side)
        return np.asarray(values * np.exp(side * scene.sky_shape.later(float(p[0]))))

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Put the sun where it stood: its height on a roof meter, its image below a skylight."""
        if branch.value == "series":
            sun, sky = scene.remember_last(_later, float(p[0]))
            light.sun_factor = light.sun_factor * sun
            light.sky_factor = light.sky_factor * sky
            return
        brightens = scene.is_roof | (scene.is_gonio & (branch.sort == _OF_THE_ROOF))
        if np.any(brightens):
            sun, sky = _clear_later(scene, _altitude_later(scene, float(p[0])))
            light.sun_factor = np.where(brightens, light.sun_factor * sun, light.sun_factor)
            light.sky_factor = np.where(brightens, light.sky_factor * sky, light.sky_factor)
        if np.any(scene.is_gonio) and branch.value != HOUR:
            light.sun = _image_later(scene, light.sun, float(p[0]), branch.value)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far."""
        return (
            f"The clocks differ by {abs(p[0]):.1f} min: the sun stood where it was "
            f"{'later' if p[0] > 0 else 'earlier'} than recorded."
        )


@dataclass(frozen=True)
class _Rings:
    """A way for images below all systems but tubes: a path of settings, or with the sun."""

    elsewhere: Path | str


def _image_later(scene: Scene, sun: Floats, minutes: float, way: Path | str | _Rings | None) -> Floats:
    """The sun part (T, P, G) ``minutes`` later in one of the ways."""
    if isinstance(way, _Rings):
        tubes = in_tubes(scene)[:, None, None]
        rings = with_height_and_azimuth(scene, sun, minutes)
        return rings if np.all(tubes) else np.where(tubes, rings, _image_later(scene, sun, minutes, way.elsewhere))
    if way == "image":
        return with_the_sun(scene, sun, minutes)
    path = way if isinstance(way, Path) else None
    ratio = scene.retraced.sun_later(minutes, path) if scene.retraced is not None else None
    return sun if ratio is None else sun * ratio


def _below(scene: Scene) -> bool:
    """Whether only what is below a skylight was read."""
    return scene.kinds == ("goniometer",)


def _by_either_clock(ways: tuple[Branch, ...]) -> tuple[Branch, ...]:
    """The ways with illuminances of the room's hour, and those with illuminances of the roof's."""
    return (*ways, *(replace(w, label=f"{w.label}, {_OF_THE_ROOF}".lstrip(", "), sort=_OF_THE_ROOF) for w in ways))


def _clear_later(scene: Scene, altitude_deg: Floats) -> tuple[Floats, Floats]:
    """Sun and sky part under a steady sky when the sun stands at these altitudes, over those now; shapes (N,).

    The beam's loss in the air grows with the air mass (Kasten 1966); the sky brightens as the root of the sun's height.
    Below a skylight, where readings tell no illuminance, the air is taken as clear.
    """
    r = scene.readings
    later = np.maximum(altitude_deg, 0.5)
    below = _below(scene)
    now = np.maximum(scene.remember(_altitude_at_node, 0.0) if below else r.sun_altitude_at_deg, 0.5)
    height = np.sin(np.radians(later)) / np.sin(np.radians(now))
    normal = np.maximum(r.sun, 0.0) / np.sin(np.radians(now))
    lost = -np.log(np.clip(normal / _BEYOND_AIR_LX, 0.02, 0.98))  # through today's air mass, cloud included
    lost = _CLEAR_LOSS * air_mass(now) if below else lost
    return height * np.exp(-lost * (air_mass(later) / air_mass(now) - 1.0)), np.sqrt(height)


def _altitude_later(scene: Scene, minutes: float) -> Floats:
    """The sun's altitude [deg] so many minutes after each reading, to a thousandth or two; (N,).

    A search asks hundreds of times: cubics go through the altitudes of every tenth minute.
    """
    k, u = divmod(minutes / _NODE_MIN, 1.0)
    if u == 0.0:
        return scene.remember(_altitude_at_node, k)
    weights = (-u * (u - 1) * (u - 2) / 6, (u * u - 1) * (u - 2) / 2, -u * (u + 1) * (u - 2) / 2, u * (u * u - 1) / 6)
    nodes = (scene.remember(_altitude_at_node, k + i) for i in (-1.0, 0.0, 1.0, 2.0))
    return np.asarray(sum(w * node for w, node in zip(weights, nodes, strict=True)))


def _altitude_at_node(scene: Scene, node: float) -> Floats:
    """The sun's altitude [deg] so many nodes after each reading, or below a skylight after its test's middle; (N,)."""
    r, late = scene.readings, np.int64(round(node * _NODE_MIN * 60e9))
    if _below(scene):  # thousands of readings, of tests that are predicted for one moment
        return np.asarray(sun_at(r.case, middles(scene) + late)[0][r.test])
    return np.asarray(sun_at(r.case, r.utc_ns + late)[0])


def _later(scene: Scene, minutes: float) -> Floats:
    """Sun and sky part ``minutes`` later over those now; shape (2, N).

    What the air lets through is read from the predicted series itself; the sun's way is added as under a steady sky, so
    that the ends of a series, where nothing is known of later clouds, still move with the sun.
    """
    r = scene.readings
    then = _altitude_later(scene, minutes)
    sun, sky = _clear_later(scene, then)
    way = _clear_beam(then) / np.maximum(_clear_beam(r.sun_altitude_at_deg), 1e-9)
    passed, steady = scene.remember(_passed), scene.remember(_steady)
    for s in series_of(scene):
        rows, t = s.rows, s.t
        inside = (t + minutes >= t[0]) & (t + minutes <= t[-1])
        for k, (factor, along) in enumerate(((sun, way[rows]), (sky, 1.0))):
            part, even = passed[k, rows], steady[k, rows]
            floor = 1e-9 * max(float(part.max()), 1e-9)
            moved = along * (part - even + np.interp(t + minutes, t, even)) / np.maximum(part, floor)
            factor[rows] = np.where(inside & (part > floor), moved, factor[rows])
    return np.stack([sun, sky])


def _passed(scene: Scene) -> Floats:
    """What the air let through of the sun part, and the sky part; (2, N)."""
    r = scene.readings
    return np.stack([r.sun / np.maximum(_clear_beam(r.sun_altitude_at_deg), 1e-9), r.sky])


def _steady(scene: Scene) -> Floats:
    """The same without the noise of the prediction's series; (2, N)."""
    passed, own = scene.remember(_passed), scene.remember(predicted_noise)
    noise = np.stack([own / np.maximum(_clear_beam(scene.readings.sun_altitude_at_deg), 1e-9), own])
    made = passed.copy()
    for s in series_of(scene):
        for k in (0, 1):
            made[k, s.rows] = quiet(s.t, passed[k, s.rows], noise[k, s.rows])
    return made


def _clear_beam(altitude_deg: Floats) -> Floats:
    """Horizontal beam under clear air, up to a constant; (N,)."""
    height = np.maximum(altitude_deg, 0.5)
    return np.asarray(np.sin(np.radians(height)) * np.exp(-_CLEAR_LOSS * air_mass(height)))
