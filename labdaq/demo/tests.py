"""The demo's tests: one over real wires at an accelerated pace, the others in virtual time."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from labdaq.build import mount
from labdaq.cli.files import find_script
from labdaq.clock import NS, utc_ns_of
from labdaq.headers import Order
from labdaq.runs import run
from labdaq.script import Script
from labdaq.station import Station
from labdaq.steps import Watch
from labdaq.worlds import world_of
from simulators.world.campaign import PlannedTest
from simulators.world.concealed import Concealed

SCRIPT: Final = "greenwood-test"
LASTS_S: Final = 330.0
"""Longest time from connecting to a parked arm: the world's light is traced for it before the clock starts."""


@dataclass(frozen=True)
class Task:
    """One test to be taken.

    Attributes
    ----------
    planned
        When, under which sky, with which skylight.
    concealed
        What is concealed in the world and its instruments.
    sessions
        Folder of the sessions.
    """

    planned: PlannedTest
    concealed: Concealed
    sessions: Path

    @property
    def station(self) -> Station:
        """The built-in station at the test's time, below its sky, in a room painted black."""
        station = station_at(self.planned)
        room = station.room.model_copy(update={"wall_reflectance": 0.0, "floor_reflectance": 0.0})
        return station.model_copy(update={"room": room})

    @property
    def order(self) -> Order:
        """The report's test, of this system below this sky."""
        return order_of(self.planned, self.station, self.sessions)


def station_at(planned: PlannedTest) -> Station:
    """The built-in station at a test's time, below its sky."""
    station = Station.built_in()
    assert station.emulation is not None
    return station.model_copy(update={"emulation": station.emulation.model_copy(update=planned.emulation())})


def order_of(planned: PlannedTest, station: Station, sessions: Path) -> Order:
    """The report's test as it is planned, to be taken on ``station`` into ``sessions``."""
    file = find_script(SCRIPT)
    facts = {"test": planned.name, "system": planned.system, "sky": planned.sky}
    return Order(station, Script.load(file).model_copy(update=facts), sessions, None, file)


def take(task: Task, *, rate: float | None = None, watch: Watch | None = None) -> Path:
    """Take one test and return its session: over real wires at ``rate``, or in virtual time without one.

    Raises a `LabdaqError` when an instrument fails.
    """
    station = task.station
    world = world_of(station, task.concealed)
    start_ns = utc_ns_of(task.planned.start)
    world.prepare(start_ns, start_ns + round(LASTS_S * NS))
    mount_on = partial(mount, world=world, alter=task.concealed.alter)
    (path,) = run(task.order, mount_on, virtual=rate is None, rate=rate, watch=watch)
    return path


def take_and_process(task: Task) -> Path:
    """Take one test in virtual time and process its session: work for a process of its own."""
    from analysis.process.session import process_session

    path = take(task)
    process_session(path)
    return path
