"""BSDF files of prismatic lenses for Radiance: tensor trees, traced once and kept."""

import shutil
from pathlib import Path

import numpy as np

from analysis.simulate.store import cache_folder, code_digest, content_key
from analysis.simulate.system import Lens

DEPTH = 5
"""Finest cells of the trees are 1/32 of the square: about 3.6 degrees near the normal."""

_OPTICAL = ("refractive_index", "thickness_mm", "absorption_per_mm", "pitch_mm", "slope_deg", "blur_deg")


def bsdf_file(lens: Lens, folder: Path, depth: int = DEPTH) -> Path:
    """A BSDF file of a lens in ``folder`` (made by ray tracing, or copied from the cache); front is the flat side."""
    recipe = {name: getattr(lens, name) for name in _OPTICAL} | {"depth": depth, "code": code_digest("analysis/bsdf")}
    name = f"{content_key(recipe)}.xml"
    kept = cache_folder("bsdf") / name
    here = folder / name
    if not kept.is_file():
        made = _traced(lens, folder / f"new-{name}", depth)
        try:
            kept.parent.mkdir(parents=True, exist_ok=True)
            part = kept.with_suffix(".part")
            shutil.copyfile(made, part)
            part.replace(kept)
        except OSError:
            made.replace(here)
            return here
    shutil.copyfile(kept, here)
    return here


def _traced(lens: Lens, path: Path, depth: int) -> Path:
    from analysis.bsdf.prism import PrismSheet, prism_tracer
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
    write_bsdf(path, tensor_tree_of(prism_tracer(sheet), np.random.default_rng(11), depth=depth, rays=16_000))
    return path
