"""Luminous intensity distributions: what was measured, read, written, turned and compared."""

from analysis.photometry.distribution import Distribution

__all__ = ["Distribution"]
