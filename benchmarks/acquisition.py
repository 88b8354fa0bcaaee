"""What acquisition costs: per reading, beside bluesky; per acknowledgement, beside fdatasync; a test in virtual time.

    PYTHONPATH=. python benchmarks/acquisition.py [FOLDER]

FOLDER is where files are written (by default here): use the disk that sessions go to. bluesky is optional; in an
environment of its own, ``pip install bluesky msgspec pydantic click`` is enough to run this file. CPU times hold on a
busy machine, wall times do not.

What is compared: one soft instrument that returns at once is read again and again. labdaq stamps, flags, encodes,
chains and appends each reading to its journal (`labdaq.steps.Steps`, one step per reading); bluesky's RunEngine runs
`count` and emits its documents to one subscriber that does nothing, keeping nothing. Bluesky does more per event
(staging, status objects, a thread hand-over), and is not badly made; the ratio says what an operator pays for it.
"""

import asyncio
import os
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "labdaq"))

from fake_bench import Fake, Points
from session_helpers import header, reading

from labdaq.clock import SystemClock
from labdaq.durable import DeferredDisk, Disk
from labdaq.journal import Journal
from labdaq.reading import Reading
from labdaq.recorder import Recorder
from labdaq.records import TakenReading
from labdaq.script import Script
from labdaq.station import Station
from labdaq.steps import ClockGuard, Steps
from labdaq.units import Quantity, Unit

COUNT = 5000


class SoftMeter(Fake):
    """Answers at once."""

    async def read(self) -> Reading:
        """Return a reading stamped now."""
        return self.reading("sky.zenith", Quantity.LUMINANCE, Unit.CANDELA_PER_M2, 1.0)


async def labdaq_steps(folder: Path, count: int) -> float:
    """CPU seconds per reading: one whole step each, without waiting for the medium."""
    clock = SystemClock()
    recorder = Recorder.create(folder, header("steps"), clock, inline=True, disk=DeferredDisk())
    script = Script(test="a", system="b")
    steps = Steps(recorder, clock, script, ClockGuard(clock, Station.built_in(), script), lambda body: None)
    meter = SoftMeter("meter", clock, Points())

    async def read() -> list[Reading]:
        return [await meter.read()]

    began = time.process_time()
    for k in range(count):
        await steps.take(meter.place, f"s-{k}", 0.0, read)
    spent = time.process_time() - began
    await recorder.close()
    return spent / count


async def labdaq_core(folder: Path, count: int) -> float:
    """CPU seconds per reading: await, stamp, encode, chain, check sum and append, synced once."""
    clock = SystemClock()
    journal = Journal.create(folder / "core.jnl", "0" * 16, clock, DeferredDisk(), None)
    meter = SoftMeter("meter", clock, Points())
    began = time.process_time()
    for _ in range(count):
        journal.post(TakenReading(step="s", reading=await meter.read()))
    await journal.synced()
    spent = time.process_time() - began
    await journal.close()
    return spent / count


def bluesky_count(count: int) -> float | None:
    """CPU seconds per event of ``count``; ``None`` where bluesky is not installed."""
    try:
        from bluesky import RunEngine
        from bluesky.plans import count as count_plan
    except ImportError:
        return None

    class Soft:
        name = "meter"
        parent = None

        def read(self) -> dict[str, dict[str, float]]:
            return {"meter": {"value": 1.0, "timestamp": time.time()}}

        def describe(self) -> dict[str, dict[str, object]]:
            return {"meter": {"source": "soft", "dtype": "number", "shape": []}}

        def read_configuration(self) -> dict[str, object]:
            return {}

        def describe_configuration(self) -> dict[str, object]:
            return {}

    engine = RunEngine({})
    engine.subscribe(lambda name, document: None)
    engine(count_plan([Soft()], num=10))
    began = time.process_time()
    engine(count_plan([Soft()], num=count))
    return (time.process_time() - began) / count


def raw_fdatasync(folder: Path, count: int) -> float:
    """Wall seconds to append 700 bytes and wait for the medium, by hand; median."""
    took = []
    fd = os.open(folder / "raw", os.O_CREAT | os.O_WRONLY | os.O_APPEND)
    for _ in range(count):
        began = time.perf_counter()
        os.write(fd, b"x" * 700)
        os.fdatasync(fd)
        took.append(time.perf_counter() - began)
    os.close(fd)
    return sorted(took)[count // 2]


async def acknowledged(folder: Path, name: str, producers: int, each: int, threads: bool) -> tuple[float, float]:
    """Median wall seconds of one acknowledgement, and acknowledgements per second."""
    clock = SystemClock()
    executor = ThreadPoolExecutor(1) if threads else None
    journal = Journal.create(folder / name, "0" * 16, clock, Disk(), executor)
    took: list[float] = []

    async def produce() -> None:
        for k in range(each):
            began = time.perf_counter()
            await journal.append(reading(clock, float(k)))
            took.append(time.perf_counter() - began)

    began = time.perf_counter()
    async with asyncio.TaskGroup() as group:
        for _ in range(producers):
            group.create_task(produce())
    spent = time.perf_counter() - began
    await journal.close()
    if executor:
        executor.shutdown()
    return sorted(took)[len(took) // 2], len(took) / spent


def virtual_test(folder: Path) -> tuple[float, float] | None:
    """Wall and CPU seconds of the report's test of 150 s in virtual time; ``None`` without drivers and emulators."""
    try:
        from labdaq.build import mount
        from labdaq.headers import Order
        from labdaq.runs import run
    except ImportError:
        return None
    script = Script.load(Path(__file__).parents[1] / "labdaq" / "examples" / "greenwood-test.toml")
    spent = []
    for _ in range(4):  # the first loads libraries
        wall, cpu = time.perf_counter(), time.process_time()
        run(Order(Station.built_in(), script, folder), mount, virtual=True)
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(spent)


def best(measure: Callable[[], float], times: int = 5) -> float:
    """The least of several runs: what it costs when nobody disturbs."""
    return min(measure() for _ in range(times))


def main() -> None:
    """Measure and print."""
    parent = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    with tempfile.TemporaryDirectory(dir=parent) as name:
        folder = Path(name)
        number = iter(range(10**6))

        def fresh() -> Path:
            made = folder / str(next(number))
            made.mkdir()
            return made

        core = best(lambda: asyncio.run(labdaq_core(fresh(), COUNT)))
        step = best(lambda: asyncio.run(labdaq_steps(fresh(), COUNT)))
        print(f"CPU per reading, labdaq core (await, stamp, encode, chain, append)   {core * 1e6:8.1f} µs")
        print(f"CPU per reading, labdaq whole step (start, reading, done, time limit) {step * 1e6:7.1f} µs")
        other = bluesky_count(COUNT)
        if other is None:
            print("CPU per reading, bluesky: not installed here")
        else:
            print(f"CPU per event, bluesky count of a soft device                        {other * 1e6:8.1f} µs")
            print(f"  bluesky / labdaq whole step  {other / step:.0f}, bluesky / labdaq core  {other / core:.0f}")

        for round_ in range(3):
            raw = raw_fdatasync(fresh(), 300)
            inline, _ = asyncio.run(acknowledged(fresh(), f"i{round_}", 1, 300, False))
            one, _ = asyncio.run(acknowledged(fresh(), f"t{round_}", 1, 300, True))
            print(
                f"fdatasync by hand {raw * 1e6:7.0f} µs; acknowledged inline {inline * 1e6:7.0f} µs "
                f"({inline / raw:.2f}), by the disk thread {one * 1e6:7.0f} µs ({one / raw:.2f})"
            )
        for producers in (1, 8, 64):
            median, rate = asyncio.run(acknowledged(fresh(), "group", producers, 3000 // producers, True))
            print(f"group commit, {producers:>2} producers: {rate:8.0f} acknowledged/s, median {median * 1e6:6.0f} µs")
        if took := virtual_test(fresh()):
            print(f"the report's test of 150 s in virtual time: {took[0]:.2f} s ({took[1]:.2f} s of CPU)")


if __name__ == "__main__":
    main()
