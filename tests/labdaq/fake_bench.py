"""Instruments for the scheduler's tests: they take their time, and fail where they are told to.

They do not speak any wire protocol; drivers and emulators do, and are tested with each other.
"""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from labdaq.bench import Bench
from labdaq.clock import Clock
from labdaq.errors import Place
from labdaq.instruments import Photo
from labdaq.reading import Instrument, Reading
from labdaq.station import GREENWOOD_GAMMAS_DEG
from labdaq.units import Quantity, Unit


@dataclass
class Points:
    """Every place where a fake instrument can fail, in the order they are passed."""

    passed: list[str] = field(default_factory=list)
    fail_at: int = -1
    fail_with: Callable[[Place], BaseException] | None = None
    hang: bool = False
    armed: bool = True

    def at(self, place: Place, what: str) -> BaseException | None:
        """Note that a point is passed; return what to raise there."""
        self.passed.append(f"{place.instrument}.{what}")
        if self.armed and len(self.passed) - 1 == self.fail_at and self.fail_with is not None:
            return self.fail_with(place)
        return None


class Fake:
    """Any fake instrument: each of its awaits is a point."""

    def __init__(self, name: str, clock: Clock, points: Points) -> None:
        self.place = Place(name, f"fake:{name}")
        self.open = 0
        self.clock = clock
        self.points = points

    def identity(self) -> Instrument:
        return Instrument(name=self.place.instrument, model="fake", serial="1", port=self.place.port)

    async def spend(self, seconds: float, what: str) -> None:
        """Take some time, and fail before or after it where told to."""
        for half in ("begin", "end"):
            if error := self.points.at(self.place, f"{what}-{half}"):
                if self.points.hang:
                    await asyncio.Event().wait()
                raise error
            await self.clock.sleep(seconds / 2)

    async def connect(self) -> None:
        self.open += 1
        await self.spend(0.2, "connect")

    async def aclose(self) -> None:
        await self.clock.sleep(0.01)
        self.open = 0

    def reading(self, channel: str, quantity: Quantity, unit: Unit, value: float, **at: float) -> Reading:
        return Reading(
            channel=channel,
            quantity=quantity,
            value=value,
            unit=unit,
            uncertainty=0.01 * value,
            utc_ns=self.clock.utc_ns(),
            mono_ns=self.clock.mono_ns(),
            clock=self.clock.state(),
            instrument=self.identity(),
            at=at,
        )


class FakeLuminanceMeter(Fake):
    async def read(self) -> Reading:
        await self.spend(1.0, "read")
        return self.reading("sky.zenith", Quantity.LUMINANCE, Unit.CANDELA_PER_M2, 4000.0)


class FakeChromaMeter(Fake):
    channel = "sky.global"
    duration_s = 0.6

    async def measure(self) -> Sequence[Reading]:
        await self.spend(self.duration_s, "read")
        return [self.reading(self.channel, Quantity.ILLUMINANCE, Unit.LUX, 45_000.0)]


class FakeCamera(Fake):
    exposures_s: Sequence[float] = tuple(2.0 ** (3 - k) for k in range(16))

    async def capture(self, exposure_s: float, raw: bool) -> Sequence[Photo]:
        await self.spend(exposure_s, "expose")
        await self.spend(0.3, "download")
        return [
            Photo(
                name="DSCN0001.NEF" if raw else "DSCN0001.JPG",
                data=b"\xff\xd8" + f"{exposure_s!r} {self.clock.mono_ns()}".encode() * 50,
                exposure_s=exposure_s,
                nominal_exposure_s=exposure_s,
                utc_ns=self.clock.utc_ns(),
                mono_ns=self.clock.mono_ns(),
                clock=self.clock.state(),
                instrument=self.identity(),
            )
        ]


class FakeArm(Fake):
    parked = True
    moving = False
    c_deg = 0.0

    async def home(self) -> None:
        self.parked = False
        await self.spend(1.0, "home")

    async def move_to(self, c_deg: float) -> float:
        self.parked, self.moving = False, True
        await self.spend(1.5, "move")
        self.c_deg, self.moving = c_deg, False
        return c_deg

    async def read(self) -> Sequence[Reading]:
        await self.spend(0.2, "read")
        return [
            self.reading(f"gonio.g{g:g}", Quantity.ILLUMINANCE, Unit.LUX, 500.0, gamma_deg=g, c_deg=self.c_deg)
            for g in GREENWOOD_GAMMAS_DEG
        ]

    async def stop(self) -> None:
        await self.spend(0.02, "stop")
        self.moving = False

    async def park(self) -> None:
        await self.spend(2.0, "park")
        self.parked, self.moving = True, False


def fake_bench(clock: Clock, points: Points | None = None) -> Bench:
    points = points or Points()
    diffuse = FakeChromaMeter("roof-diffuse", clock, points)
    diffuse.channel = "sky.diffuse"
    return Bench(
        luminance=(FakeLuminanceMeter("roof-luminance", clock, points),),
        chroma=(FakeChromaMeter("roof-global", clock, points), diffuse),
        camera=FakeCamera("roof-camera", clock, points),
        goniophotometer=FakeArm("goniophotometer", clock, points),
    )
