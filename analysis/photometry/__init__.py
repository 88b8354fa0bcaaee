"""Luminous intensity distributions: what was measured, read, written, turned and compared.

`lm63` reads and writes IES files, `closing` fills the row at gamma 90, `testdata` holds what a daylight test tells
beside its candelas, `goniometry` knows types A, B and C.
"""

from analysis.photometry.distribution import Distribution

__all__ = ["Distribution"]
