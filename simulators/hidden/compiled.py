"""Compile the loops that must be fast, and keep their types."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile ``function`` to machine code; the result is kept on disk beside the module.

    Compiled functions must not make arrays: without memory management the references of the arrays that are handed
    from function to function need not be counted, which would cost a quarter of the time.
    """
    return cast(F, numba.njit(cache=True, error_model="numpy", nogil=True, _nrt=False)(function))
