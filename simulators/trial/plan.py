"""Plan a trial: how many cases of which content, concealing what, how strongly."""

import math
from collections.abc import Iterator
from itertools import cycle
from typing import Final

import numpy as np

from simulators.trial import kinds
from simulators.trial.made import Order

WEAKEST, STRONGEST = 0.003, 0.15
"""Range over which wanted effects spread evenly in their logarithm."""

CONTENTS: Final[dict[str, float]] = {"null": 0.25, "single": 0.43, "pair": 0.14, "open": 0.18}
"""Share of each content in a trial."""

PORTIONS: Final[dict[str, float]] = {"goniometer": 0.68, "roof": 0.16, "camera": 0.16}
"""Share of each kind of channel where a trial has them all."""


def plan(
    count: int,
    seed: int,
    chosen: tuple[str, ...] = tuple(PORTIONS),
    contents: dict[str, float] | None = None,
    withhold: bool = True,
    designs: tuple[str, ...] = (),
    without: tuple[str, ...] = (),
) -> list[Order]:
    """Order ``count`` cases; the same seed gives the same orders.

    Parameters
    ----------
    chosen
        Kinds of channel.
    contents
        Share of each content; by default `CONTENTS`.
    designs, without
        Skylights to choose from; causes to leave out.
    """
    rng = np.random.default_rng([seed, 1])
    shares = contents or CONTENTS
    kind_of = _dealt(rng, count, {k: PORTIONS[k] for k in chosen})
    content_of = _dealt(rng, count, shares)
    queues = {kind: _Queues(rng, kind, without) for kind in chosen}
    orders = []
    for number, (kind, content) in enumerate(zip(kind_of, content_of, strict=True)):
        names = queues[kind].draw(content)
        effects = tuple(_effect(rng, content) for _ in names)
        orders.append(
            Order(
                name=f"case-{rng.integers(1 << 40):010x}",
                kind=kind,
                content=content,
                conceal=names,
                effects=effects,
                seed=int(np.random.SeedSequence([seed, 2, number]).generate_state(1)[0]),
                withhold=withhold,
                designs=designs,
            )
        )
    return orders


def _dealt(rng: np.random.Generator, count: int, shares: dict[str, float]) -> list[str]:
    """Deal names in fair shares (to the nearest whole), shuffled."""
    total = sum(shares.values())
    bounds = np.round(np.cumsum([s / total * count for s in shares.values()])).astype(int)
    dealt = [name for name, n in zip(shares, np.diff(bounds, prepend=0), strict=True) for _ in range(n)]
    return [str(name) for name in rng.permutation(np.array(dealt, dtype=object))]


def _effect(rng: np.random.Generator, content: str) -> float:
    weakest = 0.01 if content == "pair" else WEAKEST
    return float(np.exp(rng.uniform(math.log(weakest), math.log(STRONGEST))))


class _Queues:
    """Deals causes of one kind of channel so that every one comes up before any comes again."""

    def __init__(self, rng: np.random.Generator, kind: str, without: tuple[str, ...]) -> None:
        self._rng = rng
        self._stages = kinds.STAGES[kind]
        inside = [name for name in kinds.inside(kind) if name not in without]
        outside = [name for name in kinds.outside(kind) if name not in without]
        self._inside = self._endless(inside)
        self._outside = self._endless(outside)

    def _endless(self, names: list[str]) -> Iterator[str]:
        if not names:
            return
        for _ in cycle([0]):
            yield from (str(n) for n in self._rng.permutation(names))

    def draw(self, content: str) -> tuple[str, ...]:
        """Names of what a case conceals."""
        if content == "null":
            return ()
        if content == "single":
            return (next(self._inside),)
        if content == "open":
            return (next(self._outside),)
        first = next(self._inside)
        for _ in range(100):
            second = next(self._inside)
            if self._stages[first] != self._stages[second] and frozenset((first, second)) not in kinds.UNSUITED:
                return first, second
        raise ValueError(f"nothing goes with {first}")
