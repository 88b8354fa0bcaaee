"""What a station file says about a chroma meter."""

from dataclasses import dataclass

from labdaq.errors import ConfigError, Problems


@dataclass(frozen=True, slots=True)
class Head:
    """One receptor head.

    Attributes
    ----------
    number
        As set on its rotary switches, 0 to 29; 0 for a head plugged straight into the body.
    channel
        Name of its readings: the illuminance has it, chromaticity and colour temperature add ``.x``, ``.y``, ``.tcp``.
    serial, calibration
        Declared, since the protocol has no word for them.
    """

    number: int = 0
    channel: str = "illuminance"
    serial: str = ""
    calibration: str = ""


@dataclass(frozen=True, slots=True)
class ChromaMeterOptions:
    """What the station file says about a chroma meter.

    Attributes
    ----------
    heads
        Its heads, each with a different number.
    model, serial, firmware
        Declared, since the protocol has no word for them.
    colour_temperature
        Read the correlated colour temperature as well.
    timeout_s
        Longest wait for a reply [s]; its frame takes 0.05 s on the wire.
    resends
        How often a question is asked again when its answer is void or missing. A trigger is never sent again so.
    retriggers
        How often a new measurement is made when a head changes its range.
    limit_relative, limit_digits, limit_xy
        The maker's limits of error, see `ChromaMeter.measure`.
    """

    heads: tuple[Head, ...] = (Head(),)
    model: str = "CL-200A"
    serial: str = ""
    firmware: str = ""
    colour_temperature: bool = False
    timeout_s: float = 2.0
    resends: int = 2
    retriggers: int = 3
    limit_relative: float = 0.02
    limit_digits: int = 1
    limit_xy: float = 0.002

    def __post_init__(self) -> None:
        problems = Problems("chroma meter")
        numbers = [head.number for head in self.heads]
        if not numbers:
            problems.add("heads", "there must be at least one")
        for number in sorted(set(numbers)):
            if not 0 <= number <= 29:
                problems.add("heads", f"number {number} is not one of a rotary switch, 0 to 29")
            if numbers.count(number) > 1:
                problems.add("heads", f"number {number} is given twice")
        problems.raise_if_any(ConfigError)
