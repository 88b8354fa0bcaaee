"""The instruments without asyncio, for a notebook or a small script.

>>> from drivers import blocking
>>> with blocking.LuminanceMeter("/dev/ttyUSB0") as meter:  # doctest: +SKIP
...     print(meter.read().value)

All of them share one event loop in a background thread. Ctrl-C ends the call that is running as a cancelled task
would end: an arm on its way is stopped before the interrupt is raised.
"""

import asyncio
import atexit
import threading
from collections.abc import Coroutine, Sequence
from types import TracebackType
from typing import Any, Final, Generic, Protocol, Self, TypeVar

from drivers import camera, cl200, goniophotometer, ls110, ports
from drivers.camera.link import Link
from drivers.transport import Transport
from labdaq.clock import Clock, SystemClock
from labdaq.reading import Instrument, Reading

T = TypeVar("T")

_STOPPING_S: Final = 30.0
"""Longest wait for a cancelled call to come to rest [s]."""


class _Background:
    """One event loop in one thread, begun with the first call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Run ``work`` and return its result; an interrupt cancels it and waits until it has come to rest."""
        loop = self._running_loop()
        if threading.current_thread() is self._thread:
            work.close()
            raise RuntimeError("a blocking call inside the background loop would wait for itself; await the driver")
        rest = threading.Event()

        async def guarded() -> T:
            try:
                return await work
            finally:
                rest.set()

        future = asyncio.run_coroutine_threadsafe(guarded(), loop)
        try:
            return future.result()
        except BaseException:
            if not rest.is_set():
                future.cancel()
                rest.wait(_STOPPING_S)
            raise

    def _running_loop(self) -> asyncio.AbstractEventLoop:
        with self._lock:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                self._thread = threading.Thread(target=self._loop.run_forever, name="labdaq-drivers", daemon=True)
                self._thread.start()
                atexit.register(self._end)
            return self._loop

    def _end(self) -> None:
        """Stop the loop when Python ends."""
        if self._loop is not None and self._thread is not None:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()


_BACKGROUND: Final = _Background()


class _Driver(Protocol):
    """What all drivers have."""

    async def connect(self) -> None: ...
    async def aclose(self) -> None: ...
    def identity(self) -> Instrument: ...


D = TypeVar("D", bound=_Driver)


class _Blocking(Generic[D]):
    """Connecting, closing and identity of any driver; also as ``with`` block."""

    def __init__(self, driver: D) -> None:
        self._driver = driver

    def connect(self) -> None:
        """Open the port and set the instrument up; raises as the driver's `connect`."""
        _BACKGROUND.run(self._driver.connect())

    def close(self) -> None:
        """Close the port."""
        _BACKGROUND.run(self._driver.aclose())

    def identity(self) -> Instrument:
        """Who it is."""
        return self._driver.identity()

    def __enter__(self) -> Self:
        try:
            self.connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class LuminanceMeter(_Blocking[ls110.LuminanceMeter]):
    """An LS-110 on a serial port (``/dev/...``) or a device server (``tcp://HOST:PORT``)."""

    def __init__(
        self,
        port: str | Transport,
        options: ls110.LuminanceMeterOptions | None = None,
        *,
        name: str = "luminance-meter",
        clock: Clock | None = None,
    ) -> None:
        transport = ports.line(name, port, ls110.LINE) if isinstance(port, str) else port
        super().__init__(ls110.LuminanceMeter(name, transport, clock or SystemClock(), options))

    def read(self) -> Reading:
        """Measure once; see `drivers.ls110.LuminanceMeter.read`."""
        return _BACKGROUND.run(self._driver.read())

    def held(self) -> Reading:
        """Return the value on the display; see `drivers.ls110.LuminanceMeter.held`."""
        return _BACKGROUND.run(self._driver.held())


class ChromaMeter(_Blocking[cl200.ChromaMeter]):
    """A CL-200 or CL-200A on a serial port or a device server."""

    def __init__(
        self,
        port: str | Transport,
        options: cl200.ChromaMeterOptions | None = None,
        *,
        name: str = "chroma-meter",
        clock: Clock | None = None,
    ) -> None:
        transport = ports.line(name, port, cl200.LINE) if isinstance(port, str) else port
        super().__init__(cl200.ChromaMeter(name, transport, clock or SystemClock(), options))

    def measure(self) -> list[Reading]:
        """Measure with all heads; see `drivers.cl200.ChromaMeter.measure`."""
        return _BACKGROUND.run(self._driver.measure())


class Camera(_Blocking[camera.Camera]):
    """A camera on USB (``usb``, ``usb:04b0:010d``) or the network (``ptpip://HOST``)."""

    def __init__(
        self,
        port: str | Link = "usb",
        options: camera.CameraOptions | None = None,
        *,
        name: str = "camera",
        clock: Clock | None = None,
    ) -> None:
        link = ports.camera_link(name, port) if isinstance(port, str) else port
        super().__init__(camera.Camera(name, link, clock or SystemClock(), options))

    @property
    def exposures_s(self) -> tuple[float, ...]:
        """Exposure times that can be chosen [s]."""
        return self._driver.exposures_s

    def expose(self, exposure_s: float | None = None) -> list[camera.Photo]:
        """Take one picture; see `drivers.camera.Camera.expose`."""
        return _BACKGROUND.run(self._driver.expose(exposure_s))

    def bracket(self, exposures_s: Sequence[float] | None = None) -> list[camera.Photo]:
        """Take one picture at each exposure time; see `drivers.camera.Camera.bracket`."""
        return _BACKGROUND.run(self._driver.bracket(exposures_s))


class Goniophotometer(_Blocking[goniophotometer.Goniophotometer]):
    """The goniophotometer on a serial port (RTU) or, unless the options say otherwise, Modbus TCP (``tcp://HOST:502``)."""

    def __init__(
        self,
        port: str | Transport,
        options: goniophotometer.GoniophotometerOptions | None = None,
        *,
        name: str = "goniophotometer",
        clock: Clock | None = None,
    ) -> None:
        if options is None:
            is_tcp = isinstance(port, str) and port.startswith("tcp://")
            framing = goniophotometer.Framing.TCP if is_tcp else goniophotometer.Framing.RTU
            options = goniophotometer.GoniophotometerOptions(line=goniophotometer.LineOptions(framing=framing))
        transport = ports.line(name, port, options.line.settings) if isinstance(port, str) else port
        super().__init__(goniophotometer.Goniophotometer(name, transport, clock or SystemClock(), options))

    def home(self) -> None:
        """Find the arm's reference position; see `drivers.goniophotometer.Arm.home`."""
        _BACKGROUND.run(self._driver.home())

    def move_to(self, c_deg: float) -> float:
        """Turn to a C-plane [deg]; see `drivers.goniophotometer.Arm.move_to`."""
        return _BACKGROUND.run(self._driver.move_to(c_deg))

    def read(self) -> list[Reading]:
        """Read all heads; see `drivers.goniophotometer.Goniophotometer.read`."""
        return _BACKGROUND.run(self._driver.read())
