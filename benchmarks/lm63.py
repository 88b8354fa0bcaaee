"""Time to parse LM-63 files of four sizes, beside photompy and eulumdat-ies.

    python3 benchmarks/lm63.py

Prints the best of nine runs in milliseconds. The aim: files of 100,000 values in at most half of photompy's time.
"""

import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import eulumdat_ies
import numpy as np
import photompy

from analysis.photometry import Distribution
from analysis.photometry.lm63 import Edition, FileGeneration, read_lm63, render_lm63

SIZES = ((11, 17), (37, 37), (181, 181), (361, 361))


def file(n_gamma: int, n_c: int) -> bytes:
    """A file with that many angles."""
    rng = np.random.default_rng(1)
    planes = 5000.0 * rng.random((n_c - 1, n_gamma))
    d = Distribution.closed(np.linspace(0, 180, n_gamma), np.linspace(0, 360, n_c)[:-1], planes)
    keywords = {"TEST": "1", "TESTLAB": "bench", "ISSUEDATE": "today", "MANUFAC": "none"}
    d = Distribution(d.gamma_deg, d.c_deg, d.candela, keywords)
    return render_lm63(d, generation=FileGeneration.SIMULATED, edition=Edition.E2002)


def best(function: Callable[[], object], runs: int = 9) -> float:
    """Shortest time [ms]."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1000.0 * min(times)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    print(f"{'values':>8} {'labdaq':>8} {'photompy':>9} {'eulumdat-ies':>13} {'labdaq/photompy':>16}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.ies"
        for n_gamma, n_c in SIZES:
            path.write_bytes(file(n_gamma, n_c))
            ours = best(lambda: read_lm63(path))
            theirs = best(lambda: photompy.IESFile.read(path))
            other = best(lambda: eulumdat_ies.ies_to_ldt(path))
            print(f"{n_gamma * n_c:8d} {ours:8.2f} {theirs:9.2f} {other:13.2f} {ours / theirs:16.2f}")


if __name__ == "__main__":
    main()
