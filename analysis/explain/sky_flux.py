"""Where the diffuse light on a level meter comes from: by height in the sky, and how far from the sun's side.

A meter that leans towards the sun sees more of the bright sky round it, not of the beam alone: to take the sky for even
makes a tilt come out a fifth too large. The sky is Perez' (1993), by each row's own beam and diffuse illuminance.
"""

from dataclasses import dataclass

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.readings import ROOF, Readings

RINGS_DEG = np.arange(2.5, 90.0, 5.0)
"""Zenith angles of the rings' middles."""
ABOUT_DEG = 8.0
"""What a shading disc of another size hides, or leaves, lies within this angle of the sun."""
_STEPS = (2.0, 5000.0, 2000.0)
"""Skies are worked out to so many degrees of the sun's height, and lx of normal beam and of diffuse light."""


@dataclass(frozen=True)
class SkyFlux:
    """Diffuse light of each row.

    Attributes
    ----------
    rings : shape (N, 18)
        Share of the horizontal diffuse illuminance that comes from each of `RINGS_DEG`.
    sunward : shape (N,)
        Horizontal component of the light's flow, from the sun's side, over the horizontal diffuse illuminance: by
        so much (times the sine) grows the diffuse light on a meter that leans towards the sun.
    about : shape (N,)
        Share of the horizontal diffuse illuminance that comes from within `ABOUT_DEG` of the sun.
    """

    rings: Floats
    sunward: Floats
    about: Floats

    @classmethod
    def of(cls, readings: Readings) -> "SkyFlux":
        """The skies over all roof rows; an even sky on others, and where the parts are not known."""
        r = readings
        even = np.sin(2.0 * np.radians(RINGS_DEG))
        rings = np.tile(even / even.sum(), (len(r), 1))
        sunward, about = np.zeros(len(r)), np.zeros(len(r))
        known = (r.kind == ROOF) & np.isfinite(r.sun) & (r.sky > 0.0) & np.isfinite(r.sun_altitude_at_deg)
        height = np.maximum(r.sun_altitude_at_deg, 3.0)
        normal = np.maximum(r.sun, 0.0) / np.sin(np.radians(height))
        facts = np.round(np.stack([height, normal, r.sky], axis=1)[known] / _STEPS)
        skies, which = np.unique(facts, axis=0, return_inverse=True)
        made = [_flux(*(sky * _STEPS)) for sky in skies]
        if made:
            rings[known] = np.stack([m[0] for m in made])[which.ravel()]
            sunward[known], about[known] = np.array([m[1:] for m in made])[which.ravel()].T
        return cls(rings, sunward, about)


def _flux(height_deg: float, normal_lx: float, diffuse_lx: float) -> tuple[Floats, float, float]:
    """Shares of the rings, the sunward component, and the share about the sun of one sky."""
    from analysis.sky.perez import PerezSky
    from analysis.sky.quadrature import KINKED, hemisphere_nodes, nodes

    sky = PerezSky.from_illuminances(normal_lx, max(diffuse_lx, 100.0), height_deg, 0.0)
    zenith = float(np.radians(90.0 - height_deg))
    kinked = "negative-clipped" in sky.flags
    cosine, away, weight = nodes(zenith, KINKED) if kinked else hemisphere_nodes(round(zenith, 9))
    across = (np.cos(away) - cosine * np.cos(zenith)) / max(float(np.sin(zenith)), 1e-3)  # towards the sun's side
    side = np.sqrt(np.maximum(1.0 - cosine**2 - across**2, 0.0))
    vectors = np.stack([side, across, cosine], axis=-1)  # the sky was made with its sun in the north, +y
    light = sky.luminance(vectors) * weight
    level = light * cosine
    edges = np.radians(np.append(RINGS_DEG - 2.5, 90.1))
    shares, _ = np.histogram(np.arccos(np.clip(cosine, 0.0, 1.0)), bins=edges, weights=level)
    total = float(level.sum())
    near = away < np.radians(ABOUT_DEG)
    return shares / total, float(np.sum(light * across)) / total, float(np.sum(level[near])) / total
