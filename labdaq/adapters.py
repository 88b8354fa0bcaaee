"""Drivers whose words differ from what a test asks for, brought in line with `labdaq.instruments`."""

from collections.abc import Sequence
from typing import Final

import drivers.camera
import drivers.goniophotometer
from labdaq.errors import RefusedError
from labdaq.instruments import Photo, place_of
from labdaq.reading import Instrument, Reading

JPEG_FORMATS: Final = frozenset({0x3801, 0x3808})
"""PTP object formats EXIF/JPEG and JFIF."""


class BenchArm:
    """The goniophotometer, with a place to park its arm."""

    def __init__(self, driver: drivers.goniophotometer.Goniophotometer, park_c_deg: float) -> None:
        self._driver = driver
        self._park_c_deg = park_c_deg

    def identity(self) -> Instrument:
        """Who and where it is."""
        return self._driver.identity()

    async def connect(self) -> None:
        """Open the line and check drive and modules; nothing moves."""
        await self._driver.connect()

    async def aclose(self) -> None:
        """Close the line."""
        await self._driver.aclose()

    async def home(self) -> None:
        """Find the reference position, if the drive does not know it."""
        await self._driver.home()

    async def move_to(self, c_deg: float) -> float:
        """Turn to a C-plane [deg] and return where the arm is [deg]."""
        return await self._driver.move_to(c_deg)

    async def read(self) -> Sequence[Reading]:
        """Read all heads once [lx]."""
        return await self._driver.read()

    async def stop(self) -> None:
        """Stop the arm now."""
        await self._driver.arm.stop()

    async def park(self) -> None:
        """Turn the arm to where it is parked, finding its reference first if that was lost."""
        await self._driver.home()
        await self._driver.move_to(self._park_c_deg)


class BenchCamera:
    """The camera, with every file it makes of an exposure; asked for RAW it must not give JPEG alone."""

    def __init__(self, driver: drivers.camera.Camera) -> None:
        self._driver = driver

    def identity(self) -> Instrument:
        """Who and where it is."""
        return self._driver.identity()

    async def connect(self) -> None:
        """Connect and find out what the camera can do."""
        await self._driver.connect()

    async def aclose(self) -> None:
        """Disconnect."""
        await self._driver.aclose()

    @property
    def exposures_s(self) -> Sequence[float]:
        """The shutter times that can be set [s]."""
        return self._driver.exposures_s

    async def capture(self, exposure_s: float, raw: bool) -> Sequence[Photo]:
        """Take one picture. The middle of its exposure is half its length after the release, as well as is known."""
        taken = await self._driver.expose(exposure_s)
        wanted = [p for p in taken if (p.format in JPEG_FORMATS) != raw]
        if not wanted:
            given = ", ".join(p.name for p in taken)
            raise RefusedError(
                f"the script asks for {'RAW' if raw else 'JPEG'} pictures, the camera gave {given}",
                place=place_of(self),
                hint="set the image quality at the camera, or [exposures] photo_format in the script",
            )
        return [_photo(p, exposure_s) for p in taken]


def _photo(p: drivers.camera.Photo, nominal_s: float) -> Photo:
    half_ns = round(nominal_s * 1e9 / 2)
    after_release_ns = min(half_ns, (p.ended_mono_ns - p.began_mono_ns) // 2)
    return Photo(
        name=p.name,
        data=p.data,
        exposure_s=p.exposure_s,
        nominal_exposure_s=nominal_s,
        f_number=p.f_number,
        iso=p.iso,
        utc_ns=p.began_utc_ns + after_release_ns,
        mono_ns=p.began_mono_ns + after_release_ns,
        clock=p.clock,
        instrument=p.instrument,
    )
