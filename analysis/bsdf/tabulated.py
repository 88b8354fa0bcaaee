"""BSDFs from tables over the angles of ASTM E2387.

E2387 (as the Greenwood report describes it): a normal ZB on the lit side and an axis XB in the sample; theta from ZB,
0 to 180 degrees, phi about ZB from XB. (theta_i, phi_i) is where the light comes from, (theta_s, phi_s) where it goes;
the mirror direction has theta_s = theta_i and phi_s = phi_i + 180, light that passes straight theta_s = 180 - theta_i.
XB is our x. For light on the front ZB is our -z and YB our -y; for light on the back they are our z and y.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.bsdf.gridded import GriddedBsdf
from analysis.bsdf.model import Bsdf, Component, Floats, Incidence
from labdaq.errors import DataError, Problems

Ints = NDArray[np.intp]


def travel_of_source(theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, incidence: Incidence = "front") -> Floats:
    """Direction of travel (..., 2) of light that comes from an E2387 direction [deg]."""
    return -travel_of_scatter(theta_i_deg, phi_i_deg, incidence)


def travel_of_scatter(theta_s_deg: ArrayLike, phi_s_deg: ArrayLike, incidence: Incidence = "front") -> Floats:
    """Direction of travel (..., 2) of light scattered to an E2387 direction [deg]; ``incidence`` is the lit side."""
    theta, phi = np.broadcast_arrays(np.radians(theta_s_deg), np.radians(phi_s_deg))
    xy = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], axis=-1)
    return _swapped(xy, incidence)


def _swapped(xy: Floats, incidence: Incidence) -> Floats:
    """Between our axes and E2387's, either way."""
    swapped: Floats = xy * np.array([1.0, -1.0 if incidence == "front" else 1.0])
    return swapped


@dataclass(frozen=True)
class ScatterTable:
    """One component on a grid of angles.

    Attributes
    ----------
    theta_i_deg : shape (I,), phi_i_deg : shape (J,)
        Where the light comes from, theta within 0..90 (from the normal of the lit side) [deg]. A single phi means an
        isotropic sample; several must run from 0 to 360, both included.
    theta_s_deg : shape (S,), phi_s_deg : shape (P,)
        Where it goes: theta within 0..90 from the normal of the side it leaves at [deg] (for transmission this is
        180 minus E2387's theta_s), phi from 0 to 360, both included.
    values : shape (I, J, S, P)
        BSDF [1/sr].
    """

    theta_i_deg: Floats
    phi_i_deg: Floats
    theta_s_deg: Floats
    phi_s_deg: Floats
    values: Floats

    def __post_init__(self) -> None:
        problems = Problems("scatter table")
        axes = {
            "theta_i": self.theta_i_deg,
            "phi_i": self.phi_i_deg,
            "theta_s": self.theta_s_deg,
            "phi_s": self.phi_s_deg,
        }
        for name, axis in axes.items():
            if axis.ndim != 1 or not axis.size or np.any(np.diff(axis) <= 0):
                problems.add(name, "must be a list of increasing angles")
            elif name.startswith("theta") and not (axis[0] >= 0 and axis[-1] <= 90):
                problems.add(name, f"must lie within 0..90, not {axis[0]:g}..{axis[-1]:g}")
            elif (
                name.startswith("phi") and (name == "phi_s" or axis.size > 1) and not (axis[0] == 0 and axis[-1] == 360)
            ):
                problems.add(name, f"must run from 0 to 360, both included, not {axis[0]:g} to {axis[-1]:g}")
        shape = tuple(axis.size for axis in axes.values())
        if self.values.shape != shape:
            problems.add("values", f"have shape {self.values.shape}, the angles ask for {shape}")
        elif not (np.isfinite(self.values).all() and (self.values >= 0).all()):
            problems.add("values", "one is negative or not finite")
        problems.raise_if_any(DataError)


def mirrored_phi(phi_deg: Floats, values: Floats, axis: int) -> tuple[Floats, Floats]:
    """Continue a table over phi by its mirror image: 0..180 becomes 0..360, in any axis of ``values``.

    For samples with a mirror plane of which only one side was measured.
    """
    if phi_deg[0] != 0 or phi_deg[-1] != 180:
        raise DataError(f"a table that is mirrored runs from 0 to 180, not {phi_deg[0]:g} to {phi_deg[-1]:g}")
    back = np.flip(np.take(values, np.arange(len(phi_deg) - 1), axis=axis), axis=axis)
    return np.concatenate([phi_deg, 360.0 - phi_deg[-2::-1]]), np.concatenate([values, back], axis=axis)


class TabulatedBsdf(GriddedBsdf):
    """A BSDF of tables.

    Parameters
    ----------
    tables
        By component.
    follow_mirror
        Between incident angles of the table, shift the outgoing direction with the mirror (or straight) ray before
        looking it up, as TracePro's tables do: a peak moves instead of fading from one place to the next. Directions
        shifted beyond the disc are drawn back to its edge.
    grid
        Outgoing grid for integrals and samples; see `GriddedBsdf`.
    """

    def __init__(
        self, tables: Mapping[Component, ScatterTable], *, follow_mirror: bool = True, grid: int = 128
    ) -> None:
        self.tables = dict(tables)
        self.follow_mirror = follow_mirror
        self.grid = grid

    def components(self) -> tuple[Component, ...]:
        """The parts it describes."""
        return tuple(self.tables)

    def evaluate(self, component: Component, incident_xy: Floats, outgoing_xy: Floats) -> Floats:
        """BSDF [1/sr] for directions of travel (..., 2), which broadcast."""
        incident, outgoing = np.broadcast_arrays(incident_xy, outgoing_xy)
        shape = incident.shape[:-1]
        table = self.tables.get(component)
        if table is None:
            return np.zeros(shape)
        # from here on in E2387's axes
        incident = _swapped(incident.reshape(-1, 2), component.incidence)
        outgoing = _swapped(outgoing.reshape(-1, 2), component.incidence)
        theta_i, phi_i = _angles(-incident)
        if len(table.phi_i_deg) == 1:  # isotropic: turn the whole situation to the azimuth that was measured
            angle = np.radians(phi_i - table.phi_i_deg[0])
            incident, outgoing = _turned_back(incident, angle), _turned_back(outgoing, angle)
            phi_i = np.full(len(theta_i), table.phi_i_deg[0])
        total = np.zeros(len(incident))
        for i, weight_i in _neighbours(table.theta_i_deg, theta_i):
            for j, weight_j in _neighbours(table.phi_i_deg, phi_i):
                place = outgoing
                if self.follow_mirror:
                    there = -_direction(table.theta_i_deg[i], table.phi_i_deg[j])
                    place = _into_disc(outgoing - incident + there)
                total += weight_i * weight_j * _look_up(table, i, j, place)
        return total.reshape(shape)


def _direction(theta_deg: Floats, phi_deg: Floats) -> Floats:
    sine = np.sin(np.radians(theta_deg))
    return np.stack([sine * np.cos(np.radians(phi_deg)), sine * np.sin(np.radians(phi_deg))], axis=-1)


def _angles(xy: Floats) -> tuple[Floats, Floats]:
    """Theta and phi [deg] of horizontal parts (..., 2) of unit vectors."""
    theta = np.degrees(np.arcsin(np.minimum(1.0, np.hypot(xy[..., 0], xy[..., 1]))))
    return theta, np.degrees(np.arctan2(xy[..., 1], xy[..., 0])) % 360.0


def _turned_back(xy: Floats, angle: Floats) -> Floats:
    """Directions (n, 2) turned by -angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * xy[:, 0] + s * xy[:, 1], -s * xy[:, 0] + c * xy[:, 1]], axis=-1)


def _into_disc(xy: Floats) -> Floats:
    radius = np.hypot(xy[..., 0], xy[..., 1])
    inside: Floats = xy / np.maximum(1.0, radius)[..., None]
    return inside


def _neighbours(axis: Floats, x: Floats) -> list[tuple[Ints, Floats]]:
    """The two grid indices around each x with their weights; values beyond the ends stay."""
    if len(axis) == 1:
        return [(np.zeros(len(x), dtype=np.intp), np.ones(len(x)))]
    i = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, len(axis) - 2)
    t = np.clip((x - axis[i]) / (axis[i + 1] - axis[i]), 0.0, 1.0)
    return [(i, 1.0 - t), (i + 1, t)]


def _look_up(table: ScatterTable, i: Ints, j: Ints, outgoing: Floats) -> Floats:
    """Bilinear value over theta_s and phi_s."""
    theta, phi = _angles(outgoing)
    total = np.zeros(len(outgoing))
    for s, weight_s in _neighbours(table.theta_s_deg, theta):
        for p, weight_p in _neighbours(table.phi_s_deg, phi):
            total += weight_s * weight_p * table.values[i, j, s, p]
    return total


def tabulate(
    bsdf: Bsdf,
    component: Component,
    theta_i_deg: ArrayLike,
    phi_i_deg: ArrayLike,
    theta_s_deg: ArrayLike,
    phi_s_deg: ArrayLike,
) -> ScatterTable:
    """Values of any BSDF on a grid of E2387 angles (see `ScatterTable`)."""
    a, b, c, d = (
        np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (theta_i_deg, phi_i_deg, theta_s_deg, phi_s_deg)
    )
    incident = travel_of_source(a[:, None], b, component.incidence)[:, :, None, None, :]
    outgoing = travel_of_scatter(c[:, None], d, component.incidence)
    return ScatterTable(a, b, c, d, bsdf.evaluate(component, incident, outgoing))
