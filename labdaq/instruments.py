"""What a test needs of its instruments. Drivers fit these protocols; so do the fakes in the tests.

Every method raises `DeviceError` (or one of its kinds) when the instrument fails, ends within its own time limit, and
may be cancelled at any await without leaving the port unusable for `Goniophotometer.park` and `Device.aclose`.
"""

from collections.abc import Sequence
from typing import Protocol

import msgspec

from labdaq.clock import ClockState
from labdaq.errors import Place
from labdaq.reading import Flag, Instrument, Reading


class Photo(msgspec.Struct, frozen=True, kw_only=True):
    """A picture as the camera stored it.

    Attributes
    ----------
    name
        The camera's own file name, e.g. ``DSCN0042.JPG``; its ending tells the format.
    data
        The file, untouched.
    exposure_s
        Exposure time by the camera's own account (EXIF or exact property) [s]; ``None`` when it does not tell.
    nominal_exposure_s
        The shutter value it was set to [s].
    f_number, iso
        As set; ``None`` when the camera does not tell.
    utc_ns, mono_ns
        Middle of the exposure, as well as it is known [ns].
    """

    name: str
    data: bytes
    exposure_s: float | None
    nominal_exposure_s: float
    f_number: float | None = None
    iso: float | None = None
    utc_ns: int
    mono_ns: int
    clock: ClockState
    instrument: Instrument
    flags: tuple[Flag, ...] = ()


class Device(Protocol):
    """Any instrument: connected once, closed once."""

    def identity(self) -> Instrument:
        """Who and where it is: as declared before it is connected, as it says itself afterwards."""
        ...

    async def connect(self) -> None:
        """Open the port, make sure the right instrument answers, and make it ready to measure. Moves nothing."""
        ...

    async def aclose(self) -> None:
        """Give the port back; harmless when already closed or never opened."""
        ...


def place_of(device: Device) -> Place:
    """An instrument's name in the station file and its port, as errors tell them."""
    who = device.identity()
    return Place(who.name, who.port)


class LuminanceMeter(Device, Protocol):
    """Reads luminance where it looks."""

    async def read(self) -> Reading:
        """Measure once [cd/m²]."""
        ...


class ChromaMeter(Device, Protocol):
    """Reads illuminance with one or several heads."""

    async def measure(self) -> Sequence[Reading]:
        """Measure once with all heads together; at least one illuminance [lx] per head."""
        ...


class Camera(Device, Protocol):
    """Takes pictures with a chosen shutter time."""

    @property
    def exposures_s(self) -> Sequence[float]:
        """The shutter times that can be set [s]; empty when the camera lets nobody set them. Known once connected."""
        ...

    async def capture(self, exposure_s: float, raw: bool) -> Sequence[Photo]:
        """Set the shutter, expose, and return every file the camera made of it.

        ``raw`` asks for the sensor's own values; otherwise a JPEG. Raises `RefusedError` for a shutter time the camera
        does not have.
        """
        ...


class Goniophotometer(Device, Protocol):
    """Heads on an arm that turns about the aperture's axis."""

    async def home(self) -> None:
        """Find the arm's reference position; returns at once when it is known."""
        ...

    async def move_to(self, c_deg: float) -> float:
        """Turn to a C-plane, wait until it is reached and at rest; return the encoder's angle [deg, C]."""
        ...

    async def read(self) -> Sequence[Reading]:
        """Read all heads once where the arm is: one illuminance [lx] each, with ``gamma_deg`` and ``c_deg``."""
        ...

    async def stop(self) -> None:
        """Stop moving now; harmless at rest."""
        ...

    async def park(self) -> None:
        """Bring the arm to where it may stay, from any state it can be in, and wait until it is there."""
        ...
