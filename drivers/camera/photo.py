"""A picture as the camera handed it over."""

from dataclasses import dataclass
from pathlib import PurePosixPath

from labdaq.clock import ClockState
from labdaq.reading import Instrument


@dataclass(frozen=True, slots=True)
class Photo:
    """One file of one exposure; an exposure of RAW and JPEG gives two.

    Attributes
    ----------
    name
        File name in the camera.
    data
        The file.
    format
        PTP format code; 0x3801 is JPEG with EXIF, 0x3811 DNG, 0x3000 undefined (Nikon's NEF comes so).
    exposure_s
        What the shutter was set to, as the fraction on the dial [s]; ``None`` when the camera chose. EXIF has the
        truth.
    f_number, iso
        What the camera said these were set to; ``None`` when it does not say.
    began_utc_ns, ended_utc_ns, began_mono_ns, ended_mono_ns
        Release, and first word of the finished picture, on both clocks [ns]; the exposure lies between.
    clock
        State of that clock.
    instrument
        Who took it.
    captured
        The camera's own date of it (``YYYYMMDDThhmmss``), as it says.
    """

    name: str
    data: bytes
    format: int
    exposure_s: float | None
    f_number: float | None
    iso: int | None
    began_utc_ns: int
    ended_utc_ns: int
    began_mono_ns: int
    ended_mono_ns: int
    clock: ClockState
    instrument: Instrument
    captured: str = ""

    @property
    def suffix(self) -> str:
        """Ending of the file name in lower case, e.g. ``.nef``."""
        return PurePosixPath(self.name).suffix.lower()
