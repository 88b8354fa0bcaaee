"""Sessions for the tests of processing: taken in virtual time over every wire, in a world known in closed form."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from labdaq.build import mount
from labdaq.clock import VirtualClock
from labdaq.config import parse
from labdaq.headers import Order
from labdaq.recorder import Recorder
from labdaq.records import Ended, StoredPhoto, TakenReading
from labdaq.runs import run
from labdaq.script import Script
from labdaq.session import Session
from labdaq.station import Station
from labdaq.virtual_time import run_virtual
from tests.analysis.process.formula_world import FormulaWorld

GREENWOOD = Path(__file__).parents[3] / "labdaq" / "examples" / "greenwood-test.toml"
FEW = """
test = "few"
system = "box"
sky = "clear"
[exposures]
times_s = ["1/8", "1/60", "1/500", "1/2000"]
period_s = 9
photo_format = "{format}"
[scan]
c_planes_deg = [0, 90, 180, 270]
period_s = 9
"""


def world() -> FormulaWorld:
    return FormulaWorld()


def take(script: Script, folder: Path, *, raw: bool = False) -> Path:
    order = Order(Station.built_in(), script, folder)
    (path,) = run(order, partial(mount, world=world(), raw=raw), virtual=True)
    return path


def take_whole(folder: Path) -> Path:
    """The report's test."""
    return take(Script.load(GREENWOOD), folder)


def take_few(folder: Path, picture: str = "jpeg") -> Path:
    """Four exposures, four planes."""
    return take(parse(FEW.format(format=picture), Script, "few"), folder, raw=picture == "raw")


def again(path: Path, folder: Path, keep: Callable[[StoredPhoto | TakenReading], bool], system: str = "") -> Path:
    """The session at ``path`` as if some of it had never come; no picture is kept."""
    session = Session.open(path)
    clock = VirtualClock(session.header.started_utc_ns)

    async def record() -> Path:
        import msgspec

        header = msgspec.structs.replace(session.header, system=system or session.header.system)
        recorder = Recorder.create(folder, header, clock, inline=True)
        try:
            for step, reading in zip(session.readings().step, session.readings(), strict=True):
                taken = TakenReading(step=step, reading=reading)
                if keep(taken):
                    recorder.post(taken)
            await recorder.seal(Ended(outcome="finished"), clock.utc_ns())
        finally:
            await recorder.close()
        return recorder.path

    return run_virtual(record())
