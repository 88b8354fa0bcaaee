"""Which other causes would have left the same trace in the same readings: nobody can tell those apart from it."""

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from simulators.trial.dials import Bench, Dial, relative

Floats = NDArray[np.float64]
W = TypeVar("W")
S = TypeVar("S", bound=Bench)  # type: ignore[type-arg]

TRIES = 4
"""How many shapes (forms, directions) of a rival are drawn."""


def rivals(
    station: S,
    others: Mapping[str, Callable[[np.random.Generator, S], Dial[W] | None]],
    base: W,
    change: list[Floats],
    noise: float,
    rng: np.random.Generator,
) -> tuple[str, ...]:
    """Return the names of other causes whose effect, at the right strength, cannot be told from ``change``.

    A rival is drawn several times; its effects (at two strengths each) span a space, and if what of the change lies
    outside that space would drown in the noise (chi-square below 4 over all readings), it counts as the same.
    """
    target = np.concatenate(change)
    off = station.outcome(base, False)
    found = []
    for name, maker in others.items():
        columns = []
        for _ in range(TRIES):
            dial = maker(rng, station)
            if dial is None or dial.on_simulation:
                break
            for setting in (0.02, 0.15):
                on = station.outcome(dial.apply(base, setting), False)
                column = np.concatenate([relative(a, b, station.floor) for a, b in zip(on, off, strict=True)])
                size = float(np.sqrt(np.mean(column**2)))
                if size > 1e-9:
                    columns.append(column / size)
        if not columns:
            continue
        basis, sizes, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
        basis = basis[:, sizes > 0.03 * sizes[0]][:, :2]
        left = target - basis @ (basis.T @ target)
        if float(np.sum(left**2)) / noise**2 < 4.0:
            found.append(name)
    return tuple(found)
