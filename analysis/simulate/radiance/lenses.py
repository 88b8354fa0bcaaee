"""BSDF files of prismatic lenses for Radiance: tensor trees, traced once and kept."""

import functools
import hashlib
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from analysis.bsdf.model import Incidence, Tracer
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.simulate.components import Lens
from analysis.simulate.lens import OPTICAL, sheet_of
from analysis.simulate.store import cache_folder, code_digest, content_key, keep

DEPTH = 5
"""Finest cells of the trees are 1/32 of the square: about 3.6 degrees near the normal."""

FINER = 1
"""Levels that the sun's trees have more: cells of half the width, 1.8 degrees near the normal.

With one more Radiance would choose among 16,384 tables of directions for each ray, and take ten times as long."""

SUN_RAYS = 2_000_000
"""Traced for each of a cover's panes."""

Vector = tuple[float, float, float]


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


def sun_file(lens: Lens, folder: Path, toward: list[Vector], half_angle_deg: float, depth: int = DEPTH) -> Path:
    """A BSDF file of a prismatic lens for the sun's light alone: it transmits nothing but from and to the sun.

    Parameters
    ----------
    toward
        Unit vectors to the sun in the BSDF's frame (Radiance's: z out of the side with the prisms), one for each of the
        panes that it shines on.
    half_angle_deg
        Of the sun; each tree has the mean over its disc, so the sun is neither displaced nor spread.
    depth
        Of the trees of reflection, which are those of `bsdf_file`; transmission has `FINER` levels more.

    Radiance asks for the sun's light by the cell that holds the middle of its disc, at several directions about the
    ray's own (`direct_specular_OK` of its ``m_bsdf.c``), and leaves out such as have a cell of less than an eighth of
    the ray's own. Here neighbours differ by no more than twice the width, so none is left out.
    """
    here = folder / "sun.xml"
    here.write_bytes(_for_sun(lens, tuple(toward), half_angle_deg, depth))
    return here


@functools.lru_cache(maxsize=4)
def _for_sun(lens: Lens, toward: tuple[Vector, ...], half_angle_deg: float, depth: int) -> bytes:
    from analysis.bsdf.tree_beam import beam_trees
    from analysis.bsdf.xml_read import read_bsdf
    from analysis.bsdf.xml_write import render_bsdf

    with tempfile.TemporaryDirectory(prefix="labdaq-lens-") as name:
        whole = read_bsdf(bsdf_file(lens, Path(name), depth)).bsdf
    assert isinstance(whole, TensorTreeBsdf)
    travel, rng = -np.array(toward), np.random.default_rng(100 + depth)
    side: Incidence = "front" if lens.prisms == "down" else "back"
    beams = beam_trees(_tracer(lens), side, travel, half_angle_deg, rng, depth=depth + FINER, rays=SUN_RAYS)
    return render_bsdf(TensorTreeBsdf({**whole.trees, **beams}))


def klems_file(lens: Lens, folder: Path) -> Path:
    """The same in the full Klems basis."""
    return _kept(lens, folder, {"basis": "klems"})


def _kept(lens: Lens, folder: Path, form: dict[str, Any]) -> Path:
    recipe = {name: getattr(lens, name) for name in OPTICAL} | form | {"code": code_digest("analysis/bsdf")}
    name = f"{content_key(recipe)}.xml"
    here, known = folder / name, cache_folder("bsdf") / name
    if known.is_file():
        shutil.copyfile(known, here)
    else:
        keep(known, _traced(lens, here, form).read_bytes())
    return here


def _traced(lens: Lens, path: Path, form: dict[str, Any]) -> Path:
    from analysis.bsdf.tally import klems_of
    from analysis.bsdf.tree_tally import tensor_tree_of
    from analysis.bsdf.xml_write import write_bsdf

    trace, rng = _tracer(lens), np.random.default_rng(11)
    if "depth" in form:
        write_bsdf(path, tensor_tree_of(trace, rng, depth=form["depth"], rays=16_000))
    else:
        write_bsdf(path, klems_of(trace, rng, rays=40_000))
    return path


def _tracer(lens: Lens) -> Tracer:
    from analysis.bsdf.prism import prism_tracer

    return prism_tracer(sheet_of(lens))
