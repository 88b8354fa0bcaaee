"""The report's twelve validation tests on the emulated station, for `benchmarks/explain_figure90.py`."""

import csv
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from labdaq.clock import NS, utc_ns_of

TESTS: Final = {"top": (11, 15, 25, 28), "box": (9, 18, 22, 32), "tube": (6, 16, 24, 30)}
"""Chapter 8: for each system a partly cloudy sky, a low, a middle and a high sun."""
METER_ENDS_LX: Final = 95_000.0
"""The emulated roof meter ends at 99 990 lx, as the CLTC meter did: brighter tests are dimmed to this."""
LX_PER_FC: Final = 10.763910417
LASTS_S: Final = 330.0


@dataclass(frozen=True)
class Planned:
    """One validation test, as the tables tell."""

    number: int
    system: str
    start: Any
    sky: str
    global_lx: float
    diffuse_lx: float


def planned(data: Path) -> list[Planned]:
    """The twelve tests; the CLTC meter's global illuminance, above its range the Velux one's."""
    from datetime import datetime

    with (data / "greenwood-tests.csv").open(newline="", encoding="utf-8") as file:
        rows = {int(row["test"]): row for row in csv.DictReader(file)}
    found = []
    for system, numbers in TESTS.items():
        for number in numbers:
            row = rows[number]
            total = float(row["cltc_global_fc"] or row["velux_global_fc"])
            diffuse = float(row["cltc_diffuse_fc"])
            sky = "partly-cloudy" if row["sky"].startswith("Partly") else "clear"
            start = datetime.fromisoformat(row["start_utc"])
            dim = LX_PER_FC * min(1.0, METER_ENDS_LX / (total * LX_PER_FC))
            found.append(Planned(number, system, start, sky, total * dim, diffuse * dim))
    return found


def room_of_table_6(data: Path) -> tuple[float, float]:
    """Reflectances of wall and floor over the white card's, from the averages (whose column heads are interchanged)."""
    with (data / "greenwood-material-luminance.csv").open(newline="", encoding="utf-8") as file:
        mean = {row["block"]: row for row in csv.DictReader(file) if row["row"] == "average"}
    wall, floor = (mean[f"Black {name}"] for name in ("Wall", "Floor"))
    ratio = "col2_raw_labelled_reference", "col1_raw_labelled_material"
    return float(wall[ratio[0]]) / float(wall[ratio[1]]), float(floor[ratio[0]]) / float(floor[ratio[1]])


def station_of(test: Planned, room: tuple[float, float]) -> Any:
    """The built-in station at the test's time, in a room of these reflectances."""
    from labdaq.station import Station

    station = Station.built_in()
    assert station.emulation is not None
    told = {"start": test.start, "system": test.system, "sky": "clear", "cloud_cover": 0.0, "seed": test.number}
    surfaces = {"wall_reflectance": room[0], "floor_reflectance": room[1]}
    return station.model_copy(
        update={
            "emulation": station.emulation.model_copy(update=told),
            "room": station.room.model_copy(update=surfaces),
        }
    )


def world(test: Planned, room: tuple[float, float]) -> Any:
    """The world of a test: the table's illuminances in the middle of the test, following the sun from there."""
    from labdaq.worlds import world_of
    from simulators.hidden.light import clear_day
    from simulators.world.daylight import Levels

    made = world_of(station_of(test, room))
    altitude, _ = made.daylight.path.angles(utc_ns_of(test.start) + 90 * NS)
    turbidity = 4.0
    normal, diffuse = clear_day(altitude, turbidity)
    beam = (test.global_lx - test.diffuse_lx) / np.sin(np.radians(altitude))
    made.daylight.levels = Levels(turbidity, beam / normal, test.diffuse_lx / diffuse)
    return made


def take(test: Planned, room: tuple[float, float], sessions: Path) -> Path:
    """Take one test in virtual time over the emulated instruments, and process its session."""
    from analysis.process.session import process_session
    from labdaq.build import mount
    from labdaq.cli.files import find_script
    from labdaq.headers import Order
    from labdaq.runs import run
    from labdaq.script import Script

    station, seen = station_of(test, room), world(test, room)
    start_ns = utc_ns_of(test.start)
    seen.prepare(start_ns, start_ns + round(LASTS_S * NS))
    file = find_script("greenwood-test")
    facts = {"test": f"T{test.number}", "system": test.system, "sky": test.sky}
    order = Order(station, Script.load(file).model_copy(update=facts), sessions, None, file)
    (path,) = run(order, partial(mount, world=seen), virtual=True)
    process_session(path)
    return path


def room_light(test: Planned, room: tuple[float, float], records: Any, distance_m: float) -> np.ndarray:
    """What the room adds to the light at each record of a test [cd], by the world itself."""
    lit, black = world(test, room), world(test, (0.0, 0.0))
    added = np.zeros(len(records))
    for c in np.unique(records.c_deg):
        rows = np.flatnonzero(records.c_deg == c)
        at, gamma = int(np.mean(records.utc_ns[rows])), records.gamma_deg[rows]
        added[rows] = lit.room_illuminance(gamma, c, at) - black.room_illuminance(gamma, c, at)
    return np.asarray(added * distance_m**2)
