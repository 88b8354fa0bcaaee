"""Which luminance meter is emulated, how it is set up, and in what state it is."""

from dataclasses import dataclass
from typing import Final

from simulators.ls110.optics import LuminanceResponse, faithful


@dataclass(frozen=True, slots=True)
class LuminanceMeterModel:
    """Figures of a model (data sheets; the reference rates them as remembered, not verified).

    Attributes
    ----------
    name
        Model name.
    field_deg
        Full acceptance angle [deg].
    fast_limit_cd_m2, slow_limit_cd_m2
        End of the detector's range with fast and slow response [cd/m²].
    display_limit
        Largest number that fits the display.
    finest
        Smallest step of the last digit.
    """

    name: str
    field_deg: float
    fast_limit_cd_m2: float
    slow_limit_cd_m2: float
    display_limit: float
    finest: float


LS110: Final = LuminanceMeterModel("LS-110", 1.0 / 3.0, 999_900.0, 499_900.0, 999_900.0, 0.01)
LS100: Final = LuminanceMeterModel("LS-100", 1.0, 299_900.0, 49_990.0, 999_900.0, 0.001)


@dataclass(frozen=True, slots=True)
class LuminanceMeterOptions:
    """How the meter stands and what state it is in.

    Attributes
    ----------
    model
        `LS110` or `LS100`.
    altitude_deg, azimuth_deg
        Where it looks [deg]; the zenith by default.
    remote_mode
        Whether it was switched on with the F key held; without it the meter never answers.
    footlamberts
        Position of the meter's unit switch.
    repeatability
        Two standard deviations of repeated readings, relative (data sheet: 0.2 %).
    battery_exhausted
        Every measurement answers with that check code.
    leaves_remote_mode_in_the_dark
        Copy what users report: if the first reading is below 0.1 cd/m² the meter drops out of remote mode.
    response
        Hook: what the meter makes of the true luminance of its field.
    """

    model: LuminanceMeterModel = LS110
    altitude_deg: float = 90.0
    azimuth_deg: float = 0.0
    remote_mode: bool = True
    footlamberts: bool = False
    repeatability: float = 0.002
    battery_exhausted: bool = False
    leaves_remote_mode_in_the_dark: bool = False
    response: LuminanceResponse = faithful
