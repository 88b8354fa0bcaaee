"""Judge one answer against the truth of its case."""

import csv
import io
import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simulators.trial.answer import Answer, Either, Named, Place
from simulators.trial.truth import Concealed, Truth

Floats = NDArray[np.float64]

ALIASES: Final[dict[str, dict[str, str]]] = {
    "circumsolar-aureole": {"width_deg": "sigma_deg", "fraction": "share", "kappa": "share"},
    "sky-sun-ratio": {"shift": "diffuse_shift", "s": "diffuse_shift", "diffuse_change": "diffuse_shift"},
    "cloud-drift": {"sigma": "rms", "correlation_time_s": "correlation_s"},
    "lens-haze": {"fraction": "haze", "share": "haze", "haze_fraction": "haze"},
    "lens-orientation": {"angle_deg": "rotation_deg", "turn_deg": "rotation_deg"},
    "soiling": {"depth": "optical_depth"},
    "wall-reflectance": {"reflectance": "wall_reflectance"},
    "wall-scatter": {"scatter": "scattered_share", "share": "scattered_share", "wall_scatter": "scattered_share"},
    "stray-light": {"stray_lx": "illuminance_lx", "stray_cd": "intensity_cd"},
    "gamma-offset": {"gamma_offset_deg": "offset_deg"},
    "c-offset": {"c_offset_deg": "offset_deg"},
    "dark-offset": {"dark_lx": "offset_lx", "dark_cd": "offset_cd"},
    "nonlinearity": {"power": "exponent"},
    "saturation": {"saturation_cd": "level_cd", "saturation_lx": "level_lx", "loss_at_max": "loss_at_brightest"},
    "clock-offset": {"offset_minutes": "offset_min"},
    "meter-tilt": {"east_deg": "tilt_east_deg", "north_deg": "tilt_north_deg"},
    "meter-gain": {"factor": "gain"},
    "channel-gain": {"factor": "gain"},
    "veiling-glare": {"glare": "share", "fraction": "share"},
    "projection-error": {"shift_at_60": "shift_at_60_deg"},
}
"""Other names an answer may use for a truth's parameter."""


@dataclass(frozen=True)
class Records:
    """Coordinates of a case's records, in their order (n,); NaN where a record has no such angle."""

    tests: list[str]
    times: list[str]
    channels: list[str]
    gamma_deg: Floats
    c_deg: Floats


def read_records(text: str) -> Records:
    """Read the coordinates from the text of ``records.csv``."""
    rows = list(csv.DictReader(io.StringIO(text)))

    def angle(name: str) -> Floats:
        return np.array([float(r[name]) if r[name] else math.nan for r in rows])

    return Records(
        [r["test"] for r in rows], [r["time"] for r in rows], [r["channel"] for r in rows],
        angle("gamma_deg"), angle("c_deg"),
    )  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What an answer was worth.

    Attributes
    ----------
    truth
        Of the case.
    verdict
        The answer's; ``failed`` if there was none.
    named
        Ids in the answer's order, with stated probabilities; then what it tells as either of several.
    first
        How the first name of a single's answer stands: ``right``, ``equivalent``, ``composite`` (the truth stands
        beside it as indistinguishable, or is one of several that the answer tells as one), ``wrong``, ``none``.
    claims
        Per named mechanism, or several told as one: probability, and whether it is in the truth (or its equivalent,
        or composite with it).
    both
        Whether both of a pair were named, or told as one of several.
    extra
        Names beside a single that are not in the truth.
    located
        Whether a stated place holds the effect.
    inside_pair
        Claims that stand in a group the answer itself calls indistinguishable.
    silent_pair
        Claims of a cause whose equivalents (by the truth) the answer does not mention.
    intervals
        (mechanism, parameter, true, value, uncertainty, covered) for right names.
    withheld
        Rms error on withheld tests before and after [%]; ``None`` where there are none.
    seconds
        What the answer took.
    error
        Why there was no answer.
    """

    truth: Truth
    verdict: str
    named: tuple[tuple[str, float], ...] = ()
    first: str = "none"
    claims: tuple[tuple[str, float, bool], ...] = ()
    both: bool = False
    extra: tuple[str, ...] = ()
    located: bool = False
    inside_pair: int = 0
    silent_pair: int = 0
    intervals: tuple[tuple[str, str, float, float, float, bool], ...] = ()
    withheld: tuple[float, float] | None = None
    seconds: float = 0.0
    error: str = ""
    notes: dict[str, str] = field(default_factory=dict)


def judge(
    truth: Truth,
    answer: Answer,
    records: Records,
    seconds: float = 0.0,
    withheld: tuple[float, float] | None = None,
) -> Outcome:
    """Judge an answer."""
    inside = [c for c in truth.concealed if c.inside]
    claims = tuple((m.id, m.probability, _right(m.id, inside, answer)) for m in answer.mechanisms)
    claims += tuple((_together(e), e.probability, _among(e, inside)) for e in answer.either)
    right_ids = {c.id for c in inside}
    told = {*(m.id for m in answer.mechanisms), *(name for e in answer.either for name in e.ids)}
    matched = {c.id for c in inside if told & {c.id, *c.equivalents}}
    return Outcome(
        truth=truth,
        verdict=answer.verdict,
        named=tuple((name, probability) for name, probability, _ in claims),
        first=_first(inside, answer),
        claims=claims,
        both=len(inside) == 2 and matched == right_ids,
        extra=tuple(name for name, _, right in claims if not right) if truth.content == "single" else (),
        located=any(_holds(place, records, truth) for place in answer.places),
        inside_pair=sum(_inside_pair(m.id, answer) for m in answer.mechanisms),
        silent_pair=sum(_silent(m.id, inside, answer) for m in answer.mechanisms),
        intervals=tuple(i for m in answer.mechanisms for c in inside if m.id == c.id for i in _intervals(m, c)),
        withheld=withheld,
        seconds=seconds,
    )


def _right(name: str, inside: list[Concealed], answer: Answer) -> bool:
    if any(name == c.id or name in c.equivalents for c in inside):
        return True
    return any(name in group and any(c.id in group for c in inside) for group in answer.indistinguishable)


def _together(either: Either) -> str:
    return " or ".join(sorted(either.ids))


def _among(either: Either, inside: list[Concealed]) -> bool:
    return any(either.ids & {c.id, *c.equivalents} for c in inside)


def _first(inside: list[Concealed], answer: Answer) -> str:
    if not answer.mechanisms and answer.either:
        return "composite" if _among(answer.either[0], inside) else "wrong"
    if not answer.mechanisms or not inside:
        return "none" if not answer.mechanisms else "wrong"
    name = answer.mechanisms[0].id
    if any(name == c.id for c in inside):
        return "right"
    if any(name in c.equivalents for c in inside):
        return "equivalent"
    return "composite" if _right(name, inside, answer) else "wrong"


def _inside_pair(name: str, answer: Answer) -> bool:
    return any(name in group for group in answer.indistinguishable)


def _silent(name: str, inside: list[Concealed], answer: Answer) -> bool:
    for c in inside:
        if c.equivalents and (name == c.id or name in c.equivalents):
            together = {c.id, *c.equivalents}
            return not any(name in group and len(group & together) >= 2 for group in answer.indistinguishable)
    return False


def _intervals(named: Named, concealed: Concealed) -> list[tuple[str, str, float, float, float, bool]]:
    found = []
    aliases = ALIASES.get(concealed.id, {})
    for name, (value, uncertainty) in named.parameters.items():
        own = name if name in concealed.parameters else aliases.get(name, "")
        if own not in concealed.parameters:
            continue
        true = concealed.parameters[own][0]
        covered = abs(value - true) <= 1.96 * uncertainty
        found.append((concealed.id, own, true, value, uncertainty, covered))
    return found


def inside_place(place: Place, records: Records) -> NDArray[np.bool_]:
    """Which records lie in a stated place."""
    mask = np.ones(len(records.tests), dtype=bool)
    if place.channels is not None:
        mask &= np.isin(records.channels, list(place.channels))
    if place.tests is not None:
        mask &= np.isin(records.tests, list(place.tests))
    if place.gamma_deg is not None:
        low, high = place.gamma_deg
        mask &= np.isnan(records.gamma_deg) | ((records.gamma_deg >= low - 1e-6) & (records.gamma_deg <= high + 1e-6))
    if place.c_deg is not None and place.c_deg[1] - place.c_deg[0] < 360.0 - 1e-6:
        start, width = place.c_deg[0], (place.c_deg[1] - place.c_deg[0]) % 360.0
        mask &= np.isnan(records.c_deg) | (((records.c_deg - start) % 360.0) <= width + 1e-6)
    if place.when is not None:
        first, last = place.when
        mask &= np.array([first[:19] <= t[:19] <= last[:19] for t in records.times])
    return mask


def _holds(place: Place, records: Records, truth: Truth) -> bool:
    """Whether a stated place holds the effect: half of its energy, or a fifth of it at twice the even density."""
    change = np.array(truth.change)
    if len(change) != len(records.tests) or not np.any(change):
        return False
    mask = inside_place(place, records)
    energy = float(np.sum(change[mask] ** 2) / np.sum(change**2))
    share = float(np.mean(mask))
    return energy >= 0.5 or (energy >= 0.2 and energy >= 2.0 * share)


def withheld_errors(truth: Truth, case_text: str, predicted_text: str) -> tuple[float, float]:
    """Rms error [%] over the noise-free truth on withheld tests, before and after.

    Raises `ValueError` if the rows are not those of the case.
    """
    rows = list(csv.DictReader(io.StringIO(predicted_text)))
    case = list(csv.DictReader(io.StringIO(case_text)))
    clean = np.array(truth.withheld_clean)
    if not (len(rows) == len(case) == len(clean)):
        raise ValueError(f"{len(rows)} predictions for {len(clean)} withheld readings")
    tests = np.array([r["test"] for r in case])
    before = np.array([float(r["simulated"]) for r in case])
    after = np.array([float(r["corrected"]) for r in rows])
    return _error(before, clean, tests, truth), _error(after, clean, tests, truth)


def _error(values: Floats, clean: Floats, tests: NDArray[np.str_], truth: Truth) -> float:
    relative = (values - clean) / (0.5 * (np.abs(values) + np.abs(clean)) + truth.floor)
    if truth.free_gain:
        for test in np.unique(tests):
            relative[tests == test] -= np.mean(relative[tests == test])
    return float(100.0 * np.sqrt(np.mean(relative**2)))
