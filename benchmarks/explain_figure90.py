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
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from explain_figure90_station import TESTS, Planned, planned, room_light, room_of_table_6, take
from explain_figure90_told import told

PASSES: Final = {"top": 1, "box": 2, "tube": 2}
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
