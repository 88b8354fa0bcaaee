"""How fast the prismatic sheet is traced to a BSDF, beside Radiance through pyradiance.

    python3 benchmarks/bsdf.py

Prints seconds on one core for a full Klems basis (both sides) and a tensor tree, the part of the light that lies in
another of the patches than in a run of ours with 40 times the rays, and rays per second.
"""

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from analysis.bsdf.basis import KLEMS_FULL
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component
from analysis.bsdf.prism import PrismSheet, prism_tracer, scatter_samples
from analysis.bsdf.radiance_prism import radiance_klems
from analysis.bsdf.tally import klems_of
from analysis.bsdf.tree_tally import tensor_tree_of

T = TypeVar("T")
SHEET = PrismSheet(slope_error_deg=0.0)


def timed(function: Callable[..., T], *args: object, **options: object) -> tuple[float, T]:
    """Seconds and result."""
    start = time.perf_counter()
    result = function(*args, **options)
    return time.perf_counter() - start, result


def misplaced(a: KlemsBsdf, b: KlemsBsdf) -> float:
    """Part of the transmitted light that is in another patch."""
    weight = KLEMS_FULL.projected[:, None] * KLEMS_FULL.projected
    x, y = a.matrices[Component.TF], b.matrices[Component.TF]
    return float((weight * np.abs(x - y)).sum() / (weight * (x + y)).sum())


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(1)
    tracer = prism_tracer(SHEET)
    klems_of(tracer, rng, rays=4)  # compile
    truth = klems_of(tracer, rng, rays=200_000)
    print(f"{'what':34} {'seconds':>8} {'misplaced':>10}")
    for rays in (500, 5_000):
        seconds, klems = timed(klems_of, tracer, rng, rays=rays)
        print(f"{f'labdaq, Klems full, {rays} rays':34} {seconds:8.2f} {misplaced(klems, truth):10.2%}")
    for rays in (500,):
        seconds, klems = timed(radiance_klems, SHEET, samples=rays)
        print(f"{f'Radiance, Klems full, {rays} rays':34} {seconds:8.2f} {misplaced(klems, truth):10.2%}")
    for depth in (5, 6):
        seconds, _ = timed(tensor_tree_of, tracer, rng, depth=depth, rays=2_000)
        print(f"{f'labdaq, tensor tree 4, depth {depth}':34} {seconds:8.2f}")
    directions = np.array([[0.0, 0.0, -1.0], [0.5, 0.0, -(0.75**0.5)], [0.9, 0.0, -(0.19**0.5)]])
    for name, sheet in (("exact", PrismSheet()), ("relief", PrismSheet(peak_radius_mm=0.5, valley_radius_mm=0.5))):
        count = 200_000 if name == "exact" else 20_000
        scatter_samples(sheet, "flat", directions, 4, rng)
        seconds, _ = timed(scatter_samples, sheet, "flat", directions, count, rng)
        print(f"{f'labdaq, {name} sheet':34} {3 * count / seconds / 1e6:8.2f} million rays a second")


if __name__ == "__main__":
    main()
