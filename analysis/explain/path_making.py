"""Paths through what was traced, shared by all makers of paths: labels, and ratios at several widths."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Final, TypeVar

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.parameter import Parameter
from analysis.explain.ratios import Field
from analysis.explain.retrace import Path
from analysis.explain.trace_settings import Setting
from analysis.explain.tracing import IMAGE_DEG, Tracing

X = TypeVar("X")

OWN: Final = "own re-simulation"
EVENED: Final = ", evened out"
EVENED_DEG: Final = {IMAGE_DEG: "", 12.0: EVENED}
"""Widths over which fields are blurred before their ratio is taken, and how a path says so: another lens throws its
images elsewhere, so that what a setting does to an image is told only as far as images of both lenses overlap."""


def each(work: Callable[[X], Field], items: Iterable[X]) -> list[Field]:
    """``work`` of each item, on as many threads as there are cores."""
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        return list(pool.map(work, items))


def along(
    traced: Tracing, label: str, parameter: Parameter, rows: dict[float, Setting], origin: float
) -> Iterator[Path]:
    """The path through settings that are traced at its positions, over the systems as described."""
    yield from through(traced, label, parameter, {at: traced.lit(settings) for at, settings in rows.items()}, origin)


def through(
    traced: Tracing,
    label: str,
    parameter: Parameter,
    lit: dict[float, Field],
    origin: float,
    base: Field | None = None,
    *,
    geometric: bool = False,
) -> Iterator[Path]:
    """The path through fields that were traced at its positions, over ``base``, at each of `EVENED_DEG`."""
    one = np.ones_like(traced.base[0])
    for width, note in EVENED_DEG.items():
        over_base = each(partial(traced.over_base, width_deg=width, base=base), lit.values())
        ratios = dict(zip(lit, over_base, strict=True)) | {origin: (one, one)}
        yield Path(label + note, parameter, *stacked(ratios), geometric)


def stacked(fields: Mapping[float, Field]) -> tuple[Floats, Floats, Floats]:
    """Positions in order, and the fields of both parts at them."""
    at = np.array(sorted(fields))
    return at, np.stack([fields[a][0] for a in at]), np.stack([fields[a][1] for a in at])
