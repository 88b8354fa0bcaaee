"""From the part of a distribution a file gives to all of it, by the symmetry the part stands for.

The last horizontal angle tells the symmetry (Autodesk and AGi32 descriptions of LM-63): type C files end at 0 (the same
in all planes), 90 (mirrored in both principal planes), 180 (mirrored in the plane C 0-180) or 360 (all there);
90 to 270 is mirrored in the plane C 90-270 (LM-63-1995). Types A and B run from -90, or from 0 and are then mirrored.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class UnfoldError(ValueError):
    """The horizontal angles stand for no symmetry; the text says why."""


def unfold_c(c_deg: Floats, candela: Floats) -> tuple[Floats, Floats, str]:
    """Unfold type C planes to C = 0..360.

    Parameters
    ----------
    c_deg : shape (H,) [deg]
        Increasing.
    candela : shape (H, V)

    Returns
    -------
    c_deg, candela
        From 0 to 360, both included.
    remark
        Empty, or how an incomplete set of planes was understood.

    Raises
    ------
    UnfoldError
    """
    first, last = c_deg[0], c_deg[-1]
    if len(c_deg) == 1:
        remark = "" if first == 0 else f"a single plane at C = {first:g}, taken for all planes"
        return np.array([0.0, 360.0]), np.repeat(candela, 2, axis=0), remark
    if first < 0 or last > 360:
        raise UnfoldError(f"C-planes must lie within 0 and 360, not {first:g} to {last:g}")
    if (first, last) == (90, 270):
        return (*_unfold_90_270(c_deg, candela), "")
    if first != 0:
        raise UnfoldError(f"C-planes must start at 0 (or run from 90 to 270), not {first:g} to {last:g}")
    if last == 90:
        c_deg, candela = _mirror(c_deg, candela, 90.0)
        last = 180.0
    if last == 180:
        c_deg, candela = _mirror(c_deg, candela, 180.0)
        last = 360.0
    if last == 360:
        return c_deg, candela, ""
    gap = 360.0 - last
    if len(c_deg) < 3 or gap > 1.001 * np.diff(c_deg).max():
        raise UnfoldError(f"C-planes end at {last:g}; they must end at 0, 90, 180 or 360")
    closed = np.concatenate([candela, candela[:1]])
    return np.append(c_deg, 360.0), closed, f"C-planes end at {last:g}; closed at 360 with the first plane"


def unfold_ab(horizontal_deg: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Unfold the horizontal angles of type A or B tables, shape (H,), (H, V), that start at 0.

    Raises
    ------
    UnfoldError
    """
    first, last = horizontal_deg[0], horizontal_deg[-1]
    if len(horizontal_deg) < 2:
        raise UnfoldError("type A and B tables need more than one horizontal angle")
    if first == 0:
        if not 0 < last <= 180:
            raise UnfoldError(f"horizontal angles that start at 0 must end within 180, not at {last:g}")
        back = slice(None, 0, -1)
        return np.concatenate([-horizontal_deg[back], horizontal_deg]), np.concatenate([candela[back], candela])
    if first < -180 or last > 180 or last < 0 or first > 0:
        raise UnfoldError(f"horizontal angles of types A and B run from -90 or 0 to 90, not {first:g} to {last:g}")
    return horizontal_deg, candela


def _mirror(c_deg: Floats, candela: Floats, about: float) -> tuple[Floats, Floats]:
    """Continue planes that end at ``about`` with their mirror images behind it."""
    back = slice(-2, None, -1)
    return np.concatenate([c_deg, 2 * about - c_deg[back]]), np.concatenate([candela, candela[back]])


def _unfold_90_270(c_deg: Floats, candela: Floats) -> tuple[Floats, Floats]:
    """Planes 90..270, mirrored in the plane C 90-270 (C to 180 - C)."""
    full_c, full = _mirror(c_deg, candela, 270.0)  # 90..450
    full_c, full = full_c[:-1], full[:-1]
    c = full_c % 360.0
    order = np.argsort(c, kind="stable")
    c, values = c[order], full[order]
    if c[0] != 0.0:  # no plane at 180, hence none at 0: take the value halfway, as interpolation would
        t = (360.0 - c[-1]) / (360.0 - c[-1] + c[0])
        seam = (1 - t) * values[-1] + t * values[0]
        c, values = np.concatenate([[0.0], c]), np.concatenate([seam[None], values])
    return np.append(c, 360.0), np.concatenate([values, values[:1]])
