"""Score a trial: every line of the table that an explainer is held to, with Wilson intervals, and every failure."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from simulators.trial.outcome import Outcome

CLASSES: Final = ((2.5, math.inf), (1.5, 2.5), (0.8, 1.5), (0.4, 0.8), (0.0, 0.4))
"""Classes of effect [%]."""


@dataclass(frozen=True)
class Rate:
    """A count out of a number, with the 95 % interval of Wilson (1927, doi:10.1080/01621459.1927.10502953)."""

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The rate; NaN of nothing."""
        return self.hits / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval."""
        if not self.of:
            return 0.0, 1.0
        z, n, p = 1.959964, self.of, self.hits / self.of
        centre = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return max(0.0, centre - half), min(1.0, centre + half)


@dataclass(frozen=True)
class Line:
    """One line of the table.

    Attributes
    ----------
    name
        What is counted.
    rate, value
        A rate, or another number with its unit in the name.
    goal, aim
        What is asked at least, and aimed at; with ``at_most`` the other way round.
    """

    name: str
    rate: Rate | None = None
    value: float | None = None
    goal: float | None = None
    aim: float | None = None
    at_most: bool = False

    @property
    def number(self) -> float:
        """The rate or the value."""
        return self.rate.value if self.rate is not None else float(self.value if self.value is not None else math.nan)

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without goal or data."""
        if self.goal is None or math.isnan(self.number):
            return None
        return self.number <= self.goal if self.at_most else self.number >= self.goal


def _rate(outcomes: Iterable[Outcome], hit: Callable[[Outcome], bool]) -> Rate:
    chosen = list(outcomes)
    return Rate(sum(hit(o) for o in chosen), len(chosen))


def _right_first(o: Outcome) -> bool:
    return o.first in ("right", "equivalent", "composite")


def score(outcomes: list[Outcome]) -> list[Line]:
    """Return the lines of the table."""
    singles, nulls, pairs, opens = (
        [o for o in outcomes if o.truth.content == content] for content in ("single", "null", "pair", "open")
    )
    return [
        *_single_lines(singles),
        *_claim_lines(outcomes),
        *_null_lines(nulls),
        *_pair_lines(pairs, singles),
        *_open_lines(opens, singles),
        *_interval_lines(outcomes),
        *_withheld_lines(outcomes),
        *_honesty_lines(outcomes),
        *_effort_lines(outcomes),
    ]


def _single_lines(singles: list[Outcome]) -> list[Line]:
    lines = []
    for (low, high), goal, aim in zip(
        CLASSES, (0.95, 0.85, None, None, None), (0.99, 0.95, None, None, None), strict=True
    ):
        mine = [o for o in singles if low <= _size(o) < high]
        label = f"effect >= {low:g} %" if math.isinf(high) else f"effect {low:g} to {high:g} %"
        lines.append(Line(f"named first, {label}", _rate(mine, _right_first), goal=goal, aim=aim))
    strong = [o for o in singles if _size(o) >= 2.5]
    same = _rate(strong, lambda o: o.first == "equivalent")
    group = _rate(strong, lambda o: o.first == "composite")
    return [
        *lines,
        Line("  of these by another name for the same", same),
        Line("  of these as one of an indistinguishable group", group),
    ]


def _claim_lines(outcomes: list[Outcome]) -> list[Line]:
    claims = [right for o in outcomes for _, _, right in o.claims]
    known = [right for o in outcomes if o.truth.content != "open" for _, _, right in o.claims]
    wrong, without = Rate(claims.count(False), len(claims)), Rate(known.count(False), len(known))
    return [
        Line("wrong names among all claims", wrong, goal=0.05, aim=0.02, at_most=True),
        Line("  without the open cases", without, at_most=True),
    ]


def _null_lines(nulls: list[Outcome]) -> list[Line]:
    named = _rate(nulls, lambda o: bool(o.named))
    flagged = _rate(nulls, lambda o: o.verdict != "no-mismatch")
    return [
        Line("something named when there is nothing", named, goal=0.05, aim=0.01, at_most=True),
        Line("  verdict other than no-mismatch", flagged, at_most=True),
    ]


def _pair_lines(pairs: list[Outcome], singles: list[Outcome]) -> list[Line]:
    both = [o for o in pairs if min(c.effect_percent for c in o.truth.concealed) >= 1.5]
    false_second = _rate(singles, lambda o: bool(o.extra) and len(o.named) > 1)
    return [
        Line("pairs, both named (each effect >= 1.5 %)", _rate(both, lambda o: o.both), goal=0.75, aim=0.85),
        Line("  all pairs", _rate(pairs, lambda o: o.both)),
        Line("  at least one named", _rate(pairs, _right_first)),
        Line("false second beside a single", false_second, goal=0.08, aim=0.04, at_most=True),
    ]


def _honesty_lines(outcomes: list[Outcome]) -> list[Line]:
    inside = float(sum(o.inside_pair for o in outcomes))
    silent = float(sum(o.silent_pair for o in outcomes))
    error = calibration_error(outcomes)
    return [
        Line("claims inside a declared pair", value=inside, goal=0.0, aim=0.0, at_most=True),
        Line("claims that keep silent about an equivalent", value=silent, at_most=True),
        Line("expected calibration error", value=error, goal=0.1, aim=0.05, at_most=True),
    ]


def _effort_lines(outcomes: list[Outcome]) -> list[Line]:
    times = [o.seconds for o in outcomes if o.seconds > 0.0]
    longest = max(times, default=math.nan)
    return [
        Line("time per case, median [s]", value=float(np.median(times)) if times else math.nan),
        Line("time per case, longest [s]", value=longest, goal=60.0, aim=15.0, at_most=True),
        Line("no answer", _rate(outcomes, lambda o: o.verdict == "failed"), goal=0.0, aim=0.0, at_most=True),
    ]


def _size(o: Outcome) -> float:
    return max((c.effect_percent for c in o.truth.concealed), default=0.0)


def _open_lines(opens: list[Outcome], singles: list[Outcome]) -> list[Line]:
    def flagged(o: Outcome) -> bool:
        return o.verdict in ("unexplained", "partly-explained")

    strong = [o for o in opens if _size(o) >= 2.5]
    explained = [o for o in singles if _right_first(o)]
    return [
        Line(
            "open set flagged and located, effect >= 2.5 %",
            _rate(strong, lambda o: flagged(o) and o.located),
            goal=0.85,
            aim=0.95,
        ),
        Line("  flagged", _rate(strong, flagged)),
        Line("  flagged without any name", _rate(strong, lambda o: flagged(o) and not o.named)),
        Line("  all open cases, flagged and located", _rate(opens, lambda o: flagged(o) and o.located)),
        Line("right explanation flagged all the same", _rate(explained, flagged), goal=0.10, aim=0.05, at_most=True),
    ]


def _interval_lines(outcomes: list[Outcome]) -> list[Line]:
    every = [i for o in outcomes for i in o.intervals]
    lines = [Line("95 % intervals that hold the truth", Rate(sum(i[5] for i in every), len(every)))]
    for name in sorted({i[0] for i in every}):
        mine = [i for i in every if i[0] == name]
        lines.append(Line(f"  {name}", Rate(sum(i[5] for i in mine), len(mine)), goal=0.8, aim=0.88))
    return lines


def _withheld_lines(outcomes: list[Outcome]) -> list[Line]:
    held = [o for o in outcomes if o.withheld is not None and o.truth.content != "null" and _size(o) >= 1.5]
    ratios = [o.withheld[1] / o.withheld[0] for o in held if o.withheld and o.withheld[0] > 0.0]
    nulls = [o for o in outcomes if o.withheld is not None and o.truth.content == "null"]
    worse = _rate(
        [o for o in outcomes if o.withheld], lambda o: bool(o.withheld and o.withheld[1] > 1.02 * o.withheld[0])
    )
    change = float(np.median(ratios)) - 1.0 if ratios else math.nan
    floors = [o.withheld[1] / max(o.truth.nuisance_percent, 1e-9) for o in held if o.withheld]
    return [
        Line(
            f"withheld error, change, median of {len(ratios)} (effect >= 1.5 %)", value=change, goal=-0.5, at_most=True
        ),
        Line("  after, over what ripple alone leaves, median", value=float(np.median(floors)) if floors else math.nan),
        Line("  made worse", worse, at_most=True),
        Line(
            "  made worse in null cases",
            _rate(nulls, lambda o: bool(o.withheld and o.withheld[1] > 1.02 * o.withheld[0])),
            at_most=True,
        ),
    ]


def calibration_error(outcomes: list[Outcome], bins: int = 10) -> float:
    """Expected calibration error of the claims' probabilities (Naeini, Cooper, Hauskrecht 2015), in equal bins."""
    claims = [(p, right) for o in outcomes for _, p, right in o.claims]
    if not claims:
        return math.nan
    stated = np.array([p for p, _ in claims])
    hit = np.array([float(right) for _, right in claims])
    place = np.minimum((stated * bins).astype(int), bins - 1)
    total = 0.0
    for k in range(bins):
        mine = place == k
        if mine.any():
            total += mine.mean() * abs(hit[mine].mean() - stated[mine].mean())
    return float(total)


def failures(outcomes: list[Outcome]) -> list[dict[str, object]]:
    """Everything that went wrong, with the seed that brings it back."""
    found = []
    for o in outcomes:
        wrong = []
        if o.verdict == "failed":
            wrong.append(f"no answer: {o.error}")
        if o.truth.content == "null" and o.named:
            wrong.append("named something where there is nothing")
        if o.truth.content == "single" and not _right_first(o):
            wrong.append("not named first" if o.named else "nothing named")
        if o.extra and len(o.named) > 1:
            wrong.append(f"false second: {', '.join(o.extra)}")
        if o.truth.content == "pair" and not o.both:
            wrong.append("not both named")
        if o.truth.content == "open" and (o.verdict not in ("unexplained", "partly-explained") or not o.located):
            wrong.append("open set not flagged and located")
        missed = [f"{m}.{p} = {v:.4g} ± {u:.2g}, truly {t:.4g}" for m, p, t, v, u, held in o.intervals if not held]
        if missed:
            wrong.append("interval misses: " + "; ".join(missed))
        if o.withheld and o.withheld[1] > 1.02 * o.withheld[0]:
            wrong.append(f"withheld error from {o.withheld[0]:.2f} to {o.withheld[1]:.2f} %")
        if wrong:
            found.append(
                {
                    "case": o.truth.case,
                    "kind": o.truth.kind,
                    "seed": o.truth.seed,
                    "content": o.truth.content,
                    "truth": [f"{c.id} ({c.effect_percent:.2f} %)" for c in o.truth.concealed],
                    "verdict": o.verdict,
                    "named": [f"{name} ({p:.2f})" for name, p in o.named],
                    "wrong": wrong,
                }
            )
    return found
