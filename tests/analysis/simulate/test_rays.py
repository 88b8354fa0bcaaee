"""Sets of rays: true to the daylight they come from, the same after any file, and a source like sun and sky."""

import struct
from pathlib import Path

import numpy as np
import pytest

from analysis.simulate.daylight import daylight
from analysis.simulate.model import facets
from analysis.simulate.predict import predict, predict_rays
from analysis.simulate.rays import RaySet, entering, read_rays, write_rays
from analysis.simulate.system import named
from analysis.simulate.tracer import Settings
from labdaq.directions import sky_vector
from labdaq.errors import DataError

DAY = daylight(40.0, 120.0, 60_000.0, 20_000.0, "perez")


def test_flux_is_that_of_sun_and_sky_on_the_facets() -> None:
    """Sun: normal illuminance times the facets' projected areas; sky alone: twice the rays, the same flux."""
    system = named("box")
    rows = facets(system)
    cosines = np.maximum(0.0, rows[:, :3] @ sky_vector(40.0, 120.0))
    sun = DAY.normal_lx * float(cosines @ rows[:, 4])
    beam = daylight(40.0, 120.0, 40_000.0, 0.0, "uniform")
    assert entering(system, beam, 2000).flux_lm.sum() == pytest.approx(sun, rel=1e-4)
    both = [entering(system, DAY, count, seed).flux_lm.sum() for count, seed in ((50_000, 1), (100_000, 2))]
    assert both[0] == pytest.approx(both[1], rel=3e-3)
    flat = system.replace(rise_m=0.0)
    total = entering(flat, DAY, 100_000).flux_lm.sum()
    assert total == pytest.approx(60_000.0 * flat.aperture_area_m2, rel=2e-3)


def test_rays_start_outside_and_travel_down() -> None:
    rays = entering(named("tube"), DAY, 5000)
    assert np.allclose(np.linalg.norm(rays.directions, axis=1), 1.0)
    assert np.all(rays.directions[:, 2] < 0.0) and np.all(rays.points[:, 2] >= 0.9144)
    assert np.all(rays.flux_lm > 0.0)


@pytest.mark.parametrize("name", ["rays.txt", "rays.csv", "rays.tm25ray"])
def test_files_give_the_same_rays_back(tmp_path: Path, name: str) -> None:
    rays = entering(named("box"), DAY, 2000)
    write_rays(tmp_path / name, rays, "a title", "2026-01-31T00:00:00Z")
    back = read_rays(tmp_path / name)
    assert np.allclose(back.points, rays.points, atol=1e-7 if name != "rays.tm25ray" else 5e-7)
    assert np.allclose(back.directions, rays.directions, atol=2e-7)
    assert np.allclose(back.flux_lm, rays.flux_lm, rtol=1e-6)


def test_tm25_bytes_are_where_the_layout_says(tmp_path: Path) -> None:
    rows = np.array([[0.1, 0.2, 0.3, 0.0, 0.6, -0.8, 7.5]])
    write_rays(tmp_path / "a.tm25ray", RaySet.of(rows), "Häuschen", "2026-01-31T12:00:00Z")
    data = (tmp_path / "a.tm25ray").read_bytes()
    assert data[:4] == b"TM25" and struct.unpack_from("<i", data, 4) == (2013,)
    assert struct.unpack_from("<f", data, 12) == (7.5,) and struct.unpack_from("<Q", data, 20) == (1,)
    assert data[28:48] == b"2026-01-31T12:00:00Z"
    assert struct.unpack_from("<8i", data, 256) == (1, 1, 0, 0, 1, 0, 0, 0)
    assert data[288 : 288 + 32].decode("utf-32-le") == "Häuschen"
    assert np.allclose(struct.unpack_from("<7f", data, 36_288), [100, 200, 300, 0, 0.6, -0.8, 7.5])
    assert len(data) == 36_288 + 28


def test_tm25_of_makers_with_tables_watts_and_further_columns(tmp_path: Path) -> None:
    """Radiant flux with a spectral table and a column of one's own: scaled to the header's lumens."""
    write_rays(
        tmp_path / "a.tm25ray", RaySet.of(np.array([[0, 0, 1.0, 0, 0, -1, 1.0], [0, 0, 1.0, 0, 0, -1, 3.0]])), ""
    )
    data = bytearray((tmp_path / "a.tm25ray").read_bytes())
    head, old = data[:36_288], np.frombuffer(bytes(data[36_288:]), "<f4").reshape(2, 7)
    struct.pack_into("<f", head, 12, 100.0)
    struct.pack_into("<i", head, 60, 3)  # one table for all rays
    struct.pack_into("<ii", head, 76, 1, 1)  # one table, one further column
    struct.pack_into("<8i", head, 256, 1, 1, 1, 0, 0, 0, 0, 0)
    table = struct.pack("<i4f", 2, 400.0, 0.5, 700.0, 1.0).ljust(32, b"\0")
    name = "own".encode("utf-32-le").ljust(512, b"\0")
    body = np.concatenate([old, [[9.0], [9.0]]], axis=1).astype("<f4").tobytes()
    (tmp_path / "b.tm25ray").write_bytes(bytes(head) + table + name + body)
    assert read_rays(tmp_path / "b.tm25ray").flux_lm == pytest.approx([25.0, 75.0])


def test_text_of_others(tmp_path: Path) -> None:
    """Millimetres, tabs, a line of names, a wavelength in an eighth column, directions of any length."""
    path = tmp_path / "others.txt"
    path.write_text("# unit: mm\nX\tY\tZ\tL\tM\tN\tFlux\tW\n1000\t0\t2000\t0\t0\t-2\t5\t0.55\n")
    rays = read_rays(path)
    assert rays.points.tolist() == [[1.0, 0.0, 2.0]] and rays.directions.tolist() == [[0.0, 0.0, -1.0]]


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.txt", "# x\n0 0 1 0 0 -1 1\n0 0 1 0 0 -1\n", "line 3"),
        ("a.txt", "0 0 1 0 0 -1 1\n0 0 1 0 zero -1 1\n", "line 2"),
        ("a.txt", "# unit: furlong\n0 0 1 0 0 -1 1\n", "line 1.*no unit"),
        ("a.txt", "# nothing\n", "no rays"),
        ("a.txt", "20 1\n0 0 1 0 0 -1 1\n", "a.txt, line 1: '20 1' is not x y z l m n flux\n.*0.1 -0.2 0.9 0 0 -1 2.5"),
        ("a.txt", "0 0 1 0 0 -1 1\n\n0 0 1 0 0 0 1\n", "a.txt, line 3.*undefined"),
        ("a.csv", "x,y,z,l,m,n,flux\n0,0,1,0,0,-1,-1\n", "a.csv, line 2.*negative"),
        ("a.tm25ray", "TM25", "not a TM-25"),
        ("a.ray", "0 0 1 0 0 -1 1\n", "ends in"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, name: str, text: str, says: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match=says):
        read_rays(tmp_path / name)


def test_a_shortened_tm25_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.tm25ray"
    write_rays(path, entering(named("box"), DAY, 100), "")
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(DataError, match="promises 100 rays and holds 98"):
        read_rays(path)


@pytest.mark.parametrize("name", ["box", "tube"])
def test_traced_rays_give_the_photometry_of_sun_and_sky(name: str) -> None:
    """Flux within the noise of 100,000 rays (about 0.5 %), intensity within both stated uncertainties."""
    system = named(name)
    direct = predict(system, DAY, distance_m=2.6, rays=300_000, threads=1).field("near")
    rays = predict_rays(system, entering(system, DAY, 100_000), Settings(distance_m=2.6)).field("near")
    assert rays.total.flux() == pytest.approx(direct.total.flux(), rel=0.015)
    a, b = rays.total.candela, direct.total.candela
    bright = b > 0.1 * b.max()
    gap = (a - b)[bright] / np.hypot(rays.uncertainty, direct.uncertainty)[bright]
    assert np.sqrt(np.mean(gap**2)) < 1.8
