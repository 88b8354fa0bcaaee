"""What is doubtful about a merged pixel: bits of the flag plane.

The compiled loops hold these values, and numba recompiles only when kernels.py itself changes: touch it with this file.
"""

from typing import Final

SATURATED: Final = 1
"""Beyond the limit in every exposure: the value is a lower bound, its variance infinite."""

SINGLE: Final = 2
"""In effect from one exposure only; nothing checks it."""

LOW_SIGNAL: Final = 4
"""Signal below five standard deviations of its noise."""

MOVED: Final = 8
"""The exposures contradict each other by more than noise and response explain."""

NAMES: Final = {SATURATED: "saturated", SINGLE: "single", LOW_SIGNAL: "low-signal", MOVED: "moved"}
