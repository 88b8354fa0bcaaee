"""How fast a bracket is merged, beside the memory floor and OpenCV.

Run by hand on a quiet machine: ``python benchmarks/hdr_merge.py``. 16 exposures of 5 megapixels (1944 x 2592, 12 bits),
halving from 8 s. Minima of several rounds are compared, since other work on the machine only ever adds time.
"""

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numba
import numpy as np

from analysis.hdr.kernels import ROWS, merge_colour, merge_mono
from analysis.hdr.merge import merge_files
from analysis.hdr.response import Response

HEIGHT, WIDTH, FRAMES = 1944, 2592, 16
TIMES = (2.0 ** (3 - np.arange(FRAMES))).astype(np.float32)


def best(*works: Callable[[], object], rounds: int = 25) -> list[float]:
    """Least processor time of each work [s], of rounds in which they take turns.

    Time of this thread on its processor, not by the wall clock: work beside it would count in long tasks only.
    """
    least = [float("inf")] * len(works)
    for _ in range(rounds):
        for i, work in enumerate(works):
            start = time.thread_time()
            work()
            least[i] = min(least[i], time.thread_time() - start)
    return least


@numba.njit(fastmath=True)
def _sum(stack: np.ndarray, out: np.ndarray) -> None:
    """Read every frame once and write one plane: what no merge can do without."""
    for r in range(stack.shape[1]):
        for i in range(stack.shape[2]):
            out[r, i] = np.float32(0)
        for f in range(stack.shape[0]):
            row = stack[f, r]
            for i in range(row.shape[0]):
                out[r, i] += np.float32(row[i])


def scene() -> np.ndarray:
    """Codes (16, H, W) of a scene of four decades with 1 % noise."""
    rng = np.random.default_rng(0)
    rate = (10 ** rng.uniform(0.0, 4.2, (HEIGHT, WIDTH))).astype(np.float32)
    stack = np.empty((FRAMES, HEIGHT, WIDTH), np.uint16)
    for f in range(FRAMES):
        signal = rate * TIMES[f] * (1.0 + 0.01 * rng.standard_normal((HEIGHT, WIDTH), dtype=np.float32))
        stack[f] = np.clip(np.rint(64.0 + signal), 0, 4095)
    return stack


def kernels(stack: np.ndarray) -> None:
    """The loops alone, on exposures in memory."""
    planes, flags = np.empty((4, HEIGHT, WIDTH), np.float32), np.empty((HEIGHT, WIDTH), np.uint8)
    black, when = np.full((ROWS, WIDTH), 64, np.float32), np.arange(FRAMES, dtype=np.float32)
    hard = 0.95 * 4031.0
    noise = np.array([4.0, 0.4, 0.0], np.float32)
    limits = np.array([hard, 1.0 / (0.15 * hard), 0.0, 0.0025], np.float32)
    state = np.empty((1, 5, ROWS * WIDTH), np.float32)
    work = (stack, black, TIMES, when, noise, limits, state, True, True, 0, HEIGHT, planes, flags)
    merge_mono(*work)
    out = np.empty((HEIGHT, WIDTH), np.float32)
    _sum(stack, out)
    read, floor, ours = best(stack.max, lambda: _sum(stack, out), lambda: merge_mono(*work))
    print(f"reading {stack.nbytes / 1e6:.0f} MB (numpy maximum)      {1e3 * read:8.1f} ms")
    print(f"summing them into a 32-bit plane      {1e3 * floor:8.1f} ms")
    times_read, times_sum = ours / read, ours / floor
    print(
        f"merge with variance, worth, flags     {1e3 * ours:8.1f} ms  {times_read:.1f} x reading, {times_sum:.1f} x sum"
    )
    grey = (stack >> 4).astype(np.uint8)
    colour = np.ascontiguousarray(np.repeat(grey[..., None], 3, axis=3))
    curves = Response.srgb().curves.astype(np.float32)
    limits = np.repeat(
        np.array([[curves[0, 243], 1.0 / (0.15 * curves[0, 243]), curves[0, 4], 0.0225]], np.float32), 3, 0
    )
    noise = np.repeat(np.array([[1e-6, 1e-4, 0.0]], np.float32), 3, 0)
    weights = np.array([0.2126, 0.7152, 0.0722], np.float32)
    state, channels = np.empty((1, 3, 5, WIDTH), np.float32), np.empty((3, 1, WIDTH), np.float32)
    work8 = (colour, curves, 243, weights, TIMES, when, noise, limits, state, True, True, planes, flags, channels)
    merge_colour(*work8)
    ours8 = best(lambda: merge_colour(*work8), rounds=5)[0]
    print(f"the same of three 8-bit channels      {1e3 * ours8:8.1f} ms")
    cv2.setNumThreads(1)  # one thread each, so that the times mean the same
    frames = list(colour)
    for name, merger in (("Debevec", cv2.createMergeDebevec()), ("Robertson", cv2.createMergeRobertson())):
        taken = best(lambda merger=merger: merger.process(frames, TIMES), rounds=2)[0]
        print(f"OpenCV {cv2.__version__} Merge{name:<10}         {1e3 * taken:8.1f} ms  {taken / ours8:.1f} x ours")


def files(stack: np.ndarray) -> None:
    """From files to a map: decoding included."""
    from tests.analysis.hdr.dng_writer import write_dng

    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{f:02d}.dng" for f in range(FRAMES)]
        for path, frame, seconds in zip(paths, stack, TIMES, strict=True):
            write_dng(path, frame, float(seconds))
        merge_files(paths[:4])
        taken = best(lambda: merge_files(paths), rounds=3)[0]
        print(f"16 DNG files to a map, times refined  {1e3 * taken:8.1f} ms")


def main() -> None:
    """Print the table."""
    stack = scene()
    kernels(stack)
    if "--kernels" not in sys.argv:
        files(stack)
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")


if __name__ == "__main__":
    main()
