"""A bench model of the goniophotometer for driver tests: a drive and two modules that answer RTU frames from tables.

It is written from the makers' register lists, with its own check sum, and only does what the tests ask for: it has
faults to switch on, a motor with constant speed, and it writes down every request it obeyed.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from drivers.goniophotometer import Goniophotometer, GoniophotometerOptions
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.pipe import PipeEnd, pipe

START = 1_279_804_320_000_000_000


def crc(data: bytes) -> bytes:
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def now() -> float:
    return asyncio.get_running_loop().time()


@dataclass
class Drive:
    """A motor that turns with constant speed from one target to the next."""

    lag_s: float = 0.15  # from the trigger to the first motion, while the old status still stands
    homed: bool = True
    enabled: bool = True
    alarm: int = 0
    pulses: int = 10_000
    deaf: bool = False  # obeys nothing, but acknowledges
    stuck_running: bool = False
    stops_short: int = 0  # stops this many counts before its target
    home_s: float = 3.0
    origin: float = 0.0
    target: int = 0
    began: float = -100.0
    speed: float = 1.0  # counts per second
    homing: bool = False
    stopped: int = 0
    moves: list[int] = field(default_factory=list)

    def position(self) -> int:
        run = max(0.0, now() - self.began - self.lag_s) * self.speed
        way = self.target - self.origin
        return round(self.origin + max(-run, min(run, way)) if abs(way) > run else self.target)

    def running(self) -> bool:
        started = now() >= self.began + self.lag_s
        if self.homing:
            if now() < self.began + self.home_s:
                return started
            self.homing, self.homed, self.origin, self.target = False, True, 0.0, 0
            return False
        return started and (self.stuck_running or self.position() != self.target)

    def status(self) -> int:
        running = self.running()
        word = (1 if self.alarm else 0) | (2 if self.enabled else 0) | (0x40 if self.homed else 0)
        return word | (0x04 if running else 0x30)

    def trigger(self, word: int) -> None:
        if self.deaf:
            return
        if word == 0x20:
            self.homing, self.began, self.homed = True, now(), False
        elif word == 0x40:
            self.origin = self.target = self.position()
            self.began, self.stuck_running, self.homing = -100.0, False, False
            self.stopped += 1

    def go(self, block: list[int]) -> None:
        mode, high, low, rpm, *_, start = block
        assert (mode, start) == (1, 0x10), "an absolute move, started by the last word"
        target = (high << 16 | low) - (1 << 32 if high & 0x8000 else 0)
        self.moves.append(target)
        if self.deaf:
            return
        self.origin, self.began, self.speed = self.position(), now(), rpm * self.pulses / 60
        self.target = target - (self.stops_short if target > self.origin else -self.stops_short)

    def read(self, address: int, count: int) -> list[int] | None:
        if (address, count) == (0x1003, 1):
            return [self.status()]
        if (address, count) == (0x1014, 2):
            value = self.position() & 0xFFFFFFFF
            return [value >> 16, value & 0xFFFF]
        if (address, count) == (0x2203, 1):
            return [self.alarm]
        return [self.pulses] if (address, count) == (0x0001, 1) else None

    def write(self, address: int, values: list[int]) -> bool:
        if (address, len(values)) == (0x6200, 8):
            self.go(values)
        elif address == 0x6002:
            self.trigger(values[0])
        elif (address, values[0]) == (0x1801, 0x1111):
            self.alarm = 0
        else:
            return False
        return True


@dataclass
class Module:
    """Eight words, a range each, and the flag of a restart."""

    codes: list[int] = field(default_factory=lambda: [0] * 8)
    ranges: list[int] = field(default_factory=lambda: [8] * 8)
    name: tuple[int, int] = (0x0708, 0x2008)
    restarted: bool = True
    engineering: bool = False
    stubborn: bool = False  # acknowledges settings and forgets them

    def read(self, address: int, count: int) -> list[int] | None:
        if (address, count) == (0x0100, 8):
            return self.ranges
        return [0x0102, 0x00A1, self.name[1], self.name[0]] if (address, count) == (0x01E0, 4) else None

    def bit(self, address: int) -> int | None:
        if address == 0x0110:
            was, self.restarted = self.restarted, False
            return int(was)
        return int(self.engineering) if address == 0x010C else None

    def write(self, address: int, values: list[int]) -> bool:
        if not 0x0100 <= address < 0x0108:
            return False
        if not self.stubborn:
            self.ranges[address - 0x0100] = values[0]
        return True


Answer = list[tuple[float, bytes]]


@dataclass
class Bench:
    """All devices, what they were asked, and a hook that may bend an answer."""

    drive: Drive = field(default_factory=Drive)
    modules: dict[int, Module] = field(default_factory=lambda: {2: Module(), 3: Module()})
    asked: list[tuple[float, bytes]] = field(default_factory=list)
    bend: Callable[[bytes, bytes], Answer | None] = lambda request, answer: None
    tcp: bool = False

    def obey(self, body: bytes) -> bytes:
        """Answer unit, function and content (no framing); empty for a unit that is not there."""
        unit, function, address, number = (
            body[0],
            body[1],
            int.from_bytes(body[2:4], "big"),
            int.from_bytes(body[4:6], "big"),
        )
        device = self.drive if unit == 1 else self.modules.get(unit)
        if device is None:
            return b""
        content: bytes | None = None
        if function == 3 and (words := device.read(address, number)) is not None:
            content = bytes([2 * number]) + b"".join(word.to_bytes(2, "big") for word in words)
        elif function == 4 and isinstance(device, Module) and (address, number) == (0, 8):
            content = bytes([16]) + b"".join(word.to_bytes(2, "big") for word in device.codes)
        elif function == 1 and isinstance(device, Module) and (bit := device.bit(address)) is not None:
            content = bytes([1, bit])
        elif function == 5 and isinstance(device, Module) and address == 0x010C:
            device.engineering = device.engineering if device.stubborn else bool(number)
            content = body[2:6]
        elif function == 6 and device.write(address, [number]):
            content = body[2:6]
        elif function == 16:
            words = [int.from_bytes(body[i : i + 2], "big") for i in range(7, 7 + 2 * number, 2)]
            content = body[2:6] if device.write(address, words) else None
        return bytes([unit, function | 0x80, 2]) if content is None else bytes([unit, function]) + content

    async def serve(self, end: PipeEnd) -> None:
        while request := await end.reader.read(512):
            self.asked.append((now(), request))
            body = request[6:] if self.tcp else request[:-2]
            assert self.tcp or crc(body) == request[-2:], f"wrong check sum in {request.hex(' ')}"
            body = self.obey(body)
            answer = request[:4] + len(body).to_bytes(2, "big") + body if self.tcp else body + crc(body)
            pieces = self.bend(request, answer) if body else []
            for delay, piece in [(0.01, answer)] if pieces is None else pieces:
                await asyncio.sleep(delay)
                end.write(piece)

    def requests(self, function: int) -> list[bytes]:
        """All requests of a function so far."""
        return [request for _, request in self.asked if request[7 if self.tcp else 1] == function]


@asynccontextmanager
async def bench(bench: Bench, options: GoniophotometerOptions | None = None) -> AsyncIterator[Goniophotometer]:
    """Give a goniophotometer's driver on a line to ``bench``."""
    near, far = pipe()
    serving = asyncio.create_task(bench.serve(far))
    driver = Goniophotometer("gonio", PipeTransport("gonio", near, "/dev/ttyUSB3"), VirtualClock(START), options)
    try:
        yield driver
    finally:
        await driver.aclose()
        await asyncio.sleep(0.001)
        serving.cancel()
        result = (await asyncio.gather(serving, return_exceptions=True))[0]
    if isinstance(result, Exception) and not isinstance(result, ConnectionResetError):
        raise result
