"""Radiance's own programs, from pyradiance's wheel, as a second opinion."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pyradiance
from numpy.typing import NDArray

HOME = Path(pyradiance.__file__).parent
ENVIRONMENT = {**os.environ, "RAYPATH": f"{HOME / 'lib'}:.", "PATH": f"{HOME / 'bin'}:{os.environ.get('PATH', '')}"}


def radiance(*words: str | Path, given: bytes = b"", folder: Path | None = None, ends: int = 0) -> bytes:
    """Run a program and return what it printed; a failure (another exit code than ``ends``) shows its complaint."""
    command = [str(word) for word in words]
    done = subprocess.run(command, input=given, capture_output=True, env=ENVIRONMENT, cwd=folder, check=False)
    assert done.returncode == ends, f"{words[0]} ended with {done.returncode}: {done.stderr.decode()}"
    return done.stdout


def numbers(text: bytes) -> NDArray[np.float64]:
    """The numbers in a printed table, a row each line that holds only numbers."""
    rows = []
    for line in text.decode().splitlines():
        try:
            rows.append([float(word) for word in line.split()])
        except ValueError:
            continue
    return np.array([row for row in rows if row])
