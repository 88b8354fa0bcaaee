"""Where made-once results are kept: lens tables, matrices, compiled kernels.

``$XDG_CACHE_HOME/labdaq``, or ``~/.cache/labdaq``. Names are content hashes, so nothing in it can be out of date; the
whole folder may be deleted at any time.
"""

import functools
import hashlib
import io
import json
import os
import tempfile
import threading
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_READING = threading.Lock()
"""One thread reads at a time: numpy parses each array's header as Python, and before 3.11.8 two parses that overlap may
end in a SystemError (CPython issue 106905)."""


def cache_folder(kind: str) -> Path:
    """The folder for one kind of result; it may not exist yet."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    base = Path(home) if Path(home).is_absolute() else Path.home() / ".cache"
    return base / "labdaq" / kind


@functools.lru_cache(maxsize=8)
def code_digest(*folders: str) -> str:
    """A name for the present code of some of our folders, so that results of older code are not taken for new ones."""
    home = Path(__file__).resolve().parents[2]
    files = sorted(path for folder in folders for path in (home / folder).rglob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:16]


def content_key(recipe: Mapping[str, Any]) -> str:
    """A name for what a recipe (JSON values) makes."""
    text = json.dumps(recipe, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def kept(kind: str, recipe: Mapping[str, Any], make: Callable[[], dict[str, NDArray[Any]]]) -> dict[str, NDArray[Any]]:
    """Arrays made by ``make()``, or read from the cache where the same recipe was made before.

    A cache that cannot be written or read costs time, never the result.
    """
    path = cache_folder(kind) / f"{content_key(recipe)}.npz"
    try:
        with _READING, path.open("rb") as file, np.load(file) as stored:
            return {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        pass
    arrays, packed = make(), io.BytesIO()
    np.savez(packed, allow_pickle=False, **arrays)
    keep(path, packed.getvalue())
    return arrays


def keep(path: Path, content: bytes) -> None:
    """Keep a file of the cache for the next time, if the cache can be written; whole or not at all."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(part).replace(path)
    except OSError:
        pass
