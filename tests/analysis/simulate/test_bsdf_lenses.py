"""Lenses from BSDF files: the same as what the file was made of, and the same in both engines whatever way they lie."""

from pathlib import Path

import numpy as np
import pytest

from analysis.bsdf.basis import KLEMS_FULL
from analysis.bsdf.brightest import brightest
from analysis.bsdf.disk import disk_of_square
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component
from analysis.bsdf.report import reversed_paths
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import tree_of
from analysis.bsdf.xml_write import write_bsdf
from analysis.simulate.components import Lens
from analysis.simulate.daylight import daylight
from analysis.simulate.lens import packed
from analysis.simulate.lens_file import WIDE_HALF, bright_lenses, wide_nodes
from analysis.simulate.predict import predict
from analysis.simulate.radiance import lenses
from analysis.simulate.radiance.lenses import bsdf_file, klems_file
from analysis.simulate.source import suns
from analysis.simulate.system import System, load, named
from analysis.simulate.tracer import Settings, trace
from labdaq.directions import sky_vector, vector
from labdaq.errors import ConfigError, DataError

GAMMA, C = np.arange(0.0, 86.0, 10.0), np.arange(0.0, 361.0, 30.0)
OVERCAST = daylight(90.0, 0.0, 10_000.0, 10_000.0, "overcast")


def one_way(path: Path) -> Path:
    """A file with no symmetry at all: whatever comes in leaves in one patch, 0.6 forwards and 0.3 backwards."""
    basis = KLEMS_FULL
    to = int(basis.patch_of(np.array([0.5, 0.3])))
    matrix = np.zeros((basis.size, basis.size))
    matrix[to] = 0.6 / basis.projected[to]
    write_bsdf(path, KlemsBsdf(basis, {Component.TF: matrix, Component.TB: 0.5 * matrix}))
    return path


def window(file: Path, **changes: object) -> System:
    """A hole in the roof, closed by one lens."""
    lens = Lens(kind="bsdf", bsdf=str(file))
    return System(rise_m=0.0, well_depth_m=1e-3, entry=Lens(kind="none")).replace(exit=lens).with_settings(changes)


@pytest.mark.parametrize("cache", ["fresh", "none"])
def test_a_file_is_made_once_and_leaves_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cache: str
) -> None:
    """Also where nothing can be kept."""
    home, folder, lens = tmp_path / "cache", tmp_path / "made", Lens()
    folder.mkdir()
    if cache == "none":
        home.write_text("not a folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    monkeypatch.setattr(lenses, "_traced", lambda lens, path, form: (path.write_text(str(form)), path)[1])
    first = klems_file(lens, folder)
    assert list(folder.iterdir()) == [first]
    content = first.read_bytes()
    first.unlink()
    assert klems_file(lens, folder).read_bytes() == content
    if cache == "fresh":
        assert [path.name for path in home.rglob("*.*")] == [first.name]


def test_wide_nodes_are_the_whole_hemisphere() -> None:
    down = wide_nodes(WIDE_HALF)
    assert len(down) == (2 * WIDE_HALF + 1) ** 2 and np.allclose(np.linalg.norm(down, axis=1), 1.0)
    middle = (len(down) - 1) // 2
    assert np.allclose(down[middle], [0.0, 0.0, -1.0])
    assert np.allclose(down.sum(axis=0)[:2], 0.0, atol=1e-9)


EAST, NORTH = np.sin(np.radians(40.0)) * np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0))])
"""The middle of `one_way`'s patch: rings of 35 to 45 degrees have 24 patches."""


@pytest.mark.parametrize(
    ("changes", "east", "north", "share"),
    [
        ({}, EAST, -NORTH, 0.6),  # the front is up: y is south
        ({"exit.prisms": "up"}, EAST, NORTH, 0.3),  # the back is up
        ({"exit.orientation_deg": 90.0}, NORTH, EAST, 0.6),  # counter-clockwise seen from above
        ({"exit.mirrored": True}, -EAST, -NORTH, 0.6),
        ({"rotation_deg": 180.0}, -EAST, NORTH, 0.6),
    ],
)
def test_light_leaves_where_the_file_says(
    tmp_path: Path, changes: dict[str, object], east: float, north: float, share: float
) -> None:
    system = window(one_way(tmp_path / "one.xml"), **changes)
    tally = trace(system, suns(60.0, 250.0, 1000.0), Settings(rays=50_000, distance_m=0.0))
    flux = 1000.0 * np.sin(np.radians(60.0)) * system.aperture_area_m2
    assert tally.flux()[0][0] / flux == pytest.approx(share, rel=1e-3)
    gamma, c = (a.ravel() for a in np.meshgrid(np.arange(2.5, 90.0, 5.0), np.arange(0.0, 360.0, 5.0)))
    candela = tally.intensity(gamma, c).candela[0]
    weight = candela * np.sin(np.radians(gamma))
    mean = (vector(gamma, c) * weight[:, None]).sum(axis=0) / weight.sum()
    assert mean[:2] == pytest.approx([east, north], abs=0.015)  # a patch is 0.17 wide


def swirl(path: Path) -> Path:
    """A reciprocal file: light goes on turned by 90 degrees about the normal, 0.6 of what comes along x > 0, else 0.2.

    Radiance follows rays backwards and needs reciprocity.
    """
    basis = KLEMS_FULL
    ring, n = basis.ring, np.array(basis.n_phi)[basis.ring]
    place = np.arange(basis.size) - basis.first[ring]
    turned = basis.first[ring] + (place + n // 4) % n
    share = np.where(basis.centre_xy[:, 0] > 0.0, 0.6, 0.2)
    matrix = np.zeros((basis.size, basis.size))
    matrix[turned, np.arange(basis.size)] = share / basis.projected
    one = KlemsBsdf(basis, {Component.TF: matrix})
    write_bsdf(path, KlemsBsdf(basis, {Component.TF: matrix, Component.TB: reversed_paths(one, Component.TF)}))
    return path


@pytest.mark.parametrize(
    "changes",
    [
        {"exit.orientation_deg": 40.0, "rotation_deg": 25.0},
        pytest.param({}, marks=pytest.mark.slow),
        pytest.param({"exit.prisms": "up"}, marks=pytest.mark.slow),
        pytest.param({"as": "entry"}, marks=pytest.mark.slow),
    ],
)
def test_radiance_sees_the_same_file_the_same_way(tmp_path: Path, changes: dict[str, object]) -> None:
    """A sky with one bright cap, and a lens without symmetry: flux and mean direction; as cover or as exit lens."""
    system = window(swirl(tmp_path / "swirl.xml"), **{k: v for k, v in changes.items() if k != "as"})
    if "as" in changes:
        system = system.replace(entry=system.exit, exit=Lens(kind="none"))
    cap = sky_vector(52.0, 250.0)
    day = daylight(90.0, 0.0, 10_000.0, 10_000.0, lambda v: np.where(v @ cap > np.cos(np.radians(9.0)), 1.0, 0.0))
    gamma, c = np.arange(0.0, 90.1, 5.0), np.arange(0.0, 360.1, 15.0)  # the file's patches are as wide
    means, fluxes = [], []
    for engine, options in (("tracer", {"rays": 100_000}), ("radiance", {"precision": 0.5})):
        made = predict(system, day, engine=engine, gamma_deg=gamma, c_deg=c, **options).sky  # type: ignore[arg-type]
        g, around = np.meshgrid(gamma, c[:-1])
        weight = made.candela[:-1] * np.sin(np.radians(g))
        means.append((vector(g, around) * weight[..., None]).sum(axis=(0, 1)) / weight.sum())
        fluxes.append(made.flux())
    assert np.hypot(*means[0][:2]) > 0.4  # the lens does not scatter evenly
    assert means[0][:2] == pytest.approx(means[1][:2], abs=0.03)
    assert fluxes[0] == pytest.approx(fluxes[1], rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("form", [bsdf_file, klems_file])
def test_a_box_of_files_is_the_box_they_were_made_of(tmp_path: Path, form: object) -> None:
    """Sky flux; a Klems matrix holds directions to 10 degrees, a tree to 3.6."""
    made = form(Lens(), tmp_path)  # type: ignore[operator]
    box = named("box")
    files = box.replace(entry=Lens(kind="bsdf", bsdf=str(made)), exit=Lens(kind="bsdf", bsdf=str(made), prisms="up"))
    fine = np.arange(0.0, 360.1, 5.0)  # so many directions are counted, in both
    one, two = (predict(s, OVERCAST, rays=200_000, gamma_deg=GAMMA, c_deg=fine).sky for s in (box, files))
    assert two.flux() == pytest.approx(one.flux(), rel=0.03)
    ratio = two.candela[:-1, :7].mean(axis=0) / one.candela[:-1, :7].mean(axis=0)
    assert np.allclose(ratio, 1.0, atol=0.05)


@pytest.mark.slow
def test_a_sun_through_files_reads_them_at_the_sun_itself(tmp_path: Path) -> None:
    """Tables made for the sun, and the general ones between directions of incidence."""
    made = bsdf_file(Lens(), tmp_path)
    system = named("top").replace(entry=Lens(kind="bsdf", bsdf=str(made)))
    one, two = (trace(system, suns(50.0, 130.0, 1000.0), Settings(rays=100_000, sun_samples=n)) for n in (16_384, 0))
    assert one.flux()[0] == pytest.approx(two.flux()[0], rel=0.04)  # the tree has stairs of 3.6 degrees
    plain = trace(named("top"), suns(50.0, 130.0, 1000.0), Settings(rays=100_000))
    assert one.flux()[0] == pytest.approx(plain.flux()[0], rel=0.05)


def even(path: Path, transmitted: float) -> Path:
    """Light of every direction goes on evenly to all, from both sides."""
    basis = KLEMS_FULL
    matrix = np.full((basis.size, basis.size), transmitted / np.pi)
    write_bsdf(path, KlemsBsdf(basis, {Component.TF: matrix, Component.TB: matrix}))
    return path


@pytest.mark.parametrize("share", [0.9, 1.0, 1.03, 1.5, 15.9])
@pytest.mark.parametrize("as_entry", [False, True])
def test_flux_is_in_proportion_also_above_one(tmp_path: Path, share: float, as_entry: bool) -> None:
    """Whole skylights may send on more light than falls on their hole; from table and from a table for the sun."""
    system = window(even(tmp_path / "even.xml", share))
    if as_entry:
        system = system.replace(entry=system.exit, exit=Lens(kind="none"))
    flux = 1000.0 * np.sin(np.radians(60.0)) * system.aperture_area_m2
    for samples in (0, 4096):
        tally = trace(system, suns(60.0, 250.0, 1000.0), Settings(rays=20_000, distance_m=0.0, sun_samples=samples))
        # of an entry 1 mm above the aperture 0.3 % of the lobe meet its wall; the others are exact but for rounding
        assert tally.flux()[0][0] / flux == pytest.approx(share, rel=0.006 if as_entry else 1e-4)


def test_more_light_than_arrives_is_told_and_far_more_refused(tmp_path: Path) -> None:
    assert bright_lenses(window(even(tmp_path / "even.xml", 1.019))) == ()
    (note,) = bright_lenses(window(even(tmp_path / "even.xml", 1.03)))
    assert "even.xml" in note and "1.03 times" in note
    for engine in (lambda s: trace(s, suns(50.0, 130.0), Settings(rays=8000)), bright_lenses):
        with pytest.raises(DataError, match=r"much\.xml.*front.*degrees.*20 times"):
            engine(window(even(tmp_path / "much.xml", 20.0)))
    basis = KLEMS_FULL
    rim = np.full((basis.size, basis.size), 0.2 / np.pi)
    rim[:, 140] *= 8.0  # patch 140, of the last ring of 12 that starts with 133: 82.5 degrees, phi = 7 x 30
    write_bsdf(tmp_path / "rim.xml", KlemsBsdf(basis, {Component.TF: rim / 2.0, Component.TB: rim}))
    (note,) = bright_lenses(window(tmp_path / "rim.xml"))
    assert "meets the back travelling 82.5 degrees" in note and "phi 210, 1.6 times" in note


def test_trees_are_weighed_cell_by_cell() -> None:
    """The finest cells are looked at: one of 64 sends on 1.2, the others 0.3."""
    dense = np.full((8, 8, 8, 8), 0.3 / np.pi)
    dense[6, 1] *= 4.0
    light = brightest(TensorTreeBsdf({Component.RB: tree_of(dense, 0.0)}))
    assert light.side == "back" and light.share == pytest.approx(1.2)
    x, y = disk_of_square(np.array([6.5 / 8, 1.5 / 8]))
    assert light.phi_deg == pytest.approx(np.degrees(np.arctan2(y, x)) % 360.0)
    flat = np.full((8, 8, 8), 0.3 / np.pi)
    flat[1] *= 4.0  # sines of 1 - 2 (1 to 2) / 8
    light = brightest(TensorTreeBsdf({Component.TF: tree_of(flat, 0.0)}))
    assert light.share == pytest.approx(1.2) and 0.5 < np.sin(np.radians(light.theta_deg)) < 0.75


def test_no_weight_wraps_around() -> None:
    """Tables refuse what they cannot hold, also of a sampler of somebody else's."""
    down = np.array([0.0, 0.0, -1.0])
    assert packed(down, down, np.array(1.0))[2] == 32000
    for weight in (1.03, 1e9, np.nan, np.inf):
        with pytest.raises(DataError, match="times the light"):
            packed(down, down, np.array(weight))


def test_a_system_file_names_its_lens_beside_it(tmp_path: Path) -> None:
    one_way(tmp_path / "one.xml")
    (tmp_path / "mine.toml").write_text('base = "box"\nexit.bsdf = "one.xml"\n')
    system = load(tmp_path / "mine.toml")
    assert system.exit.kind == "bsdf" and Path(system.exit.bsdf) == tmp_path / "one.xml"
    assert system.exit.prisms == "down"  # though the box's own has its prisms up
    assert trace(system, suns(50.0, 130.0), Settings(rays=8000)).flux()[0][0] > 0.0


def test_mistakes_are_named(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('base = "box"\nexit.kind = "bsdf"\n')
    with pytest.raises(ConfigError, match=r"exit.*names its file"):
        load(tmp_path / "mine.toml")
    with pytest.raises(DataError, match=r"no\.xml"):
        trace(window(tmp_path / "no.xml"), suns(50.0, 130.0), Settings(rays=8000))
    basis = KLEMS_FULL
    half = KlemsBsdf(basis, {Component.TF: np.full((basis.size, basis.size), 0.5 / np.pi)})
    write_bsdf(tmp_path / "half.xml", half)
    with pytest.raises(DataError, match="Transmission Back"):
        trace(window(tmp_path / "half.xml"), suns(50.0, 130.0), Settings(rays=8000))
