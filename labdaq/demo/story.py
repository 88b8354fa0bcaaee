"""The demo's steps, in order: conceal, take, process, simulate, compare, explain, reveal."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from labdaq.clock import SystemClock
from labdaq.demo.answering import explain
from labdaq.demo.crew import Crew
from labdaq.demo.folder import Folder, claim
from labdaq.demo.reveal import Outcome, reveal
from labdaq.demo.telling import Teller
from labdaq.demo.tests import Task, take
from labdaq.errors import DeviceError
from simulators.world.campaign import campaign
from simulators.world.concealed import draw

PRECISION: Final = 0.008
"""Of the predictions: below what readings through clouds and prisms scatter anyway."""


@dataclass(frozen=True)
class Plan:
    """What to do.

    Attributes
    ----------
    out
        Folder for everything.
    seed
        Chooses what is concealed, and the tests.
    rate
        Emulated seconds per real second in the test over real wires.
    tests
        How many tests at most; ``None`` for the whole campaign.
    """

    out: Path
    seed: int
    rate: float = 12.0
    tests: int | None = None


def run(plan: Plan, teller: Teller | None = None) -> Outcome:
    """Do all of it; return what was concealed, what was answered, and where everything is.

    Raises a `LabdaqError` that names the step it happened in.
    """
    teller = teller or Teller(SystemClock())
    folder = claim(plan.out)
    with teller.step(
        "conceal", "Something is concealed in the emulated world: drawn by lot, written down, not looked at"
    ):
        planned = campaign(plan.seed)[: plan.tests]
        systems = tuple(dict.fromkeys(test.system for test in planned))
        concealed = draw(plan.seed, systems)
        concealed.write(folder.truth)
        tasks = [Task(test, concealed, folder.sessions) for test in planned]
    with Crew() as crew:
        for task in tasks[1:2]:  # one core is enough for the test over real wires
            crew.take(task)
        first = _live(tasks[0], plan.rate, teller)
        paths = [first, *_campaign(first, tasks, crew, teller)]
    _simulate(paths, teller)
    _compare(paths, folder, teller)
    with teller.step(
        "explain", "Where do they differ, and why? (a process of its own, which gets nothing but the case)"
    ) as say:
        answer = explain(folder.case, folder.answer, say)
    with teller.step("reveal", "What was concealed?"):
        outcome = reveal(folder, answer)
    folder.note({"state": "finished", "seed": plan.seed, "took_s": teller.took_s, **outcome.facts()})
    return outcome


def _live(task: Task, rate: float, teller: Teller) -> Path:
    """The first test over real wires; once more at half the pace when the computer did not keep up."""
    test = task.planned
    what = (
        f"Test {test.name} over the instruments' real wires, {rate:g} times as fast as in the laboratory: "
        f"{test.system}, {test.sky}, {test.start:%Y-%m-%d %H:%M} UTC"
    )
    with teller.step("one test over real wires", what, spinner=False):
        try:
            return _watched(task, rate, teller)
        except DeviceError as error:
            teller.line(f"   {error.message.splitlines()[0]}")
            teller.line(f"   the computer may have been too busy for that pace; once more at {rate / 2:g} times")
            return _watched(task, rate / 2, teller)


def _watched(task: Task, rate: float, teller: Teller) -> Path:
    from labdaq.cli.watching import bars, plain_lines

    with (bars if teller.live else plain_lines)(task.order) as watch:
        return take(task, rate=rate, watch=watch)


def _campaign(first: Path, tasks: Sequence[Task], crew: Crew, teller: Teller) -> list[Path]:
    """The other tests in virtual time; all are processed. Returns the other sessions, in the order of ``tasks``."""
    from analysis.process.session import process_session

    planned = {task.planned.name: task.planned for task in tasks}
    name = tasks[0].planned.name
    what = f"{len(tasks) - 1} more tests in virtual time, over the same protocols; sky and photometry of all"
    with teller.step("campaign", what) as say:
        crew.do(name, process_session, first)
        for task in tasks[2:]:
            crew.take(task)
        found: list[str] = []

        def done(which: str, _: object) -> None:
            test = planned[which]
            found.append(which)
            say(f"{len(found)} of {len(tasks)}")
            teller.line(f"   {which}: {test.system}, {test.sky}, {test.start:%d %B, %H:%M} UTC")

        results = crew.results(done)
        _tell_of_sky(results[name], teller)
    return [results[task.planned.name] for task in tasks[1:]]


def _tell_of_sky(account: dict[str, Any], teller: Teller) -> None:
    """What the first test's sky was, from its account."""
    if sky := account["sky"]:
        sun, zenith = sky["sun"], sky["zenith"]
        check = f"; the zenith meter reads {zenith['ratio_meter_to_map']:.3f} of the map" if zenith else ""
        teller.line(
            f"   {account['test']}: sun {sun['altitude_deg']:.1f} degrees high with "
            f"{sun['normal_illuminance_lx']:.4g} lx, "
            f"sky {sky['calibration']['diffuse_lx']:.4g} lx{check}"
        )


def _simulate(paths: Sequence[Path], teller: Teller) -> None:
    from analysis.process.prediction import Wish, simulate_sessions
    from labdaq.session import Session

    with teller.step("simulate", "What the skylights should give under these suns and skies") as say:
        systems = {path: Session.open(path).header.system for path in paths}
        for system in dict.fromkeys(systems.values()):
            say(system)
            accounts = simulate_sessions([p for p in paths if systems[p] == system], Wish(precision=PRECISION))
            worst = max(account["uncertainty"] for account in accounts)
            teller.line(f"   {system}: {len(accounts)} tests, statistical error {100 * worst:.1f} % or less")


def _compare(paths: Sequence[Path], folder: Folder, teller: Teller) -> None:
    from analysis.compare.from_sessions import case_from_sessions
    from analysis.compare.simulated_session import told_simulation, with_predictions

    with teller.step("compare", "Recordings beside predictions: a case"):
        simulation, systems = told_simulation(paths)
        title = "The demo's campaign on the emulated station"
        draft = case_from_sessions(with_predictions(paths), title=title, simulation=simulation, systems=systems)
        case = draft.write(folder.case)
        teller.line(f"   {len(case.records)} readings of {len(case.tests)} tests")
