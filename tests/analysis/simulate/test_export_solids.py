"""Exported solids: closed, of the right volume, and the same to third-party readers."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from analysis.simulate.components import Lens
from analysis.simulate.export.meshes import write_obj, write_stl
from analysis.simulate.export.solids import WALL_M, Solid, solids
from analysis.simulate.system import System, named

CASES = [
    named("top"),
    named("box"),
    named("tube"),
    named("box").replace(rise_m=0.0, rotation_deg=31.0),
    named("tube").replace(rise_m=0.0, entry=Lens(), name="flat tube"),
]


@pytest.mark.parametrize("system", CASES, ids=lambda s: s.name)
def test_every_edge_is_shared_by_two_faces_in_opposite_directions(system: System) -> None:
    for body in solids(system):
        a, b, c = body.triangles.T
        edges = Counter(zip(np.concatenate([a, b, c]).tolist(), np.concatenate([b, c, a]).tolist(), strict=True))
        assert max(edges.values()) == 1, body.name
        assert all(edges[(q, p)] == 1 for p, q in edges), body.name
        assert set(np.unique(body.triangles)) == set(range(len(body.vertices)))


def test_volumes_follow_from_the_dimensions() -> None:
    box = {body.name: body.volume_m3 for body in solids(named("box").replace(rotation_deg=20.0))}
    side = 0.6096
    assert box["cover"] == pytest.approx(side**2 * 0.003, rel=1e-9)  # moved up by its thickness
    assert box["exit"] == pytest.approx(side**2 * 0.003, rel=1e-9)
    assert box["well"] == pytest.approx(((side + 2 * WALL_M) ** 2 - side**2) * 0.61, rel=1e-9)
    tube = {body.name: body.volume_m3 for body in solids(named("tube"))}
    polygon = math.sin(2 * math.pi / 96) / (2 * math.pi / 96)
    assert tube["exit"] == pytest.approx(polygon * math.pi * 0.1778**2 * 0.003, rel=1e-9)
    assert tube["boot"] / tube["well"] == pytest.approx(0.08 / (0.9144 - 0.08), rel=1e-9)


def test_bodies_stack_without_gaps() -> None:
    tube = {body.name: body.vertices[:, 2] for body in solids(named("tube"))}
    assert tube["exit"].max() == tube["boot"].min() == 0.0
    assert tube["boot"].max() == tube["well"].min() == 0.08
    assert tube["well"].max() == pytest.approx(tube["cover"].min()) == pytest.approx(0.9144)
    assert tube["cover"].max() == pytest.approx(0.9144 + 0.12 + 0.003)


@pytest.mark.parametrize("system", CASES, ids=lambda s: s.name)
def test_trimesh_reads_the_same_closed_bodies(system: System, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    bodies = solids(system)
    write_obj(tmp_path / "all.obj", bodies)
    read = trimesh.load(tmp_path / "all.obj", force="scene", split_object=True)
    assert len(read.geometry) == len(bodies)
    volumes = sorted(body.volume_m3 for body in bodies)
    assert sorted(part.volume * 1e-9 for part in read.geometry.values()) == pytest.approx(volumes, rel=1e-5)
    for body in bodies:
        write_stl(tmp_path / f"{body.name}.stl", body)
        part = trimesh.load(tmp_path / f"{body.name}.stl")
        assert part.is_watertight and part.is_winding_consistent and part.euler_number == _euler(body)
        assert part.volume * 1e-9 == pytest.approx(body.volume_m3, rel=1e-4)  # single precision


def _euler(body: Solid) -> int:
    return 0 if body.name in ("well", "boot") else 2  # a ring and a sphere


def test_radiance_reads_the_obj(tmp_path: Path) -> None:
    from analysis.simulate.radiance.tools import radiance

    bodies = solids(named("box"))
    write_obj(tmp_path / "all.obj", bodies)
    materials = "".join(f"void plastic {body.name} 0 0 5 .5 .5 .5 0 0\n" for body in bodies)
    (tmp_path / "m.rad").write_text(materials)
    assert radiance(["obj2mesh", "-a", "m.rad", "all.obj"], b"", tmp_path).startswith(b"#?RADIANCE")
    counts = radiance(["obj2rad", "all.obj"], b"", tmp_path).decode()
    assert counts.count(" polygon ") == sum(len(body.triangles) for body in bodies)
