"""Lenses that a BSDF file describes: scatter tables without any symmetry.

The file's frame (z from its front to its back) is laid onto the sheet by a turn about the x axis: with the front up its
z looks down and its y south, with the front down z looks up and y north.
"""

import functools
import hashlib
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.bsdf.brightest import TOLD, Light, brightest
from analysis.simulate.components import Lens
from analysis.simulate.lens import LEAST, WEIGHT_UNITS, Sampler, Table, in_parts, packed
from analysis.simulate.store import code_digest, kept
from analysis.simulate.system import System
from labdaq.errors import DataError

Floats = NDArray[np.float64]

MOST: Final = 16.0
"""Largest share of its light that a direction may send on: what half a sphere collects in the finest basis."""

WIDE_HALF: Final = 64
"""Grid steps from the middle of the square to its edge; a step is about 1.2 degrees. Transmittance falls steeply near
grazing incidence; with half as many steps a lens loses 1 % more of an overcast sky."""

_VERSION: Final = 1


def wide_nodes(half: int) -> Floats:
    """Directions of incidence (N, 3), pointing down, on the whole square; row i (2 half + 1) + j is place
    u = i / half - 1, v = j / half - 1. Grazing incidence is taken at 89.4 degrees, as in `lens.nodes`.
    """
    step = np.arange(-half, half + 1) / half
    u, v = (a.ravel() for a in np.meshgrid(step, step, indexing="ij"))
    first = np.abs(u) >= np.abs(v)
    rho = np.where(first, np.abs(u), np.abs(v))
    phi = 0.25 * math.pi * np.where(first, v, u) / np.where(rho > 0.0, rho, 1.0)
    cosine = np.maximum(1.0 - rho**2, 0.01)
    sine = np.sqrt(1.0 - cosine**2)
    x = np.where(first, np.copysign(np.cos(phi), u), np.sin(phi)) * sine
    y = np.where(first, np.sin(phi), np.copysign(np.cos(phi), v)) * sine
    return np.stack([x, y, -cosine], axis=-1)


def file_tables(lens: Lens, samples: int) -> tuple[Table, Table]:
    """Scatter tables for light from above and for light from below, in parts.

    They have a sixteenth of the samples of a prismatic sheet's, for more than ten times as many directions. Raises
    `DataError`.
    """
    return _tables(lens.bsdf, _digest(lens.bsdf), lens.prisms == "up", max(samples // 16, LEAST), weight_units(lens))


def weight_units(lens: Lens) -> float:
    """Units of weight 1 in the lens's tables: fewer where more light leaves than arrives. Raises `DataError`."""
    return WEIGHT_UNITS / max(1.0, most_light(lens).share)


def most_light(lens: Lens) -> Light:
    """The direction of which a lens of a file sends on most light; raises `DataError` beyond `MOST`."""
    light = _most_light(lens.bsdf, _digest(lens.bsdf))
    if light.share > MOST:
        raise DataError(
            f"{lens.bsdf}: {light}; a lens may send on {MOST:g} times",
            "look at `labdaq bsdf report`: BSDFs are in 1/sr, and no raised cover collects so much",
        )
    return light


def bright_lenses(system: System) -> tuple[str, ...]:
    """What users should know of lenses that send on more light than they get; raises `DataError` beyond `MOST`."""
    files = {lens.bsdf: lens for lens in (system.entry, system.exit) if lens.kind == "bsdf"}
    lights = [(path, most_light(lens)) for path, lens in files.items()]
    return tuple(f"{path}: {light}" for path, light in lights if light.share > TOLD)


@functools.lru_cache(maxsize=8)
def _most_light(path: str, digest: str) -> Light:
    recipe: dict[str, Any] = {"light": digest, "code": code_digest("analysis/bsdf"), "version": _VERSION}
    found = kept("lenses", recipe, lambda: {"light": brightest(_read(path, digest)).row()})
    return Light.of(found["light"])


def file_sampler(lens: Lens) -> Sampler:
    """A sampler for `lens.sun_table`: in its frame the side called flat, a file's front, is up."""
    return _sampler(lens.bsdf, _digest(lens.bsdf), lens.prisms == "up")


@functools.lru_cache(maxsize=8)
def _sampler(path: str, digest: str, turned: bool) -> Sampler:
    bsdf = _read(path, digest)
    # `sun_table` mirrors a sheet whose front is down in z; together with y that is a turn about x
    frame = np.array([1.0, 1.0 if turned else -1.0, -1.0])

    def sample(
        lens: Lens, from_back: bool, directions: Floats, per_direction: int, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        out, weight = bsdf("back" if from_back else "front", directions * frame, per_direction, rng)
        return out * frame, weight

    return sample


@functools.lru_cache(maxsize=8)
def _tables(path: str, digest: str, turned: bool, samples: int, units: float) -> tuple[Table, Table]:
    recipe: dict[str, Any] = {
        "file": digest,
        "turned": turned,
        "samples": samples,
        "half": WIDE_HALF,
        "units": units,
        "code": code_digest("analysis/bsdf"),
        "version": _VERSION,
    }

    def make() -> dict[str, NDArray[Any]]:
        bsdf = _read(path, digest)
        frame = np.array([1.0, 1.0, 1.0]) if turned else np.array([1.0, -1.0, -1.0])
        down = wide_nodes(WIDE_HALF)
        made = {}
        for name, sent in (("above", down), ("below", down * np.array([1.0, 1.0, -1.0]))):
            rng = np.random.default_rng([_VERSION, int(name == "below"), samples])
            front = (name == "above") != turned
            table = np.empty((len(sent), samples, 3), dtype=np.int16)
            for first in range(0, len(sent), 256):
                rows = slice(first, first + 256)
                out, weight = bsdf("front" if front else "back", sent[rows] * frame, samples, rng)
                table[rows] = packed(out * frame, sent[rows, None, :], weight, units)
            made[name] = table
        return made

    stored = kept("lenses", recipe, make)
    return in_parts(stored["above"]), in_parts(stored["below"])


def _digest(path: str) -> str:
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})", "name the BSDF file of the lens") from error


@functools.lru_cache(maxsize=8)
def _read(path: str, digest: str) -> Any:
    """The scattering in the visible band; ``digest`` tells versions of a file apart."""
    from analysis.bsdf.model import Component
    from analysis.bsdf.xml_read import read_bsdf

    found = read_bsdf(path).bsdf
    missing = [str(part) for part in (Component.TF, Component.TB) if part not in found.components()]
    if missing:
        raise DataError(f"{path}: does not describe {', '.join(missing)}", "light meets a lens from both sides")
    return found
