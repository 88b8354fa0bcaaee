"""A reading is never a bare number.

It carries its unit and standard uncertainty, two times and the state of the clock that gave them, what was doubtful
about it, the instrument's raw reply, and who the instrument was.
"""

from enum import StrEnum

import msgspec

from labdaq.clock import ClockState
from labdaq.units import Quantity, Unit


class Flag(StrEnum):
    """What is doubtful about a reading; a reading may carry several."""

    OVER_RANGE = "over-range"  # the instrument said its range ended; there is no value
    LOW_LIGHT = "low-light"  # below the level at which the value keeps its accuracy
    LOW_BATTERY = "low-battery"  # the instrument says its values must not be used
    SATURATED = "saturated"  # the converter or the sensor sat at its end
    LOWER_BOUND = "lower-bound"  # the true value is at least this
    RETRIED = "retried"  # the first answer was void; this one was asked for again
    LATE = "late"  # taken after its time on the schedule
    MOVED = "moved"  # the arm was not quite where it was sent
    STALE = "stale"  # no new measurement lies behind this number
    UNSYNCHRONISED = "unsynchronised"  # the clock had no time server
    MISSING = "missing"  # asked for and not had


class Instrument(msgspec.Struct, frozen=True, kw_only=True):
    """Who took a reading.

    Attributes
    ----------
    name
        Its name in the station file, e.g. ``roof-luminance``.
    model, serial, firmware
        As the instrument itself says, or as the station file does where the protocol has no word for it.
    port
        Where it was reached.
    calibration
        Identifier of the certificate in force; empty when none is declared.
    """

    name: str
    model: str
    serial: str = ""
    firmware: str = ""
    port: str = ""
    calibration: str = ""


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """One value of one channel at one time.

    Attributes
    ----------
    channel
        What was read, unique within the station: ``sky.zenith``, ``sky.global``, ``gonio.g45``.
    value
        In ``unit``; ``None`` when there is none (see ``flags``).
    uncertainty
        Standard uncertainty of the value [``unit``]; ``None`` when unknown.
    utc_ns, mono_ns
        Middle of the integration [ns].
    duration_s
        Length of the integration on the reading clock [s]; 0 when the instrument does not tell.
    raw
        The instrument's reply as it came, hexadecimal.
    at
        Where the sensor was or looked, e.g. ``{"gamma_deg": 45.0, "c_deg": 22.5}``; empty when fixed.
    """

    channel: str
    quantity: Quantity
    value: float | None
    unit: Unit
    uncertainty: float | None
    utc_ns: int
    mono_ns: int
    clock: ClockState
    instrument: Instrument
    duration_s: float = 0.0
    flags: tuple[Flag, ...] = ()
    raw: str = ""
    at: dict[str, float] = {}

    @property
    def usable(self) -> bool:
        """Whether the value may be used as a value (not missing, not beyond the range)."""
        spoilt = {Flag.OVER_RANGE, Flag.LOW_BATTERY, Flag.SATURATED, Flag.MISSING}
        return self.value is not None and not spoilt.intersection(self.flags)
