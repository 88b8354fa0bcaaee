"""Whether an obstruction stands in a ray's way to the cover."""

from analysis.simulate.kernels.arrays import Floats
from analysis.simulate.kernels.jit import jit


@jit
def shaded(obstructions: Floats, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> bool:
    """Whether light that travels along d to a point met one of the parallelograms before.

    Rows as `analysis.simulate.obstruction.rows` makes them.
    """
    for m in range(obstructions.shape[0]):
        row = obstructions[m]
        fall = dx * row[3] + dy * row[4] + dz * row[5]
        px, py, pz = x - row[0], y - row[1], z - row[2]
        rise = px * row[3] + py * row[4] + pz * row[5]
        if rise * fall <= 0.0:
            continue  # in its plane, or behind the point
        back = rise / fall
        qx, qy, qz = px - back * dx, py - back * dy, pz - back * dz
        a = qx * row[6] + qy * row[7] + qz * row[8]
        b = qx * row[9] + qy * row[10] + qz * row[11]
        if 0.0 <= a <= 1.0 and 0.0 <= b <= 1.0:
            return True
    return False
