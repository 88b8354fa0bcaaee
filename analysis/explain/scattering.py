"""Haze that goes on forwards: of what a lens sends on, a share is scattered about where the light came from.

Haze to all sides is a setting of our engine's lenses. This one is none: a lens that scatters all light is traced in
place of the lens, and a share of what that makes stands for as much of the light (light adds; of two lenses in one
skylight a share of each to first order). It is given as much light as it replaces: haze takes none.

That is done to densities of shifts alone. Where prisms were supposed, images lie elsewhere than predicted, and what
blurs them looks like haze. (Beside prisms an author's lost pattern was told as a haze, with 63 nats; none that was true
was found so.)
"""

import dataclasses
from collections.abc import Iterable
from typing import Final

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fields import solid_angle
from analysis.simulate.components import Lens
from analysis.simulate.lens_shift import cells

SCATTERED: Final = "scattered"
SCATTERERS: Final[dict[str, tuple[float, float]]] = {
    "forwards": (0.4, 1.0),
    "more widely": (0.45, 0.7),
}
"""How widely (rms in direction cosines), and about which share of light's own: as a rough surface, and a turbid sheet.
(Of one author's haze of 5.5 % the first had 127 nats, the second 146, haze to all sides 18; of another's of 3.9 %, in
lobes half as wide again, 34, 30 and 10.)"""


def scattering(lens: Lens, kind: str) -> Lens:
    """A lens like another that scatters all light."""
    width, kept = SCATTERERS[kind]
    x, y = np.meshgrid(cells(), cells(), indexing="ij")
    shifts = tuple(np.exp(-0.5 * (x**2 + y**2) / width**2).ravel().tolist())
    return dataclasses.replace(lens, kind="shift", shifts=shifts, kept=kept, haze=0.0, bsdf="")


def partly(base: Floats, wholes: Iterable[Floats], share: float) -> Floats:
    """Light (T, P, G) [cd] of one system where a share is scattered in each of its lenses.

    ``wholes`` is what it would be with all light scattered in one lens; ``base`` is it without any.
    """
    weight = solid_angle()
    made = base.copy()
    for whole in wholes:
        as_much = float(np.sum(base * weight)) / max(float(np.sum(whole * weight)), 1e-12)
        made += share * (as_much * whole - base)
    return np.maximum(made, 0.0)
