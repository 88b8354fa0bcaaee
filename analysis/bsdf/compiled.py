"""Numba, with types that mypy understands and a cache that knows what it depends on.

Numba keeps compiled code on disk as long as the file of a function is unchanged. A function that calls compiled code
of another file would go on with the old code when that file changes. So the mark of freshness here is a hash of all
sources in the folder of the function and in this one.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays; it releases the GIL and is cached on disk."""
    made = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    file = getattr(getattr(made, "_cache", None), "_cache_file", None)
    if file is not None:  # numba's own; without it the cache only watches the function's file
        file._source_stamp = _stamp(Path(function.__code__.co_filename).parent)
    return cast(F, made)


@cache
def _stamp(folder: Path) -> str:
    """Hash of the sources a compiled function of a folder may depend on."""
    digest = hashlib.sha256()
    for path in sorted({*folder.glob("*.py"), *Path(__file__).parent.glob("*.py")}):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
