"""The sun's way over a site at any time, from NREL's algorithm in blocks of some hours."""

import math
import threading
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from simulators.hidden.light import Site, SunTable

Floats = NDArray[np.float64]

BLOCK_NS: Final = 6 * 3600 * NS
"""One table of positions covers this much time; tables overlap and agree to 1e-4 degrees where they meet."""


class SunPath:
    """Apparent place of the sun (Reda and Andreas 2004, through pvlib); may be asked from several threads."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self._lock = threading.Lock()
        self._tables: dict[int, SunTable] = {}
        self._recent = lru_cache(maxsize=4096)(self._place)

    def __call__(self, utc_ns: int) -> Floats:
        """Unit vector towards the sun (3,); not to be changed."""
        return self._recent(utc_ns)

    def angles(self, utc_ns: int) -> tuple[float, float]:
        """Apparent altitude and azimuth [deg]."""
        x, y, z = self._recent(utc_ns)
        return math.degrees(math.asin(max(-1.0, min(1.0, z)))), math.degrees(math.atan2(x, y)) % 360.0

    def _place(self, utc_ns: int) -> Floats:
        block = utc_ns // BLOCK_NS
        with self._lock:
            if block not in self._tables:
                if len(self._tables) > 100:
                    self._tables.clear()
                self._tables[block] = SunTable(self.site, block * BLOCK_NS, (block + 1) * BLOCK_NS)
            return self._tables[block](utc_ns)
