"""All instruments of a station, emulated together: one clock, one world, every instrument on its own wire."""

from types import TracebackType
from typing import TYPE_CHECKING, Self

from labdaq.clock import Clock
from labdaq.pipe import PipeEnd
from simulators.camera import Camera, PtpIpFront
from simulators.cl200 import ChromaMeter, ChromaMeterWire
from simulators.goniophotometer import Goniophotometer
from simulators.line import FaultBox, MemoryPort, Port, open_pty, open_tcp
from simulators.line.ports import Serve
from simulators.ls110 import LuminanceMeter, LuminanceMeterWire
from simulators.options import INSTRUMENTS, SERIAL, EmulationOptions
from simulators.world.observed import World

if TYPE_CHECKING:
    from simulators.camera.usb_backend import EmulatedUsb

_SECOND_METER = 1_000_003  # so that the two chroma meters' noises differ


class EmulatedStation:
    """The station; ``async with EmulatedStation(world, clock) as station`` starts and stops it.

    Parameters
    ----------
    world
        What the instruments observe. With real ports it may be asked from a second thread, where pictures are made.
    clock
        Their time. A clock in virtual time needs ``in_memory``.
    options
        How they are set up.
    in_memory
        Reach them by `dial` instead of real ports.

    Attributes
    ----------
    ls110, cl200_global, cl200_diffuse, camera, goniophotometer
        The instruments behind the wires, for tests to look at and to spoil.
    line_faults
        The faults of each serial line, by instrument name.
    endpoints
        Instrument name to where it is reached; filled when started.

    Must be made inside a running event loop.
    """

    def __init__(
        self, world: World, clock: Clock, options: EmulationOptions | None = None, *, in_memory: bool = False
    ) -> None:
        self.options = options = options or EmulationOptions()
        if clock.state().source == "virtual" and not in_memory:
            raise ValueError("virtual time needs lines in memory: EmulatedStation(..., in_memory=True)")
        self._in_memory = in_memory
        self._clock = clock
        self.endpoints: dict[str, str] = {}
        self._ports: dict[str, Port] = {}
        self.line_faults = {name: FaultBox() for name in SERIAL}
        for trouble in options.troubles:
            self.line_faults[trouble.instrument].arm(trouble.fault, trouble.times, trouble.skip)
        faults, pacing, seed = self.line_faults, options.pacing, options.seed
        self.ls110 = LuminanceMeter(world, clock, options.ls110, seed)
        self.cl200_global = ChromaMeter(world, clock, options.cl200_global, seed)
        self.cl200_diffuse = ChromaMeter(world, clock, options.cl200_diffuse, seed + _SECOND_METER)
        self.camera = Camera(world, clock, options.camera, seed)
        self.goniophotometer = Goniophotometer(
            world, clock, options.goniophotometer, seed, line_faults=faults["goniophotometer_rtu"], pacing=pacing
        )
        luminance = LuminanceMeterWire(self.ls110, clock, faults["ls110"], pacing=pacing)
        chroma = ChromaMeterWire(self.cl200_global, clock, faults["cl200_global"], pacing=pacing)
        shaded = ChromaMeterWire(self.cl200_diffuse, clock, faults["cl200_diffuse"], pacing=pacing)
        self._serve: dict[str, Serve] = {
            "ls110": luminance.serve,
            "cl200_global": chroma.serve,
            "cl200_diffuse": shaded.serve,
            "camera_ptpip": PtpIpFront(self.camera, clock).serve,
            "goniophotometer_rtu": self.goniophotometer.rtu.serve,
            "goniophotometer_tcp": self.goniophotometer.tcp.serve,
        }

    def dial(self, instrument: str) -> PipeEnd:
        """Open a fresh line in memory to an instrument, as opening its port would; only with ``in_memory``.

        The camera takes two: first the command, then the event connection.
        """
        port = self._ports.get(instrument)
        if not isinstance(port, MemoryPort):
            raise KeyError(
                f"no line in memory leads to '{instrument}'; there are {', '.join(self.endpoints) or 'none'}"
            )
        return port.dial()

    def usb(self) -> "EmulatedUsb":
        """A pyusb backend with the station's camera plugged in: ``usb.core.find(backend=station.usb())``.

        In virtual time its reads do not wait: they time out at once where there is nothing yet.
        """
        from simulators.camera.usb_backend import EmulatedUsb

        return EmulatedUsb(self.camera, blocking=self._clock.state().source != "virtual")

    async def start(self) -> None:
        """Open all ports; raises `OSError` when a TCP port is taken, and then none stays open."""
        try:
            for name in INSTRUMENTS:
                self._ports[name] = await self._open(name)
                self.endpoints[name] = self._ports[name].endpoint
        except BaseException:
            await self.aclose()
            raise

    async def aclose(self) -> None:
        """Close all ports; raises the first error that an emulator had in its conversations."""
        failure: BaseException | None = None
        for port in self._ports.values():
            try:
                await port.aclose()
            except Exception as error:
                failure = failure or error
        self._ports.clear()
        self.endpoints.clear()
        if failure is not None:
            raise failure

    async def _open(self, name: str) -> Port:
        serve, options = self._serve[name], self.options
        if self._in_memory:
            return MemoryPort(serve, f"memory:{name}")
        if name in SERIAL and options.serial == "pty":
            return open_pty(serve)
        number = {"camera_ptpip": options.camera_port, "goniophotometer_tcp": options.modbus_port}.get(name, 0)
        return await open_tcp(serve, options.host, number)

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        await self.aclose()
