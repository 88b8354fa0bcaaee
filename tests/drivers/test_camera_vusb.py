"""The camera's driver against somebody else's camera: the virtual one that libgphoto2 brings for its own tests.

It is reached through a small pyusb backend over libgphoto2's port library; nothing of libgphoto2's protocol code is
between. It speaks as a Nikon D750 does over USB, insists on both parameters of InitiateCapture, announces folders as
objects, and puts data and response into one transfer.
"""

import array
import asyncio
import ctypes
import errno
import importlib.util
from pathlib import Path
from typing import Any

import pytest
import usb.core
from camera_bench import UsbFront

from drivers.camera import Camera, CameraOptions, UsbPtp
from labdaq.clock import SystemClock
from labdaq.errors import ConfigError, RefusedError

found = importlib.util.find_spec("gphoto2")
if found is None or found.origin is None:
    pytest.skip("python-gphoto2 is not installed; it brings the virtual camera", allow_module_level=True)
HOME = Path(found.origin).parent / "libgphoto2"
TIMEOUT = -10
PICTURE = b"\xff\xd8\xff\xe0" + bytes(i % 253 for i in range(50_000)) + b"\xff\xd9"


class Vusb(UsbFront):
    """A pyusb backend whose only camera is libgphoto2's virtual one."""

    def __init__(self) -> None:
        super().__init__(Any, packet=512)  # type: ignore[arg-type]  # one device; it answers itself
        self.library = ctypes.CDLL(str(HOME / "libgphoto2_port.so.12"))
        ports, info = ctypes.c_void_p(), ctypes.c_void_p()
        self.port = ctypes.c_void_p()
        self._call("gp_port_info_list_new", ctypes.byref(ports))
        self._call("gp_port_info_list_load", ports)
        self._call("gp_port_info_list_get_info", ports, 0, ctypes.byref(info))
        self._call("gp_port_new", ctypes.byref(self.port))
        self._call("gp_port_set_info", self.port, info)
        self._call("gp_port_open", self.port)

    def _call(self, name: str, *arguments: Any) -> int:
        result = int(getattr(self.library, name)(*arguments))
        if result == TIMEOUT:
            raise usb.core.USBTimeoutError(name, -7, errno.ETIMEDOUT)
        assert result >= 0, f"{name}: {result}"
        return result

    def bulk_write(self, handle: int, end: int, intf: int, data: "array.array[int]", timeout: int) -> int:
        return self._call("gp_port_write", self.port, data.tobytes(), len(data)) if data else 0

    def bulk_read(self, handle: int, end: int, intf: int, buffer: "array.array[int]", timeout: int) -> int:
        into = (ctypes.c_char * len(buffer)).from_buffer(buffer)
        count = self._call("gp_port_read", self.port, into, len(buffer))
        if not count:  # a real device would have nothing to send
            self.asleep.wait(0.01)
            raise usb.core.USBTimeoutError("nothing there", -7, errno.ETIMEDOUT)
        return count

    def intr_read(self, handle: int, end: int, intf: int, buffer: "array.array[int]", timeout: int) -> int:
        into = (ctypes.c_char * len(buffer)).from_buffer(buffer)
        self._call("gp_port_set_timeout", self.port, min(timeout, 50))
        return self._call("gp_port_check_int", self.port, into, len(buffer))


def test_a_bracket_on_somebody_elses_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IOLIBS", str(HOME / "vusb"))  # and back: whoever uses libgphoto2 next wants its real ports
    monkeypatch.setenv("VCAMERADIR", str(tmp_path))
    card = tmp_path / "DCIM" / "100TEST"
    card.mkdir(parents=True)
    (card / "FIRST.JPG").write_bytes(PICTURE)  # what the virtual camera gives for every picture it takes
    front = Vusb()

    async def main() -> None:
        driver = Camera(
            "sky-camera", UsbPtp("sky-camera", backend=front), SystemClock(), CameraOptions(delete_after=True)
        )
        await driver.connect()
        who = driver.identity()
        assert "VC" in who.model and who.firmware, who
        assert await driver.battery_percent() is not None
        assert [card.description for card in (await driver.storages()).values()]
        exposures = driver.exposures_s
        assert len(exposures) > 3
        with pytest.raises(ConfigError, match="it offers"):
            await driver.expose(1234.0)
        chosen = [exposures[0], exposures[len(exposures) // 2], exposures[-1]]
        photos = await driver.bracket(chosen)
        assert [photo.exposure_s for photo in photos] == chosen
        assert [photo.data for photo in photos] == [PICTURE] * 3
        assert len({photo.name for photo in photos}) == 3
        assert all(photo.suffix == ".jpg" and photo.format == 0x3801 for photo in photos)
        with pytest.raises(RefusedError, match=r"GET_OBJECT_INFO\(0x7FFF\) was refused with 0x2009"):
            await driver._session.object_info(0x7FFF)
        assert len(await driver.expose()) == 1
        await driver.aclose()

    asyncio.run(main())
