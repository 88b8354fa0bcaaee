"""Which chroma meter is emulated and in what state it is."""

from dataclasses import dataclass

from simulators.cl200.heads import Head


@dataclass(frozen=True, slots=True)
class ChromaMeterOptions:
    """A CL-200 or CL-200A.

    Attributes
    ----------
    model
        ``CL-200A``, or ``CL-200`` which ignores the commands 15, 45, 47 and 48.
    heads
        Heads connected, with different numbers.
    battery_low
        Every reading says its values must not be used.
    repeatability
        Two standard deviations of repeated illuminances, relative (data sheet: 0.5 %).
    chromaticity_repeatability
        Two standard deviations of repeated x and y (data sheet: 0.0005).
    zero_calibration_s
        How long after power-up the meter is deaf [s].
    """

    model: str = "CL-200A"
    heads: tuple[Head, ...] = (Head(),)
    battery_low: bool = False
    repeatability: float = 0.005
    chromaticity_repeatability: float = 0.0005
    zero_calibration_s: float = 0.0

    def __post_init__(self) -> None:
        numbers = [head.number for head in self.heads]
        if len(set(numbers)) != len(numbers) or not all(0 <= number <= 29 for number in numbers):
            raise ValueError(f"the heads of one meter need different numbers from 0 to 29, not {numbers}")
