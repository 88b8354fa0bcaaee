"""Solids as OBJ and binary STL files, in millimetres."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from analysis.simulate.export.solids import Solid
from labdaq.whole_file import write_whole_bytes

MM: Final = 1000.0


def write_obj(path: Path, bodies: Iterable[Solid]) -> None:
    """Write all bodies to one Wavefront OBJ file, each an object and a material of its own name [mm].

    Raises `StorageError`.
    """
    lines = ["# skylight, millimetres; x east, y north, z up; origin in the centre of the aperture"]
    first = 1
    for body in bodies:
        lines += [f"o {body.name}", f"usemtl {body.name}"]
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in MM * body.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in body.triangles + first]
        first += len(body.vertices)
    write_whole_bytes(path, ("\n".join(lines) + "\n").encode())


def write_stl(path: Path, body: Solid) -> None:
    """Write one body as binary STL [mm]: 80 bytes of title, a count, and 50 bytes for each triangle.

    Raises `StorageError`.
    """
    corners = MM * body.vertices[body.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("zero", "<u2")])
    rows = np.zeros(len(corners), dtype=record)
    rows["normal"] = normals / np.where(length > 0.0, length, 1.0)
    rows["corners"] = corners
    title = f"labdaq {body.name}, millimetres".encode().ljust(80)
    write_whole_bytes(path, title + np.uint32(len(rows)).astype("<u4").tobytes() + rows.tobytes())
