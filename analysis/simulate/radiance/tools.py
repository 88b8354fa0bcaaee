"""Radiance's programs as pyradiance ships them."""

import os
import subprocess
from pathlib import Path

from labdaq.errors import SimulationError


def radiance(command: list[str], data: bytes, folder: Path) -> bytes:
    """Run one of Radiance's programs in ``folder`` with ``data`` on its input; returns its output.

    Raises `SimulationError` with the program's own words when it fails.
    """
    import pyradiance

    home = Path(pyradiance.__file__).parent
    environment = os.environ | {
        "PATH": f"{home / 'bin'}{os.pathsep}{os.environ.get('PATH', '')}",
        "RAYPATH": f"{home / 'lib'}{os.pathsep}.",
    }
    try:
        done = subprocess.run(command, input=data, capture_output=True, cwd=folder, env=environment, check=False)
    except OSError as error:
        raise SimulationError(
            f"Radiance's {command[0]} cannot be run: {error.strerror}", "reinstall pyradiance"
        ) from error
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip()
        raise SimulationError(f"Radiance's {command[0]} failed: {words[-500:]}", "report it with the scene")
    return done.stdout
