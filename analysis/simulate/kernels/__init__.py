"""Compiled inner loops of the tracer (numba): random numbers, lenses, covers, wells, and whole paths."""
