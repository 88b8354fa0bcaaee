"""Numba, with types that mypy understands."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays; it releases the GIL and is cached on disk."""
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
