"""A recorded session and what a simulation predicts for it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analysis.cases.model import Floats, Ints, Simulation, System
from analysis.compare.named_systems import case_system
from analysis.compare.predicted import Predicted
from analysis.process.derived import SIMULATE, read_account
from labdaq.errors import DataError, Problems
from labdaq.session import Session

Series = Callable[[Ints], Floats]
"""What a channel should read at UTC times (N,) [ns]: values (N,) in the channel's unit."""


@dataclass(frozen=True, kw_only=True)
class OtherChannel:
    """A channel that is not the arm's, e.g. a roof meter, with what it should read.

    Attributes
    ----------
    predict
        What a second instrument or a sky model says.
    noise_relative
        Standard uncertainty of the noise, as a share of the reading; the default is half the 2 sigma repeatability
        that the maker gives for the CL-200. (The uncertainty in a session is that of the value, calibration included.)
    """

    predict: Series
    noise_relative: float = 0.0025


@dataclass(frozen=True, kw_only=True)
class SimulatedVariant:
    """The same simulation run again with one thing changed (see `analysis.cases.Variant`)."""

    mechanism: str
    setting: Mapping[str, Any]
    predicted: Predicted


@dataclass(frozen=True, kw_only=True)
class SimulatedSession:
    """One session, and what is predicted for it.

    Attributes
    ----------
    session
        As recorded.
    predicted
        Distribution under the sky and sun of the middle of the test [cd].
    variants
        The same with one thing changed.
    others
        Predictions for channels that are not the arm's, e.g. ``{"sky.global": OtherChannel(predict=...)}``; their
        readings become records of the case as well.
    test
        Id of the test; by default the one in the script.
    """

    session: Session
    predicted: Predicted
    variants: Sequence[SimulatedVariant] = ()
    others: Mapping[str, OtherChannel] = field(default_factory=dict)
    test: str = ""


def with_predictions(
    sessions: Sequence[Path], files: Mapping[str, Path] | None = None, variants: Sequence[SimulatedVariant] = ()
) -> list[SimulatedSession]:
    """Open sessions with the predictions that lie beside them.

    Parameters
    ----------
    files
        Predicted .ies by part (``sun`` and ``sky``, or ``total``) of a single session; without them, each session's
        ``derived/simulated-sun.ies`` and ``derived/simulated-sky.ies`` are read, or ``derived/simulated.ies``.
    variants
        Of a single session.

    Raises
    ------
    DataError
        A folder is no session, or has no prediction; all are named.
    """
    if files and len(sessions) != 1:
        raise DataError("files of a prediction belong to one session", "put them into each session's folder 'derived'")
    found: list[SimulatedSession] = []
    mistakes: list[str] = []
    for path in sessions:
        try:
            predicted = Predicted.read(files or _beside(path))
            found.append(SimulatedSession(session=Session.open(path), predicted=predicted, variants=variants))
        except DataError as error:
            mistakes.append(error.message)
    if mistakes:
        raise DataError("\n".join(mistakes), "`labdaq simulate` makes predictions")
    return found


def told_simulation(sessions: Sequence[Path]) -> tuple[Simulation | None, list[System]]:
    """How the predictions beside sessions were made, and what they took for the systems, as ``labdaq simulate`` tells.

    Nothing for predictions that were put there by hand. Raises `DataError` when some are of the near field and others
    of the far field, or sessions call different things by one system's name: a case says these once.
    """
    accounts = [read_account(path, SIMULATE) for path in sessions]
    if not all(accounts):
        return None, []
    problems = Problems("the predictions")
    simulations: dict[Simulation, Path] = {}
    systems: dict[str, System] = {}
    for path, account in zip(sessions, accounts, strict=True):
        assert account is not None
        told = Simulation(
            engine=f"labdaq {account['engine']}", field=account["field"], max_bounces=account["max_bounces"] or 0
        )
        if told not in simulations and simulations:
            problems.add(path.name, f"is simulated in another way than {next(iter(simulations.values())).name}")
        simulations.setdefault(told, path)
        named = Session.open(path).header.system
        system = case_system(named, account["system"])
        if systems.setdefault(named, system) != system:
            problems.add(path.name, f"another skylight than before is called '{named}'")
    problems.raise_if_any(DataError, "simulate these sessions in one way, or make a case of each kind")
    return next(iter(simulations)), list(systems.values())


def _beside(path: Path) -> dict[str, Path]:
    Session.open(path)  # a folder that is none is told first
    apart = {part: path / "derived" / f"simulated-{part}.ies" for part in ("sun", "sky")}
    whole = path / "derived" / "simulated.ies"
    if all(file.is_file() for file in apart.values()):
        return apart
    if whole.is_file():
        return {"total": whole}
    raise DataError(
        f"{path}: has no prediction: neither {apart['sun'].name} and {apart['sky'].name} nor {whole.name} in derived"
    )
