"""Sun and sky over the station: how bright each is at any instant, clouds included.

Levels of the cloudless sun and sky follow the sun's height (`simulators.hidden.light.clear_day`), the sky's luminance
is the distribution of Perez. Clouds in front of it take light from what is behind them and shine by what they scatter.
"""

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from labdaq.directions import sky_vector
from simulators.hidden.light import Sun, clear_day
from simulators.hidden.perez import relative_luminance
from simulators.hidden.symmetry import IDENTITY, sky_nodes
from simulators.world.clearness import clearness_and_brightness
from simulators.world.clouds import CloudOptions, Clouds
from simulators.world.sunpath import SunPath

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Levels:
    """Illuminances of a kind of sky, over those of a clear one.

    Attributes
    ----------
    turbidity
        Linke's factor of the clear sky.
    beam, diffuse
        Factors on the illuminance facing the sun, and on the horizontal one from the sky.
    """

    turbidity: float
    beam: float
    diffuse: float


SKIES: Final[dict[str, Levels]] = {
    "clear": Levels(4.0, 1.0, 1.0),
    "partly-cloudy": Levels(4.2, 0.95, 1.2),
    "overcast": Levels(4.0, 0.0, 1.6),
}
"""Clear: a July morning at Greenwood had 45.7 klx global and 17.3 klx diffuse at a sun of 31 degrees, noon 105 and 24
klx. Overcast: some 30 % of the global illuminance of a clear sky (CIE overcast days; the sun is not seen)."""

TYPE_STEP_NS: Final = 900 * NS
"""Perez's skies come in eight classes of clearness with jumps between them; a real sky does not jump. Its type is taken
at multiples of this, and the skies of two neighbouring types are mixed in between."""

CLOUD_ALBEDO: Final = 0.45
"""A thick cloud's luminance from below over that of a white surface under the whole clear daylight."""


class Daylight:
    """Sun and sky at any instant (a `simulators.hidden.light.Light`); may be asked from several threads."""

    def __init__(self, path: SunPath, sky: str, cloud_cover: float, seed: int) -> None:
        self.path = path
        self.levels = SKIES[sky]
        wind = np.random.default_rng([seed, 9002])
        self.clouds = Clouds(
            CloudOptions(
                cloud_cover,
                wind_heights_per_s=float(wind.uniform(0.003, 0.006)),
                wind_from_deg=float(wind.uniform(0.0, 360.0)),
                seed=seed,
            )
        )

    @property
    def steady(self) -> bool:
        """Whether nothing moves but the sun."""
        return self.clouds.options.cover <= 0.0

    def sun(self, utc_ns: int) -> Sun:
        """Where the sun is, and its illuminance after the clouds [lx]."""
        towards, normal, _ = self._cloudless(utc_ns)
        if normal > 0.0 and not self.steady:
            normal *= math.exp(-float(self.clouds.thickness(towards[None], utc_ns)[0]))
        return Sun(towards, normal)

    def diffuse(self, utc_ns: int) -> float:
        """Horizontal illuminance from the sky [lx], clouds included."""
        if self.steady:
            return self._cloudless(utc_ns)[2]
        directions, solid_angle = hemisphere()
        return float(self.luminance(directions, utc_ns) @ (directions[:, 2] * solid_angle))

    def luminance(self, directions: Floats, utc_ns: int) -> Floats:
        """Luminance without the sun's disc [cd/m²] towards unit vectors (..., 3); 0 below the horizon."""
        towards, normal, diffuse = self._cloudless(utc_ns)
        directions = np.asarray(directions, dtype=np.float64)
        if diffuse <= 0.0:
            return np.zeros(directions.shape[:-1])
        above = _risen(towards)
        first = utc_ns // TYPE_STEP_NS * TYPE_STEP_NS
        share = (utc_ns - first) / TYPE_STEP_NS
        value = np.zeros(directions.shape[:-1])
        for instant, weight in ((first, 1.0 - share), (first + TYPE_STEP_NS, share)):
            clearness, brightness = self._type(instant)
            level = weight * diffuse / _level(tuple(above.tolist()), clearness, brightness)
            value += level * relative_luminance(directions, above, clearness, brightness)
        if self.steady:
            return value
        through = np.exp(-self.clouds.thickness(directions, utc_ns))
        white = CLOUD_ALBEDO * (normal * max(0.0, float(towards[2])) + diffuse) / math.pi
        return np.where(directions[..., 2] > 0.0, value * through + white * (1.0 - through), 0.0)

    def _type(self, utc_ns: int) -> tuple[float, float]:
        """Clearness and brightness of the cloudless sky."""
        towards, normal, diffuse = self._cloudless(utc_ns)
        altitude = math.degrees(math.asin(float(_risen(towards)[2])))
        return clearness_and_brightness(round(normal, 3), max(1e-3, round(diffuse, 3)), round(altitude, 6))

    def _cloudless(self, utc_ns: int) -> tuple[Floats, float, float]:
        """Direction of the sun, its illuminance facing it and that of the sky on the horizontal [lx], no clouds."""
        towards = self.path(utc_ns)
        altitude = math.degrees(math.asin(max(-1.0, min(1.0, float(towards[2])))))
        # through twilight the sky fades by a factor of e with each degree that the sun sinks
        normal, diffuse = clear_day(max(altitude, 1.0), self.levels.turbidity)
        if altitude < 1.0:
            diffuse *= math.exp(min(0.0, altitude - 1.0))
            normal *= max(0.0, altitude)
        return towards, normal * self.levels.beam, diffuse * self.levels.diffuse


def _risen(towards: Floats) -> Floats:
    """The sun's direction, or where it would be one degree above the horizon: Perez's sun is never lower."""
    height = max(float(towards[2]), math.sin(math.radians(1.0)))
    return sky_vector(math.degrees(math.asin(min(1.0, height))), math.degrees(math.atan2(towards[0], towards[1])))


@lru_cache(maxsize=2048)
def _level(sun: tuple[float, float, float], clearness: float, brightness: float) -> float:
    """Horizontal illuminance of the relative distribution, on about 2500 directions."""
    directions, solid_angle = hemisphere()
    value = relative_luminance(directions, np.array(sun), clearness, brightness)
    return float(value @ (directions[:, 2] * solid_angle))


@cache
def hemisphere() -> tuple[Floats, Floats]:
    """About 2500 directions (n, 3) of the sky and their solid angles (n,) [sr]: an even sky gives exactly pi."""
    nodes = sky_nodes(57, (IDENTITY,))
    projected = float(np.sum(nodes.directions[:, 2] * nodes.solid_angle))
    return nodes.directions, nodes.solid_angle * (math.pi / projected)
