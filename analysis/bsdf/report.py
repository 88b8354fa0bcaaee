"""Whether a BSDF can be true: reciprocity, no light made, white furnace.

References: Helmholtz reciprocity, f(i -> o) = f(-o -> -i) (E. Veach, Robust Monte Carlo Methods, Stanford 1997,
section 3.6; for transmission between media of the same index); white furnace: under light of the same luminance from
everywhere a device that absorbs nothing shows that luminance in every direction.
"""

from dataclasses import dataclass

import numpy as np

from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Floats


@dataclass(frozen=True, slots=True)
class Reciprocity:
    """How far a component is from the one that describes its paths walked backwards.

    Attributes
    ----------
    component, partner
        The two that are compared (the same for reflection).
    weighted
        Sum of |f - f'| over the sum of (f + f') / 2, both weighted with the projected solid angles of both patches: the
        part of the exchanged light that is in the wrong place.
    worst
        Largest |f - f'| / max(f, f') among elements that carry at least ``floor`` of their incident light.
    """

    component: Component
    partner: Component
    weighted: float
    worst: float


@dataclass(frozen=True)
class BsdfReport:
    """The laws, by numbers.

    Attributes
    ----------
    hemispherical
        Directional-hemispherical values by incident patch, by component, shape (n,).
    diffuse
        Bi-hemispherical values by component.
    total_front, total_back : shape (n,)
        Transmittance plus reflectance by incident patch.
    furnace_front, furnace_back : shape (n,)
        Luminance towards each outgoing patch on the front and on the back side when light of luminance 1 comes from
        both sides.
    reciprocity
        One for each pair that can be compared.
    """

    hemispherical: dict[Component, Floats]
    diffuse: dict[Component, float]
    total_front: Floats
    total_back: Floats
    furnace_front: Floats
    furnace_back: Floats
    reciprocity: tuple[Reciprocity, ...]

    def problems(self, tolerance: float = 0.01, reciprocity: float = 0.05) -> list[str]:
        """What breaks a law by more than ``tolerance`` (energy) or ``reciprocity`` (weighted), in words."""
        found = []
        for name, total in (("front", self.total_front), ("back", self.total_back)):
            if total.max() > 1.0 + tolerance:
                patch = int(total.argmax())
                found.append(
                    f"light from the {name}, patch {patch}: {total[patch]:.4f} times as much comes out as goes in"
                )
        for name, shown in (("front", self.furnace_front), ("back", self.furnace_back)):
            if shown.max() > 1.0 + tolerance:
                patch = int(shown.argmax())
                found.append(f"white furnace: luminance {shown[patch]:.4f} towards patch {patch} on the {name}")
        found += [
            f"{pair.component} is not reciprocal to {pair.partner}: {100 * pair.weighted:.1f} % in the wrong place"
            for pair in self.reciprocity
            if pair.weighted > reciprocity
        ]
        return found


def report(bsdf: KlemsBsdf, floor: float = 1e-3) -> BsdfReport:
    """Check a Klems BSDF; convert others first (`analysis.bsdf.convert`).

    ``floor`` limits `Reciprocity.worst` to elements that send at least that part of the light on.
    """
    hemispherical = {part: bsdf.hemispherical_by_patch(part) for part in bsdf.components()}
    nothing = np.zeros(bsdf.basis.size)

    def of(part: Component) -> Floats:
        return hemispherical.get(part, nothing)

    def shown(*parts: Component) -> Floats:
        return sum((bsdf.matrices[p] @ bsdf.basis.projected for p in parts if p in bsdf.matrices), start=nothing)

    return BsdfReport(
        hemispherical=hemispherical,
        diffuse={part: bsdf.diffuse(part) for part in bsdf.components()},
        total_front=of(Component.TF) + of(Component.RF),
        total_back=of(Component.TB) + of(Component.RB),
        furnace_front=shown(Component.TB, Component.RF),
        furnace_back=shown(Component.TF, Component.RB),
        reciprocity=tuple(_pairs(bsdf, floor)),
    )


def _pairs(bsdf: KlemsBsdf, floor: float) -> list[Reciprocity]:
    pairs = []
    for part in (Component.TF, Component.RF, Component.RB):
        partner = part.reciprocal
        if part not in bsdf.matrices or partner not in bsdf.matrices:
            continue
        forward = bsdf.matrices[part]
        backward = reversed_paths(bsdf, partner)
        projected = bsdf.basis.projected
        weight = projected[:, None] * projected
        apart = np.abs(forward - backward)
        scale = (weight * (forward + backward)).sum() / 2.0
        larger = np.maximum(forward, backward)
        heavy = larger * projected[:, None] >= floor
        worst = float((apart[heavy] / larger[heavy]).max()) if heavy.any() else 0.0
        pairs.append(Reciprocity(part, partner, float((weight * apart).sum() / scale) if scale > 0 else 0.0, worst))
    return pairs


def reversed_paths(bsdf: KlemsBsdf, component: Component) -> Floats:
    """The matrix a component gives for its paths walked backwards: element (o, i) from (opposite i, opposite o)."""
    opposite = bsdf.basis.opposite
    matrix: Floats = bsdf.matrices[component][np.ix_(opposite, opposite)].T
    return matrix


def made_reciprocal(bsdf: KlemsBsdf) -> KlemsBsdf:
    """The mean of each component and its reciprocal partner walked backwards.

    It halves the noise of traced matrices. Bi-hemispherical values are kept (their mean for the two transmissions);
    directional ones change by the noise that is taken out.
    """
    matrices = dict(bsdf.matrices)
    for part in bsdf.components():
        partner = part.reciprocal
        if partner in bsdf.matrices:
            matrices[part] = 0.5 * (bsdf.matrices[part] + reversed_paths(bsdf, partner))
    return KlemsBsdf(bsdf.basis, matrices, bsdf.material)
