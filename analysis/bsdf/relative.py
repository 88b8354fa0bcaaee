"""Relative intensity about the mirror ray, scaled by hemispherical values: how LTI Optics describes scattering.

For each direction of incidence the table holds intensities in any unit, over theta_m from the mirror ray (or, for
transmission, the straight ray), 0 to 180 degrees, and phi_m about it. Its size comes from a separate measurement of
directional-hemispherical transmittance or reflectance with an integrating sphere, so a missed peak shifts light about
but makes none (Greenwood report, chapter 6, "Relative Luminous Intensity and Coordinates").

phi_m = 0 is in the plane of incidence on the side away from the sample's normal, 180 towards it; it turns from there to
the left of somebody who looks along the ray with the normal overhead.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.bsdf.gridded import GriddedBsdf, outgoing_grid
from analysis.bsdf.model import Component, Floats, travel_sign, with_z
from analysis.photometry.distribution import interpolate
from labdaq.errors import DataError, Problems

_GRAZING = 1e-3
"""Smallest cosine an intensity is divided by: a BSDF of light that grazes the sample has no bound."""


@dataclass(frozen=True)
class RelativeTable:
    """One component.

    Attributes
    ----------
    theta_i_deg : shape (I,)
        Angles of incidence from 0 on [deg]; the sample is isotropic.
    theta_m_deg : shape (T,), phi_m_deg : shape (P,)
        From and about the mirror ray [deg]: 0..180 and 0..360, or 0..180 for the half that stands for both.
    intensity : shape (I, T, P)
        Relative, any unit.
    hemispherical : shape (I,)
        Transmittance or reflectance at each angle of incidence, 0 to 1.
    """

    theta_i_deg: Floats
    theta_m_deg: Floats
    phi_m_deg: Floats
    intensity: Floats
    hemispherical: Floats

    def __post_init__(self) -> None:
        problems = Problems("relative intensity table")
        shape = (self.theta_i_deg.size, self.theta_m_deg.size, self.phi_m_deg.size)
        for name in ("theta_i_deg", "theta_m_deg", "phi_m_deg"):
            if np.any(np.diff(getattr(self, name)) <= 0):
                problems.add(name, "must increase")
        if self.intensity.shape != shape:
            problems.add("intensity", f"has shape {self.intensity.shape}, the angles ask for {shape}")
        elif not (np.isfinite(self.intensity).all() and (self.intensity >= 0).all()):
            problems.add("intensity", "one is negative or not finite")
        if self.theta_m_deg[0] != 0 or self.theta_m_deg[-1] > 180 or self.theta_m_deg.size < 2:
            problems.add("theta_m_deg", "must start at 0 and end within 180")
        if self.phi_m_deg[0] != 0 or self.phi_m_deg[-1] not in (180, 360):
            problems.add("phi_m_deg", "must run from 0 to 180 or 360")
        if self.hemispherical.shape != self.theta_i_deg.shape or not (
            (self.hemispherical >= 0).all() and (self.hemispherical <= 1).all()
        ):
            problems.add("hemispherical", "must give a value between 0 and 1 for each angle of incidence")
        problems.raise_if_any(DataError)


class RelativeBsdf(GriddedBsdf):
    """A BSDF of relative intensities and hemispherical values.

    Parameters
    ----------
    tables
        By component.
    grid
        Outgoing grid for the scale and for samples; see `GriddedBsdf`.

    Raises
    ------
    DataError
        An intensity table holds no light in the hemisphere its hemispherical value is for.
    """

    def __init__(self, tables: Mapping[Component, RelativeTable], *, grid: int = 128) -> None:
        self.tables = dict(tables)
        self.grid = grid

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        return tuple(self.tables)

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast.

        BSDF is intensity over incident flux and cosine; the scale is set at the very direction of incidence, so the
        integral over the hemisphere is the interpolated hemispherical value.
        """
        incident, outgoing = np.broadcast_arrays(incident_xy, outgoing_xy)
        shape = incident.shape[:-1]
        table = self.tables.get(component)
        if table is None:
            return np.zeros(shape)
        incident, outgoing = incident.reshape(-1, 2), outgoing.reshape(-1, 2)
        unique, which = np.unique(incident, axis=0, return_inverse=True)
        result = np.zeros(len(incident))
        for k, xy in enumerate(unique):
            rows = np.flatnonzero(which.reshape(-1) == k)
            result[rows] = self._unscaled(table, component, xy, outgoing[rows]) * self._scale(table, component, xy)
        return result.reshape(shape)

    def hemispherical(self, component: Component, incident_xy: Floats) -> Floats:
        """Part of the light from each direction (..., 2) that this component sends on: the sphere's value."""
        table = self.tables.get(component)
        sine = np.minimum(1.0, np.hypot(incident_xy[..., 0], incident_xy[..., 1]))
        if table is None:
            return np.zeros(sine.shape)
        return np.interp(np.degrees(np.arcsin(sine)), table.theta_i_deg, table.hemispherical)

    def _scale(self, table: RelativeTable, component: Component, xy: Floats) -> float:
        """What the table must be multiplied with for light from one direction."""
        wanted = float(self.hemispherical(component, xy))
        if wanted == 0.0:
            return 0.0
        total = float(self._unscaled(table, component, xy, outgoing_grid(self.grid)).mean() * np.pi)
        if total <= 0.0:
            raise DataError(f"{component}: no relative intensity in the hemisphere that should hold {wanted:.3g}")
        return wanted / total

    @staticmethod
    def _unscaled(table: RelativeTable, component: Component, xy: Floats, outgoing: Floats) -> Floats:
        """Relative intensity over cosine towards directions (n, 2), for light from one direction (2,)."""
        sign = travel_sign(component.incidence) * (1.0 if component.transmits else -1.0)
        ray, out = with_z(xy, sign), with_z(outgoing, sign)
        sine = float(np.hypot(*xy))
        radial = np.array([xy[0] / sine, xy[1] / sine, 0.0]) if sine > 0 else np.array([1.0, 0.0, 0.0])
        away = radial - ray * float(radial @ ray)  # across the ray, away from the normal
        away /= np.linalg.norm(away)
        left = np.cross(ray, away)
        theta = np.degrees(np.arctan2(np.linalg.norm(np.cross(out, ray), axis=1), out @ ray))
        phi = np.degrees(np.arctan2(out @ left, out @ away)) % 360.0
        if table.phi_m_deg[-1] == 180:
            phi = np.minimum(phi, 360.0 - phi)
        theta_i = np.degrees(np.arcsin(min(1.0, sine)))
        k = int(np.clip(np.searchsorted(table.theta_i_deg, theta_i, side="right") - 1, 0, len(table.theta_i_deg) - 1))
        value = interpolate(table.phi_m_deg, table.theta_m_deg, table.intensity[k], phi, theta)
        if k + 1 < len(table.theta_i_deg) and theta_i > table.theta_i_deg[k]:
            low, high = table.theta_i_deg[k], table.theta_i_deg[k + 1]
            t = (theta_i - low) / (high - low)
            value = (1 - t) * value + t * interpolate(
                table.phi_m_deg, table.theta_m_deg, table.intensity[k + 1], phi, theta
            )
        return value / np.maximum(_GRAZING, np.abs(out[:, 2]))
