"""The test script: what one test measures, when, and how long it may take.

One test is what the Greenwood report's chapter 3 describes: a bracket of exposures of the sky with a zenith reading at
each, global and diffuse illuminance throughout, and the arm through all C-planes with all its heads read in each.
"""

from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator

from labdaq.config import Name, NotNegative, Positive, Table, load

FORMAT: Final = "labdaq-script/1"

SIXTEEN_EXPOSURES_S: Final = tuple(float(2.0 ** (3 - k)) for k in range(16))
"""8 s to 1/4096 s in whole stops; a camera's nominal 1/15, 1/30, 1/60 ... are the nearest it can be set to."""

SIXTEEN_PLANES_DEG: Final = tuple(22.5 * k for k in range(16))


def _seconds(value: Any) -> Any:
    """Let a shutter time be written as a photographer does: ``"1/60"``."""
    if isinstance(value, str):
        try:
            return float(Fraction(value))
        except (ValueError, ZeroDivisionError):
            raise ValueError(f"must be seconds, or a fraction such as '1/60', not {value!r}") from None
    return value


Exposure = Annotated[Positive, BeforeValidator(_seconds)]
Plane = Annotated[float, Field(ge=0, lt=360)]


class ClockDemand(Table):
    """What the test asks of the clock.

    Attributes
    ----------
    require
        ``refuse``: no reading without a synchronised clock; ``flag``: readings taken without one say so. An emulated
        time is not legal time and is flagged either way.
    max_error_s
        Largest bound on the offset from UTC [s]; the station's, when it is not given.
    """

    require: Literal["refuse", "flag"] = "flag"
    max_error_s: Positive | None = None


class Exposures(Table):
    """The bracket of the sky.

    Attributes
    ----------
    times_s
        Shutter times, in the order they are taken [s].
    period_s
        From one exposure to the next [s].
    zenith_readings
        Luminance readings at each exposure.
    photo_format
        ``jpeg`` or ``raw``.
    """

    times_s: Annotated[tuple[Exposure, ...], Field(min_length=1, max_length=64)] = SIXTEEN_EXPOSURES_S
    period_s: Positive = 9.0
    zenith_readings: Annotated[int, Field(ge=0, le=10)] = 1
    photo_format: Literal["jpeg", "raw"] = "jpeg"

    @field_validator("times_s")
    @classmethod
    def _all_differ(cls, times: tuple[float, ...]) -> tuple[float, ...]:
        for t in dict.fromkeys(times):
            if times.count(t) > 1:
                raise ValueError(f"{t:g} s is given twice")
        return times

    @field_validator("period_s")
    @classmethod
    def _long_enough(cls, period: float, info: ValidationInfo) -> float:
        longest = max(info.data.get("times_s", (0.0,)))
        if period <= longest:
            raise ValueError(f"{period:g} s is too short for an exposure of {longest:g} s")
        return period


class Illuminance(Table):
    """Global and diffuse illuminance, read by every chroma meter from before the first step to after the last.

    Attributes
    ----------
    period_s
        From one reading to the next [s]; a CL-200 needs about 0.7 s.
    """

    period_s: Annotated[float, Field(ge=0.5, allow_inf_nan=False)] = 2.0


class Scan(Table):
    """The arm's way.

    Attributes
    ----------
    c_planes_deg
        C-planes in the order they are visited [deg].
    period_s
        From one plane to the next [s]; 0 goes on as soon as a plane is done.
    repeats
        How often the heads are read in each plane.
    """

    c_planes_deg: Annotated[tuple[Plane, ...], Field(min_length=1, max_length=360)] = SIXTEEN_PLANES_DEG
    period_s: NotNegative = 9.0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1

    @field_validator("c_planes_deg")
    @classmethod
    def _all_differ(cls, planes: tuple[float, ...]) -> tuple[float, ...]:
        for c in dict.fromkeys(planes):
            if planes.count(c) > 1:
                raise ValueError(f"the plane C = {c:g} is given twice; ask for 'repeats' to read it more than once")
        return planes


class Limits(Table):
    """How long things may take [s]; beyond, the test ends with an error and a parked arm.

    Attributes
    ----------
    connect_s, step_s, home_s, park_s
        For connecting all instruments, for one step of one instrument, for homing and for parking the arm.
    grace_s
        How long a step under way may go on after the operator asked to stop.
    late_s
        How late a step may start before its readings are flagged as late.
    test_s
        For the test from the first illuminance to the last step, without homing and parking.
    """

    connect_s: Positive = 30.0
    step_s: Positive = 45.0
    home_s: Positive = 150.0
    park_s: Positive = 60.0
    grace_s: NotNegative = 10.0
    late_s: Positive = 1.0
    test_s: Positive = 300.0


class Script(Table):
    """A whole test script.

    Attributes
    ----------
    test
        Identifier of the test, e.g. ``T18``.
    system
        What hangs in the roof, e.g. ``box``.
    sky
        How the observers would label the sky.
    repeats, pause_s
        How often the test is taken, each time as a session of its own, and how long to wait in between [s].
    """

    format: Literal["labdaq-script/1"] = FORMAT
    test: Name
    system: Name
    sky: Literal["clear", "partly-cloudy", "overcast", "unknown"] = "unknown"
    operator: str = ""
    note: str = ""
    repeats: Annotated[int, Field(ge=1, le=1000)] = 1
    pause_s: NotNegative = 0.0
    clock: ClockDemand = ClockDemand()
    exposures: Exposures = Exposures()
    illuminance: Illuminance = Illuminance()
    scan: Scan = Scan()
    limits: Limits = Field(default=Limits(), validate_default=True)

    @field_validator("limits")
    @classmethod
    def _enough_time(cls, limits: Limits, info: ValidationInfo) -> Limits:
        exposures, scan = info.data.get("exposures"), info.data.get("scan")
        if exposures and scan and limits.test_s < (needed := _planned_s(exposures, scan)):
            raise ValueError(
                f"test_s = {limits.test_s:g} is less than the {needed:g} s that the test is planned to take"
            )
        return limits

    @property
    def planned_s(self) -> float:
        """How long the test takes when every step starts on time and none overruns [s]."""
        return _planned_s(self.exposures, self.scan)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a test script; raises `ConfigError` listing all mistakes."""
        return load(path, cls)


def _planned_s(exposures: Exposures, scan: Scan) -> float:
    return max(exposures.period_s * len(exposures.times_s), scan.period_s * len(scan.c_planes_deg))
