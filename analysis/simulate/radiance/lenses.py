"""BSDF files of prismatic lenses for Radiance: tensor trees, traced once and kept."""

import hashlib
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from analysis.simulate.components import Lens
from analysis.simulate.store import cache_folder, code_digest, content_key, keep

DEPTH = 5
"""Finest cells of the trees are 1/32 of the square: about 3.6 degrees near the normal."""

_OPTICAL = ("refractive_index", "thickness_mm", "absorption_per_mm", "pitch_mm", "slope_deg", "blur_deg")


def bsdf_file(lens: Lens, folder: Path, depth: int = DEPTH) -> Path:
    """A BSDF file of a lens in ``folder``: made by ray tracing, from the cache, or a copy of the file it names.

    Its front is the flat side.
    """
    if lens.kind == "bsdf":
        source = Path(lens.bsdf)
        here = folder / f"{hashlib.sha256(source.read_bytes()).hexdigest()[:24]}.xml"
        shutil.copyfile(source, here)
        return here
    return _kept(lens, folder, {"depth": depth})


def klems_file(lens: Lens, folder: Path) -> Path:
    """The same in the full Klems basis."""
    return _kept(lens, folder, {"basis": "klems"})


def _kept(lens: Lens, folder: Path, form: dict[str, Any]) -> Path:
    recipe = {name: getattr(lens, name) for name in _OPTICAL} | form | {"code": code_digest("analysis/bsdf")}
    name = f"{content_key(recipe)}.xml"
    here, known = folder / name, cache_folder("bsdf") / name
    if known.is_file():
        shutil.copyfile(known, here)
    else:
        keep(known, _traced(lens, here, form).read_bytes())
    return here


def _traced(lens: Lens, path: Path, form: dict[str, Any]) -> Path:
    from analysis.bsdf.prism import PrismSheet, prism_tracer
    from analysis.bsdf.tally import klems_of
    from analysis.bsdf.tree_tally import tensor_tree_of
    from analysis.bsdf.xml_write import write_bsdf

    sheet = PrismSheet(
        index=lens.refractive_index,
        thickness_mm=lens.thickness_mm,
        pitch_mm=lens.pitch_mm,
        slope_deg=lens.slope_deg,
        slope_error_deg=lens.blur_deg,
        absorption_per_mm=lens.absorption_per_mm,
    )
    trace, rng = prism_tracer(sheet), np.random.default_rng(11)
    if "depth" in form:
        write_bsdf(path, tensor_tree_of(trace, rng, depth=form["depth"], rays=16_000))
    else:
        write_bsdf(path, klems_of(trace, rng, rays=40_000))
    return path
