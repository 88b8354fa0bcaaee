"""All simulations that stand against one recording: the case's own, rivals, variants, and those of other cases."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from analysis.cases import Case
from analysis.cases.model import Floats, Parts
from analysis.compare.listing import Rival
from labdaq.errors import DataError


@dataclass(frozen=True)
class Simulated:
    """One simulation of a recording.

    Attributes
    ----------
    name
        For legends and tables; unique within a comparison.
    values : shape (N,) [unit of each record's channel]
        Prediction for each record of the case; NaN where there is none.
    """

    name: str
    values: Floats


def simulations(case: Case, others: Sequence[Case] = (), *, variants: bool = False) -> list[Simulated]:
    """Gather the simulations of a recording, the case's own first.

    Parameters
    ----------
    others
        Cases of the same recording with other simulations; a record is found again by test, channel, direction and,
        for repeats, order. What they hold beyond the first case's records is passed over.
    variants
        Whether the case's variants are shown as simulations of their own.

    Raises
    ------
    DataError
        A rival's file cannot be read, or another case shares no record with the first.
    """
    found = [Simulated(case.setup.simulation.engine or "simulation", case.records.simulated)]
    found += [_from_files(case, rival.name, rival.simulated) for rival in _rivals(case)]
    if variants:
        for variant in case.setup.variant:
            setting = ", ".join(f"{key} = {value}" for key, value in variant.setting.items())
            name = f"{variant.mechanism} ({setting})" if setting else variant.mechanism
            found.append(_from_files(case, name, variant.simulated))
    found += [_from_case(case, other) for other in others]
    return list(_with_unique_names(found))


def rival_files(case: Case) -> list[str]:
    """The files that the case's ``[[rival]]`` tables name."""
    return [name for rival in _rivals(case) for parts in rival.simulated.values() for name in parts.names]


@dataclass(frozen=True)
class _Named:
    name: str
    simulated: Mapping[str, Parts]


def _rivals(case: Case) -> Iterator[_Named]:
    """The ``[[rival]]`` tables, which `analysis.compare.from_files` writes."""
    given = (case.setup.model_extra or {}).get("rival", [])
    for k, table in enumerate(given if isinstance(given, list) else [given]):
        try:
            rival = Rival.model_validate(table)
        except ValidationError as error:
            one = error.errors()[0]
            where = ".".join(map(str, (f"rival[{k + 1}]", *one["loc"])))
            raise DataError(f"{case.folder / 'case.toml'}: {where}: {one['msg']}") from None
        yield _Named(rival.name, {i: Parts(**files.model_dump()) for i, files in rival.simulated.items()})


def _from_files(case: Case, name: str, files: Mapping[str, Parts]) -> Simulated:
    """Values of distributions in .ies files at the directions of the goniometer's records."""
    values = np.full(len(case.records), np.nan)
    arm = np.array([c.kind == "goniometer" for c in case.channels])[case.records.channel]
    factor = np.array([1e-3 if c.unit == "kcd" else 1.0 for c in case.channels])[case.records.channel]
    ids = [t.id for t in case.tests]
    for test, parts in files.items():
        if test not in ids:
            raise DataError(f"{case.folder / 'case.toml'}: {name}: there is no test '{test}'")
        rows = arm & (case.records.test == ids.index(test))
        gamma, c = case.records.gamma_deg[rows], case.records.c_deg[rows]
        values[rows] = factor[rows] * sum(case.distribution(file).at(gamma, c) for file in parts.names)
    return Simulated(name, values)


def _keys(case: Case) -> list[tuple[object, ...]]:
    """What makes each record the same in two cases; repeats are counted."""
    seen: dict[tuple[object, ...], int] = {}
    keys: list[tuple[object, ...]] = []
    r = case.records
    angles = np.round(np.nan_to_num(np.column_stack([r.gamma_deg, r.c_deg]), nan=-1.0), 3).tolist()
    for test, channel, (gamma, c) in zip(r.test, r.channel, angles, strict=True):
        key = (case.tests[test].id, case.channels[channel].id, gamma, c)
        seen[key] = seen.get(key, 0) + 1
        keys.append((*key, seen[key]))
    return keys


def _from_case(case: Case, other: Case) -> Simulated:
    known = dict(zip(_keys(other), other.records.simulated.tolist(), strict=True))
    values = np.array([known.get(key, np.nan) for key in _keys(case)])
    if not np.isfinite(values).any():
        raise DataError(
            f"{other.folder}: shares no record with {case.folder}",
            "cases that are compared must hold the same tests, channels and directions",
        )
    return Simulated(other.setup.simulation.engine or other.folder.name, values)


def _with_unique_names(found: Sequence[Simulated]) -> Iterator[Simulated]:
    taken: set[str] = set()
    for one in found:
        name, k = one.name, 2
        while name in taken:
            name, k = f"{one.name} ({k})", k + 1
        taken.add(name)
        yield Simulated(name, one.values)
