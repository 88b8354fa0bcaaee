"""What any engine predicts: sun part and sky part, far field and near field."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.photometry import Distribution
from analysis.simulate.daylight import Daylight
from analysis.simulate.system import System
from analysis.simulate.tally import Field
from labdaq.errors import ConfigError

Floats = NDArray[np.float64]
Engine = Literal["tracer", "radiance"]


@dataclass(frozen=True)
class SunAndSky:
    """Two parts of a prediction in one field.

    Attributes
    ----------
    sun, sky
        Distributions over the same angles [cd].
    sun_uncertainty, sky_uncertainty : shape (C, gamma) [cd]
        Standard uncertainty from statistics alone.
    """

    sun: Distribution
    sky: Distribution
    sun_uncertainty: Floats
    sky_uncertainty: Floats

    @property
    def total(self) -> Distribution:
        """Sun part plus sky part."""
        return dataclasses.replace(self.sun, candela=self.sun.candela + self.sky.candela)

    @property
    def uncertainty(self) -> Floats:
        """Standard uncertainty of the total [cd], shape (C, gamma)."""
        return np.hypot(self.sun_uncertainty, self.sky_uncertainty)

    def worst_relative(self) -> float:
        """Root mean square relative uncertainty of the total where it is above 5 % of its largest value."""
        candela = self.total.candela
        bright = candela > 0.05 * candela.max()
        if not bright.any():
            return 0.0
        return float(np.sqrt(np.mean((self.uncertainty[bright] / candela[bright]) ** 2)))


@dataclass(frozen=True)
class Prediction:
    """What an engine predicts.

    Attributes
    ----------
    engine
        ``tracer`` or ``radiance``.
    far
        Far field.
    near
        As sensors at ``distance_m`` measure it (E times distance squared), with the room's light if there is a room;
        None where no distance was asked for.
    facts
        How it was made: rays, balance, and so on; JSON values.
    """

    system: System
    daylight: Daylight
    engine: str
    far: SunAndSky
    near: SunAndSky | None
    distance_m: float
    facts: dict[str, Any]

    @property
    def sun(self) -> Distribution:
        """Far field of the sun part."""
        return self.far.sun

    @property
    def sky(self) -> Distribution:
        """Far field of the sky part."""
        return self.far.sky

    def field(self, name: Field) -> SunAndSky:
        """The far or the near field; raises `ConfigError` where there is no near field."""
        if name == "far":
            return self.far
        if self.near is None:
            raise ConfigError("the prediction has no near field", "give a distance")
        return self.near
