"""The forms a BSDF file may have, and how any scattering is brought into one.

What evaluates is averaged, without noise; what is too sharp for that, or must be turned about to become isotropic, is
traced. Geometries are always traced. Either way no light is made or lost.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.random import Generator

from analysis.bsdf.basis import KLEMS_2X, KLEMS_4X, KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, AngleBasis
from analysis.bsdf.convert import TooSharp, to_klems, to_tensor_tree
from analysis.bsdf.gridded import GriddedBsdf, outgoing_grid
from analysis.bsdf.harvey import AbgBsdf
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Bsdf, Component, Floats, Incidence, Material, Tracer
from analysis.bsdf.relative import RelativeBsdf
from analysis.bsdf.tabulated import TabulatedBsdf
from analysis.bsdf.tally import klems_of
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree_tally import tensor_tree_of
from labdaq.errors import ConfigError

Stored = KlemsBsdf | TensorTreeBsdf
"""What a file can hold."""

FORMS: Final[dict[str, AngleBasis | int]] = {
    "klems-full": KLEMS_FULL,
    "klems-half": KLEMS_HALF,
    "klems-quarter": KLEMS_QUARTER,
    "klems-2x": KLEMS_2X,
    "klems-4x": KLEMS_4X,
    "tree3": 3,
    "tree4": 4,
}
"""Klems basis, or rank of a tensor tree, by name."""

DEPTH: Final = 5
"""Finest cells of trees are 1/32 of the square, about 3.6 degrees near the normal."""

RAYS: Final = 10_000
"""Traced for each incident patch or cell."""

_BUNDLE: Final = 200
"""Rays of one direction: descriptions look each direction up first."""


@dataclass(frozen=True)
class Made:
    """A BSDF in a form that can be stored.

    Attributes
    ----------
    bsdf
        It.
    rays
        Traced for each incident patch or cell; 0 when it was averaged, without noise.
    """

    bsdf: Stored
    rays: int


def converted(
    bsdf: Bsdf, form: str, *, rays: int = RAYS, rng: Generator | None = None, material: Material | None = None
) -> Made:
    """Bring a BSDF into a form of `FORMS`.

    ``tree3`` of what is not isotropic is its mean over all orientations. Raises `DataError` when a table is sharper
    than its own grid.
    """
    basis = _form(form)
    if not (_mirrors(bsdf) or (basis == 3 and not _isotropic(bsdf))):
        try:
            if isinstance(basis, AngleBasis):
                return Made(to_klems(bsdf, basis, material=material), 0)
            return Made(to_tensor_tree(bsdf, rank=basis, depth=DEPTH, material=material), 0)
        except TooSharp:
            if isinstance(bsdf, GriddedBsdf):  # its rays come from a grid, too
                raise
    assert callable(bsdf)
    sides: list[Incidence] = [s for s in ("front", "back") if any(c.incidence == s for c in bsdf.components())]
    given = material or getattr(bsdf, "material", None)
    made = traced(bsdf, form, rng or np.random.default_rng(1), rays=rays, incidences=tuple(sides), material=given,
                  samples=min(_BUNDLE, rays))  # fmt: skip
    return Made(_only(made.bsdf, bsdf.components()), made.rays)


def traced(
    tracer: Tracer,
    form: str,
    rng: Generator,
    *,
    rays: int = RAYS,
    samples: int = 1,
    incidences: tuple[Incidence, ...] = ("front", "back"),
    material: Material | None = None,
) -> Made:
    """Bring a geometry into a form of `FORMS` by ray tracing; ``rays`` for each incident patch or cell."""
    basis = _form(form)
    if isinstance(basis, AngleBasis):
        made: Stored = klems_of(
            tracer, rng, basis=basis, rays=rays, samples=samples, incidences=incidences, material=material
        )
    else:
        made = tensor_tree_of(
            tracer, rng, rank=basis, depth=DEPTH, rays=rays, samples=samples, incidences=incidences, material=material
        )
    return Made(made, rays)


def form_of(bsdf: Stored) -> str:
    """The form in words, e.g. ``LBNL/Klems Full, 145 patches``."""
    if isinstance(bsdf, KlemsBsdf):
        return f"{bsdf.basis.name}, {bsdf.basis.size} patches"
    depth = max(tree.depth for tree in bsdf.trees.values())
    kind = "isotropic" if bsdf.rank == 3 else "anisotropic"
    return f"tensor tree of rank {bsdf.rank} ({kind}), finest cells 1/{1 << depth} of the square"


def diffuse(bsdf: Stored, component: Component) -> float:
    """Bi-hemispherical transmittance or reflectance: of evenly diffuse light."""
    if isinstance(bsdf, KlemsBsdf):
        return bsdf.diffuse(component)
    return float(bsdf.hemispherical(component, outgoing_grid(64)).mean())


def by_angle(bsdf: Bsdf, component: Component, theta_deg: Floats, azimuths: int = 24) -> Floats:
    """Hemispherical value at angles of incidence, mean over azimuths; shape of ``theta_deg``."""
    phi = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    sine = np.sin(np.radians(theta_deg))[..., None]
    xy = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi)), axis=-1)
    mean: Floats = bsdf.hemispherical(component, xy).mean(axis=-1)
    return mean


def _form(name: str) -> AngleBasis | int:
    if name not in FORMS:
        raise ConfigError(f"{name!r} is no form of a BSDF", f"one of {', '.join(FORMS)}")
    return FORMS[name]


def _mirrors(bsdf: Bsdf) -> bool:
    """Whether part of the light is not scattered at all: it has no value that could be averaged."""
    return isinstance(bsdf, AbgBsdf) and any((lobe.specular > 0.0).any() for lobe in bsdf.lobes.values())


def _isotropic(bsdf: Bsdf) -> bool:
    if isinstance(bsdf, TensorTreeBsdf):
        return bsdf.rank == 3
    if isinstance(bsdf, TabulatedBsdf):
        return all(table.phi_i_deg.size == 1 for table in bsdf.tables.values())
    return isinstance(bsdf, AbgBsdf | RelativeBsdf)


def _only(bsdf: Stored, components: tuple[Component, ...]) -> Stored:
    """Without components that the source does not describe: tracing finds them empty."""
    if isinstance(bsdf, KlemsBsdf):
        return KlemsBsdf(bsdf.basis, {c: m for c, m in bsdf.matrices.items() if c in components}, bsdf.material)
    return TensorTreeBsdf({c: t for c, t in bsdf.trees.items() if c in components}, bsdf.material)
