"""The report's figure 90, computed: which of the conjectured causes carries how much of it, and does labdaq find them?

    python3 dev.py findings figure-90 DATA_DIR [--out DIR]

The emulated station takes the twelve validation tests of Greenwood (chapter 8) in virtual time: same skylights,
dates, times, suns, and global and diffuse illuminances (tables 3 and 5), in a room whose walls and floor reflect what
table 6 says. Three predictions stand beside the recording, each with the room black, after the settings that chapters
7 to 9 tell of:

| like | field | limit of interactions |
|---|---|---|
| Radiance | near | 12 |
| TracePro | far | 20 |
| Photopia (its near-field emulator) | near | 50 |

Causes are told apart by switching them on one at a time: the room's light is taken from the world itself, limit and
field from the prediction. What is left is what two independently written simulations of the same skylight disagree
about, and noise. `labdaq explain` then gets each case, with nothing said.

Not known, and assumed: the clouds of the three partly cloudy tests (a steady sky of the same illuminances), the paint
of the ceiling (as the walls), the white card's own reflectance (1). Tests above the range of the emulated roof meter
are dimmed, sun and sky alike, which changes no ratio. A limit counts passes of lenses as well; in each of them light
passes one sheet (top) or two, so walls get what is left.

DATA_DIR holds greenwood-tests.csv and greenwood-material-luminance.csv. Takes about ten minutes on two cores the first
time, for the light that is traced.
"""

import argparse
import csv
import dataclasses
import json
import multiprocessing
import os
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from labdaq.clock import NS, utc_ns_of

TESTS: Final = {"top": (11, 15, 25, 28), "box": (9, 18, 22, 32), "tube": (6, 16, 24, 30)}
"""Chapter 8: for each system a partly cloudy sky, a low, a middle and a high sun."""
SHOWN: Final = (9, 18, 16, 24)
"""Figure 90's test; the low sun of the box and of the tube; and the one of which the report suspects the limit."""
METER_ENDS_LX: Final = 95_000.0
"""The emulated roof meter ends at 99 990 lx, as the CLTC meter did: brighter tests are dimmed to this."""
PASSES: Final = {"top": 1, "box": 2, "tube": 2}
LX_PER_FC: Final = 10.763910417
LASTS_S: Final = 330.0
RAYS: Final = 1_000_000


@dataclass(frozen=True)
class Engine:
    """Settings of a prediction."""

    name: str
    field: str
    limit: int

    def wall_bounces(self, system: str) -> int:
        """How often light may meet a wall before the limit ends it."""
        return self.limit - PASSES[system]


ENGINES: Final = (Engine("Radiance", "near", 12), Engine("TracePro", "far", 20), Engine("Photopia", "near", 50))


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


def predictions(sessions: dict[int, Path], tests: list[Planned], rays: int) -> dict[int, Any]:
    """Test to the variants of its system, traced together, and its place among them."""
    from analysis.process.daylight import daylight_of
    from analysis.simulate.system import SYSTEMS
    from analysis.simulate.variants import variants
    from labdaq.session import Session

    found: dict[int, Any] = {}
    for system, numbers in TESTS.items():
        days = [daylight_of(Session.open(sessions[n])).daylight for n in numbers if n in sessions]
        made = variants(SYSTEMS[system], days, [], rays=rays)
        for k, number in enumerate(n for n in numbers if n in sessions):
            found[number] = (made, k)
    return found


def predicted(entry: Any, field: str, wall_bounces: int | None) -> Any:
    """One test's sun and sky with a limit (none: to the last ray)."""
    from analysis.compare.predicted import Predicted
    from analysis.photometry import Distribution

    made, k = entry
    outcome = made.baseline if wall_bounces is None else made.again(max_bounces=wall_bounces)
    parts = getattr(outcome, field)
    return Predicted(
        sun=Distribution(made.gamma_deg, made.c_deg, parts.sun[k]),
        sky=Distribution(made.gamma_deg, made.c_deg, parts.sky[k]),
    )


def case_of(engine: Engine | None, tests: list[Planned], sessions: dict[int, Path], traced: dict[int, Any]) -> Any:
    """The case of one engine's predictions; without an engine, of the near field to the last ray."""
    from analysis.cases.model import Simulation
    from analysis.compare.from_sessions import case_from_sessions
    from analysis.compare.simulated_session import SimulatedSession
    from labdaq.session import Session

    field = engine.field if engine else "near"
    items = [
        SimulatedSession(
            session=Session.open(sessions[t.number]),
            predicted=predicted(traced[t.number], field, engine.wall_bounces(t.system) if engine else None),
        )
        for t in tests
    ]
    name = f"labdaq's tracer with {engine.name}'s settings" if engine else "labdaq's tracer"
    return case_from_sessions(
        items, title=f"Greenwood, emulated: {name}", simulation=Simulation(engine=name, field=field)
    )


def shares(case: Any, exact: Any, unlimited: Any, rooms: dict[str, np.ndarray]) -> dict[str, Any]:
    """Per test and gamma, means over C: (prediction - recording) / recording [%], and what of it each cause makes.

    The causes add up: -room / recording, (limit - no limit) / recording, (far - near) / recording, and the rest.
    """
    records, told = case.records, {}
    for k, test in enumerate(case.tests):
        rows = np.flatnonzero(records.test == k)
        columns: dict[str, list[float]] = {name: [] for name in ("total", "room", "limit", "field", "rest")}
        gammas = np.unique(records.gamma_deg[rows])
        for gamma in gammas:
            ring = rows[records.gamma_deg[rows] == gamma]
            measured = records.measured[ring].mean()
            near = exact.records.simulated[ring].mean()
            no_limit = unlimited.records.simulated[ring].mean()
            here = records.simulated[ring].mean()
            room = rooms[test.id][ring - rows[0]].mean()
            parts = {"total": here - measured, "room": -room, "limit": here - no_limit, "field": no_limit - near}
            parts["rest"] = parts["total"] - parts["room"] - parts["limit"] - parts["field"]
            for name, value in parts.items():
                columns[name].append(float(100.0 * value / measured))
        told[test.id] = {"gamma_deg": gammas.tolist(), **columns}
    return told


def after(case: Any, predictions: Path) -> dict[str, list[float]]:
    """Per test and gamma, means over C: (labdaq's corrected prediction - recording) / recording [%]."""
    with predictions.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    test = np.array([row["test"] for row in rows])
    gamma, measured, corrected = (
        np.array([float(row[name]) for row in rows]) for name in ("gamma_deg", "measured", "corrected")
    )
    found = {}
    for one in (t.id for t in case.tests):
        rings = [(test == one) & (gamma == g) for g in np.unique(gamma[test == one])]
        found[one] = [float(100.0 * (corrected[k].mean() / measured[k].mean() - 1.0)) for k in rings]
    return found


def explained(folder: Path, out: Path) -> dict[str, Any]:
    """What `labdaq explain` says of a case on disk, in a process of its own."""
    import subprocess

    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
    command = [sys.executable, "-m", "labdaq", "explain", str(folder), "--out", str(out)]
    done = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"labdaq explain ended with exit code {done.returncode}:\n{done.stderr[-2000:]}")
    return dict(json.loads((out / "explanation.json").read_text(encoding="utf-8")))


def experiment(
    data: Path, out: Path, *, rays: int = RAYS, processes: int = 2, only: int | None = None
) -> dict[str, Any]:
    """Do all of it; return what came out, as it is written to ``out``/figure-90.json."""
    from labdaq.session import Session

    tests, room = planned(data), room_of_table_6(data)
    tests = tests if only is None else [t for t in tests if TESTS[t.system].index(t.number) < only]
    out.mkdir(parents=True, exist_ok=True)
    sessions = _sessions(tests, room, out / "sessions", processes)
    print("simulating", flush=True)
    traced = predictions(sessions, tests, rays)
    exact = case_of(None, tests, sessions, traced)
    distance = Session.open(sessions[tests[0].number]).station.goniometer.distance_m
    rooms = {}
    for k, test in enumerate(tests):
        rooms[f"T{test.number}"] = room_light(test, room, exact.records.where(exact.records.test == k), distance)
    result: dict[str, Any] = {"room": {"walls": room[0], "floor": room[1]}, "engines": {}}
    for engine in ENGINES:
        print(f"explaining {engine.name}", flush=True)
        draft = case_of(engine, tests, sessions, traced)
        endless = dataclasses.replace(engine, limit=10_000)
        folder = out / f"case-{engine.name.lower()}"
        shutil.rmtree(folder, ignore_errors=True)
        draft.write(folder)
        answer = out / f"answer-{engine.name.lower()}"
        result["engines"][engine.name] = {
            "field": engine.field,
            "limit": engine.limit,
            "answer": explained(folder, answer),
            "shares": shares(_of(draft), _of(exact), _of(case_of(endless, tests, sessions, traced)), rooms),
            "after": after(_of(draft), answer / "predictions.csv"),
        }
    (out / "figure-90.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return result


def _of(draft: Any) -> Any:
    """A draft as a case: its tests and its records."""
    from analysis.cases import Case

    return Case(Path(), draft.setup, draft.records)


def _sessions(tests: list[Planned], room: tuple[float, float], folder: Path, processes: int) -> dict[int, Path]:
    """Sessions of the tests; those that a former run took are kept."""
    from labdaq.session import Session

    found = {}
    for path in sorted(folder.glob("*")) if folder.is_dir() else []:
        session = Session.open(path)
        same_room = session.station.room.wall_reflectance == room[0]
        if same_room and (path / "derived" / "process.json").is_file():
            found[int(session.header.test[1:])] = path
    missing = [t for t in tests if t.number not in found]
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        work = {t.number: pool.submit(take, t, room, folder) for t in missing}
        for number, future in work.items():
            found[number] = future.result()
            print(f"took T{number}", flush=True)
    return found


# telling


def told(result: dict[str, Any]) -> str:
    """The result as Markdown."""
    lines = [
        f"Room: walls and ceiling {100 * result['room']['walls']:.2f} %, floor {100 * result['room']['floor']:.2f} %. "
        "Numbers are means over the 16 C-planes, in per cent of the recording."
    ]
    for name, engine in result["engines"].items():
        lines += ["", f"### With {name}'s settings ({engine['field']} field, {engine['limit']} interactions)", ""]
        rings = {test: {**parts, "after": engine["after"][test]} for test, parts in engine["shares"].items()}
        for test in (f"T{n}" for n in SHOWN):
            if test in rings:
                lines += [f"Test {test[1:]}:", "", *_ring_table(rings[test]), ""]
        lines += [f"Mean of all {len(rings)} tests:", "", *_ring_table(_mean(list(rings.values()))), ""]
        lines += _answer_lines(engine["answer"])
    return "\n".join(lines) + "\n"


def _mean(rings: list[dict[str, list[float]]]) -> dict[str, list[float]]:
    return {name: np.mean([one[name] for one in rings], axis=0).tolist() for name in rings[0]}


def _ring_table(shares_: dict[str, list[float]]) -> list[str]:
    words = {
        "total": "prediction - recording",
        "room": "of this: room left out",
        "limit": "of this: limit of interactions",
        "field": "of this: far field for near",
        "rest": "of this: the simulations' difference, noise",
        "after": "labdaq's corrected prediction - recording",
    }
    gammas = shares_["gamma_deg"]
    rows = ["| gamma [deg] | " + " | ".join(f"{g:g}" for g in gammas) + " |", "|---" * (len(gammas) + 1) + "|"]
    rows += [f"| {word} | " + " | ".join(f"{round(v, 1) + 0.0:+.1f}" for v in shares_[name]) + " |" for name, word in words.items()]
    return rows


def _answer_lines(answer: dict[str, Any]) -> list[str]:
    fit = answer["fit"]
    lines = [f"`labdaq explain` says **{answer['verdict']}**."]
    for m in answer["mechanisms"]:
        values = ", ".join(
            f"{name} {p['value']:.3g} ± {p['uncertainty']:.2g} {'' if p['unit'] == '1' else p['unit']}".strip()
            for name, p in m["parameters"].items()
            if not isinstance(p["value"], str)
        )
        lines.append(f"- {m['id']} ({100 * m['probability']:.0f} %): {values}. {m['statement']}")
    lines += [f"- Not told apart: {' and '.join(pair)}." for pair in answer["indistinguishable"]]
    lines += [f"- Left: {place['statement']} (p = {place['p_value']:.2g})" for place in answer["leftover"][:3]]
    before, after = fit["before"]["rms_percent"], fit["after"]["rms_percent"]
    held = fit.get("held_out")
    text = f"Deviation {before:.2f} % before, {after:.2f} % after"
    if held:
        left = held["before"]["rms_percent"], held["after"]["rms_percent"]
        text += f"; {held['scheme']} {left[0]:.2f} % before, {left[1]:.2f} % after"
    best = ", ".join(f"{'+'.join(e['ids'])} {e['nats_over_nothing']:.0f}" for e in answer["evidence"][:6])
    return [*lines, "", f"{text}. Evidence of single mechanisms [nats over nothing]: {best}."]


def main(arguments: list[str] | None = None) -> str:
    """Run the experiment; print and return what came out, as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, default=Path("findings-figure-90"))
    parser.add_argument("--rays", type=int, default=RAYS)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", type=int, help="so many tests of each system")
    options = parser.parse_args(arguments)
    text = told(
        experiment(options.data, options.out, rays=options.rays, processes=options.processes, only=options.only)
    )
    print(text)
    return text


if __name__ == "__main__":
    main()
