"""ABg, E2387 tables, relative intensity: what they say, and that conversions make no light and lose none."""

from pathlib import Path

import numpy as np
import pytest

from analysis.bsdf.basis import KLEMS_QUARTER, KNOWN, AngleBasis
from analysis.bsdf.convert import _mean_over, to_klems, to_tensor_tree
from analysis.bsdf.gridded import GriddedBsdf, outgoing_grid
from analysis.bsdf.harvey import AbgBsdf, AbgLobe, fit_abg
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, travel_sign, with_z
from analysis.bsdf.plots import hemisphere_image, plot_scatter
from analysis.bsdf.relative import RelativeBsdf, RelativeTable
from analysis.bsdf.report import report
from analysis.bsdf.tabulated import (
    ScatterTable,
    TabulatedBsdf,
    mirrored_phi,
    tabulate,
    travel_of_scatter,
    travel_of_source,
)
from analysis.bsdf.tally import klems_of
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import tree_of
from analysis.bsdf.tree_tally import tensor_tree_of
from analysis.bsdf.xml_read import parse_bsdf
from analysis.bsdf.xml_write import render_bsdf
from labdaq.errors import DataError

BOOT = AbgBsdf({Component.RF: AbgLobe.of(a=0.02, b=0.02, g=1.8)})
"""A glossy white like the report's boot: a broad peak about the mirror ray."""


def angles(theta_deg: float, phi_deg: float = 0.0) -> np.ndarray:
    t, p = np.radians(theta_deg), np.radians(phi_deg)
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p)])


def test_abg_is_the_formula() -> None:
    incident, outgoing = angles(30), angles(30) + np.array([0.1, 0.05])
    expected = 0.02 / (0.02 + np.hypot(0.1, 0.05) ** 1.8)
    assert BOOT.evaluate(Component.RF, incident, outgoing) == pytest.approx(expected)
    assert BOOT.evaluate(Component.TF, incident, outgoing) == 0


@pytest.mark.parametrize("g", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("b", [1e-4, 0.1])
def test_abg_integral_at_normal_incidence(g: float, b: float) -> None:
    """Rings about the normal: 2 pi times the integral of A r / (B + r^g), in closed form for g = 0 and 2."""
    lobe = AbgBsdf({Component.RF: AbgLobe.of(a=0.01, b=b, g=g)})
    r = np.concatenate([[0], np.geomspace(1e-7, 1, 200_001)])
    f = 2 * np.pi * 0.01 * r / (b + r**g)
    numeric = float(((f[1:] + f[:-1]) / 2 * np.diff(r)).sum())
    assert lobe.hemispherical(Component.RF, np.zeros(2)) == pytest.approx(numeric, rel=2e-3)
    if g == 2:
        assert numeric == pytest.approx(np.pi * 0.01 * np.log(1 + 1 / b), rel=1e-4)


@pytest.mark.parametrize("across", [0.3, 1.0])
def test_abg_integral_at_an_angle(across: float) -> None:
    lobe = AbgBsdf({Component.RF: AbgLobe.of(a=0.02, b=0.02, g=1.8, across=across)})
    for theta in (20, 60, 85):
        grid = lobe.evaluate(Component.RF, angles(theta, 40), outgoing_grid(600)).mean() * np.pi
        assert lobe.hemispherical(Component.RF, angles(theta, 40)) == pytest.approx(grid, rel=5e-3)


def test_abg_rays_follow_the_lobe() -> None:
    lobes = {
        Component.TF: AbgLobe.of(a=0.05, b=0.01, g=2.0, specular=0.2),
        Component.RF: AbgLobe.of(a=0.02, b=0.02, g=1.8, across=0.5),
    }
    bsdf = AbgBsdf(lobes)
    incident = angles(35, 20)
    m = 60_000
    out, weights = bsdf("front", with_z(incident[None], 1.0), m, np.random.default_rng(0))
    shares = [float(bsdf.hemispherical(c, incident)) for c in (Component.TF, Component.RF)]
    assert weights == pytest.approx(np.full((1, m), sum(shares)))
    through = out[0, :, 2] > 0
    assert through.mean() == pytest.approx(shares[0] / sum(shares), abs=5 * 0.5 / np.sqrt(m))
    straight = through & (np.abs(out[0, :, :2] - incident).max(axis=1) < 1e-12)
    assert straight.mean() == pytest.approx(0.2 / sum(shares), abs=5 * 0.5 / np.sqrt(m))
    for component, rows in ((Component.TF, through & ~straight), (Component.RF, ~through)):
        patch = KLEMS_QUARTER.patch_of(out[0, rows, :2])
        got = np.bincount(patch, minlength=41) / m * sum(shares)
        grid = outgoing_grid(600)
        values = bsdf.evaluate(component, incident, grid)
        want = np.bincount(KLEMS_QUARTER.patch_of(grid), weights=values, minlength=41) * np.pi / 600**2
        sigma = np.sqrt(want * sum(shares) / m)
        # the grid of 600 x 600 itself is off by some 0.5 % near the peak
        assert (np.abs(got - want) < 5 * sigma + 0.006 * want).all()


def test_abg_parameters_follow_the_angle() -> None:
    lobe = AbgLobe.of(a=[0.01, 0.04], b=[0.01, 0.04], g=[1, 2], theta_deg=[0, 60], specular=[0.5, 0.9])
    a, b, g, _, specular = lobe.at(np.sin(np.radians(30)))
    assert (float(a), float(b)) == pytest.approx((0.02, 0.02))  # logarithmic
    assert (float(g), float(specular)) == pytest.approx((1.5, 0.7))
    assert float(lobe.at(np.array(1.0))[0]) == pytest.approx(0.04)
    for wrong in ({"b": 0.0}, {"a": -1.0}, {"specular": 1.1}, {"theta_deg": [10, 5], "a": [1, 1]}):
        with pytest.raises(DataError, match="ABg"):
            AbgLobe.of(**({"a": 0.1, "b": 0.1, "g": 1.0} | wrong))


def test_abg_fit_finds_the_parameters() -> None:
    d = np.geomspace(1e-3, 1, 60)
    rng = np.random.default_rng(1)
    values = 0.03 / (0.004 + d**2.2) * np.exp(0.02 * rng.standard_normal(60))
    a, b, g = fit_abg(d, values)
    assert (a, b, g) == pytest.approx((0.03, 0.004, 2.2), rel=0.05)
    with pytest.raises(DataError, match="at least four"):
        fit_abg([0, 1, 2], [1, 1, 1])


def test_e2387_axes() -> None:
    """Mirror and straight rays keep their x and y in our frame, on both sides."""
    for side in ("front", "back"):
        incident = travel_of_source(40.0, 70.0, side)
        mirror = travel_of_scatter(40.0, 250.0, side)
        assert mirror == pytest.approx(incident)
    # a source above the front at phi = 90 (YB, our -y) sends light towards our +y
    assert travel_of_source(30.0, 90.0) == pytest.approx([0, 0.5], abs=1e-12)
    assert travel_of_source(30.0, 90.0, "back") == pytest.approx([0, -0.5], abs=1e-12)


THETA_I, THETA_S, PHI_S = np.arange(0, 90, 10.0), np.linspace(0, 90, 46), np.linspace(0, 360, 73)


@pytest.mark.parametrize("component", [Component.RF, Component.RB])
def test_an_isotropic_table_stands_for_its_source(component: Component) -> None:
    source = AbgBsdf({component: AbgLobe.of(a=0.05, b=0.05, g=2.0)})
    table = tabulate(source, component, THETA_I, 0.0, THETA_S, PHI_S)
    assert table.values.shape == (9, 1, 46, 73)
    bsdf = TabulatedBsdf({component: table})
    rng = np.random.default_rng(2)
    incident = np.stack([angles(t, p) for t, p in zip(rng.uniform(0, 78, 200), rng.uniform(0, 360, 200), strict=True)])
    outgoing = outgoing_grid(60)[rng.integers(0, 3600, 200)]
    got, want = bsdf.evaluate(component, incident, outgoing), source.evaluate(component, incident, outgoing)
    # bilinear on 2 x 5 degrees; where the shift leaves the disc the edge stands in
    assert np.quantile(np.abs(got / want - 1), 0.9) < 0.06
    assert np.median(np.abs(got / want - 1)) < 0.02


def test_following_the_mirror_ray_keeps_a_peak_a_peak() -> None:
    """Half-way between two incident angles a plain mean shows two half peaks; the shifted one shows one."""
    source = AbgBsdf({Component.RF: AbgLobe.of(a=0.002, b=0.002, g=2.0)})
    table = tabulate(
        source, Component.RF, np.arange(0, 90, 20.0), 0.0, np.linspace(0, 90, 181), np.linspace(0, 360, 145)
    )
    incident = angles(30)
    along = np.stack([angles(t) for t in np.linspace(15, 45, 121)])
    follows = TabulatedBsdf({Component.RF: table}).evaluate(Component.RF, incident, along)
    fades = TabulatedBsdf({Component.RF: table}, follow_mirror=False).evaluate(Component.RF, incident, along)
    assert abs(np.linspace(15, 45, 121)[follows.argmax()] - 30) < 0.5
    assert follows.max() == pytest.approx(1.0, rel=0.1)
    assert fades[60] < 0.2


def test_an_anisotropic_table() -> None:
    """Values that depend on the azimuth of incidence alone."""
    phi_i = np.linspace(0, 360, 13)
    values = np.broadcast_to((1 + np.cos(np.radians(phi_i)))[None, :, None, None], (2, 13, 2, 2)).copy()
    table = ScatterTable(np.array([0.0, 80]), phi_i, np.array([0.0, 90]), np.array([0.0, 360]), values)
    bsdf = TabulatedBsdf({Component.TF: table})
    for phi in (0.0, 60.0, 180.0, 300.0):
        travel = travel_of_source(40.0, phi)
        assert bsdf.evaluate(Component.TF, travel, np.zeros(2)) == pytest.approx(1 + np.cos(np.radians(phi)))


def test_half_tables_are_mirrored() -> None:
    phi, values = mirrored_phi(np.array([0.0, 60, 120, 180]), np.arange(4.0)[None, None, None], axis=3)
    assert list(phi) == [0, 60, 120, 180, 240, 300, 360]
    assert list(values.ravel()) == [0, 1, 2, 3, 2, 1, 0]
    with pytest.raises(DataError, match="0 to 180"):
        mirrored_phi(np.array([0.0, 90]), np.ones((1, 1, 1, 2)), axis=3)


def test_bad_tables_name_all_mistakes() -> None:
    with pytest.raises(DataError) as caught:
        ScatterTable(
            np.array([0.0, 100]), np.array([0.0, 90]), np.array([10.0, 5]), np.array([0.0, 360]), np.ones((1, 1))
        )
    for name in ("theta_i", "phi_i", "theta_s", "values"):
        assert name in str(caught.value)


def lti(half: bool = False) -> RelativeBsdf:
    """A lobe of exp(-(theta / 12 degrees)^2) about the straight ray plus a base, in arbitrary units."""
    theta_m, phi_m = np.arange(0, 181, 3.0), np.linspace(0, 180 if half else 360, 13)
    shape = 700 * np.exp(-((theta_m / 12) ** 2))[:, None] + 30 * np.ones(13)
    intensity = np.broadcast_to(shape, (10, *shape.shape)).copy()
    table = RelativeTable(np.arange(0, 91, 10.0), theta_m, phi_m, intensity, np.linspace(0.8, 0.1, 10))
    return RelativeBsdf({Component.TF: table, Component.RB: table})


def test_relative_intensity_gets_its_size_from_the_sphere() -> None:
    bsdf = lti()
    for theta in (0.0, 25.0, 50.0):
        incident = angles(theta, 110)
        wanted = float(np.interp(theta, np.arange(0, 91, 10), np.linspace(0.8, 0.1, 10)))
        assert bsdf.hemispherical(Component.TF, incident) == pytest.approx(wanted)
        grid = bsdf.evaluate(Component.TF, incident, outgoing_grid(128)).mean() * np.pi
        assert grid == pytest.approx(wanted, rel=1e-9)
        peak = outgoing_grid(128)[(bsdf.evaluate(Component.TF, incident, outgoing_grid(128))
                                   * with_z(outgoing_grid(128), 1.0)[:, 2]).argmax()]  # fmt: skip
        assert np.hypot(*(peak - incident)) < 0.03
    assert bsdf.evaluate(Component.RF, angles(10), angles(10)) == 0


def test_doubling_the_relative_intensity_changes_nothing() -> None:
    table = lti().tables[Component.TF]
    double = RelativeTable(
        table.theta_i_deg, table.theta_m_deg, table.phi_m_deg, 2 * table.intensity, table.hemispherical
    )
    a, b = angles(30, 10), outgoing_grid(20)
    assert RelativeBsdf({Component.TF: double}).evaluate(Component.TF, a, b) == pytest.approx(
        lti().evaluate(Component.TF, a, b)
    )


def test_phi_about_the_ray() -> None:
    """phi_m = 0 is away from the normal, 180 towards it, 90 to the left of who looks along the ray."""
    theta_m, phi_m = np.arange(0, 181, 5.0), np.arange(0, 361, 30.0)

    def towards(phi: float) -> RelativeBsdf:
        bump = np.exp(-(((theta_m[:, None] - 20) / 6) ** 2) - (((phi_m - phi + 180) % 360 - 180) / 40) ** 2)
        tables = RelativeTable(np.array([0.0, 90]), theta_m, phi_m, np.stack([bump, bump]), np.array([0.5, 0.5]))
        return RelativeBsdf({Component.TF: tables})

    grid = outgoing_grid(128)
    incident = angles(40)

    def centre(phi: float) -> np.ndarray:
        values = towards(phi).evaluate(Component.TF, incident, grid) * with_z(grid, 1.0)[:, 2]
        return grid[values.argmax()]

    assert centre(0.0)[0] > incident[0] + 0.15
    assert centre(180.0)[0] < incident[0] - 0.15
    # the ray runs along +x and +z; with the normal (+z) overhead, +y is to the left
    assert centre(90.0)[1] > 0.15
    half = lti(half=True)
    mirrored = half.evaluate(Component.TF, incident, grid * np.array([1.0, -1.0]))
    assert half.evaluate(Component.TF, incident, grid) == pytest.approx(mirrored)


def test_relative_tables_are_checked() -> None:
    table = lti().tables[Component.TF]
    with pytest.raises(DataError, match=r"(?s)intensity.*phi_m_deg.*hemispherical"):
        RelativeTable(table.theta_i_deg, table.theta_m_deg, table.phi_m_deg / 4, table.intensity[:2], np.full(10, 1.5))
    dark = RelativeTable(
        table.theta_i_deg, table.theta_m_deg, table.phi_m_deg, 0 * table.intensity, table.hemispherical
    )
    with pytest.raises(DataError, match="no relative intensity"):
        RelativeBsdf({Component.TF: dark}).evaluate(Component.TF, angles(10), angles(20))


SOURCES = {
    "abg": AbgBsdf({Component.RF: AbgLobe.of(a=0.05, b=0.06, g=2.0), Component.TF: AbgLobe.of(0.02, 0.1, 1.5)}),
    "table": TabulatedBsdf({Component.RF: tabulate(BOOT, Component.RF, THETA_I, 0, THETA_S, PHI_S)}),
    "relative": lti(),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "each"),
    [("abg", 2), ("table", 1), *(pytest.param(name, 2, marks=pytest.mark.slow) for name in ("table", "relative"))],
)
def test_conversions_conserve_energy(name: str, each: int) -> None:
    source = SOURCES[name]
    klems = to_klems(source, KLEMS_QUARTER, incident=each, outgoing=15)
    axis = (np.arange(each) + 0.5) / each
    u, v = (x.ravel() for x in np.meshgrid(axis, axis, indexing="ij"))
    for component in source.components():
        per_patch = [
            source.hemispherical(component, KLEMS_QUARTER.sample(np.full(each**2, i), u, v)).mean() for i in range(41)
        ]
        assert klems.hemispherical_by_patch(component) == pytest.approx(per_patch, rel=1e-9)
    assert set(klems.components()) == set(source.components())


def test_klems_to_tree_and_back() -> None:
    """A constant patch becomes constant cells; what a cell mixes, it mixes without losing light."""
    klems = to_klems(SOURCES["abg"], KLEMS_QUARTER, incident=2, outgoing=15)
    tree = to_tensor_tree(klems, depth=4, cull_percent=0)
    back = to_klems(tree, KLEMS_QUARTER, incident=3, outgoing=15)
    for component in klems.components():
        # hemispherical values jump at the edges of patches and cells, which meet them with 24 x 24 directions
        assert back.diffuse(component) == pytest.approx(klems.diffuse(component), rel=0.004)
        # cells of the tree straddle the edges of patches: the lobe blurs, by a quarter where it is sharpest
        assert (
            np.abs(back.matrices[component] - klems.matrices[component]).max() < 0.35 * klems.matrices[component].max()
        )


@pytest.mark.parametrize(
    "basis", [pytest.param(b, id=n, marks=pytest.mark.slow if n.endswith("4x") else ()) for n, b in KNOWN.items()]
)
def test_every_basis_can_be_made_written_and_read(basis: AngleBasis) -> None:
    """Without a word about samples, and no light is lost."""
    source = to_klems(SOURCES["abg"], KLEMS_QUARTER, incident=1, outgoing=5)
    source = KlemsBsdf(source.basis, {Component.RF: source.matrices[Component.RF]})
    made = to_klems(source, basis)
    back = parse_bsdf(render_bsdf(made)).bsdf
    assert isinstance(back, KlemsBsdf) and back.basis == basis
    assert np.allclose(back.matrices[Component.RF], made.matrices[Component.RF], rtol=1e-6, atol=0)
    # rings of one basis end within patches of the other, which meet them with 24 x 24 directions
    assert made.diffuse(Component.RF) == pytest.approx(source.diffuse(Component.RF), rel=0.004)


def test_conversions_look_values_up_as_evaluate_does() -> None:
    """Klems matrices and trees of rank 4 have ways of their own."""
    rng = np.random.default_rng(5)
    klems = KlemsBsdf(KLEMS_QUARTER, {Component.TF: rng.random((41, 41)) * 0.3})
    tree = TensorTreeBsdf({Component.TF: tree_of(rng.random((8,) * 4) * 0.3, 50.0)})
    out, incident = outgoing_grid(40), np.stack([angles(20, 30), angles(50, 200)])
    for bsdf in (klems, tree):
        wanted = bsdf.evaluate(Component.TF, incident[:, None], out).mean(axis=0)
        assert _mean_over(bsdf, out)(Component.TF, incident) == pytest.approx(wanted)


def test_a_tree_of_rank_3_holds_an_isotropic_lobe() -> None:
    source = SOURCES["abg"]
    tree = to_tensor_tree(source, rank=3, depth=5, cull_percent=0)
    incident = np.stack([angles(t, p) for t in (5, 30, 55) for p in (0, 77, 200)])
    for component in source.components():
        assert tree.hemispherical(component, incident) == pytest.approx(
            source.hemispherical(component, incident),
            rel=0.05,  # a cell is 1/16 of the sine of incidence wide
        )
        outgoing = incident + 0.1
        ratio = tree.evaluate(component, incident, outgoing) / source.evaluate(component, incident, outgoing)
        assert ratio == pytest.approx(np.ones(9), abs=0.35)  # cells 1/32 wide on a slope of this lobe


def test_too_sharp_for_the_grid_is_refused_and_can_be_traced() -> None:
    mirror = AbgBsdf({Component.RF: AbgLobe.of(a=1e-7, b=1e-9, g=2.4, specular=0.5)})
    with pytest.raises(DataError, match="too sharp"):
        to_klems(mirror, KLEMS_QUARTER, outgoing=15)
    rng = np.random.default_rng(3)
    traced = klems_of(mirror, rng, basis=KLEMS_QUARTER, rays=500, samples=20, incidences=("front",))
    expected = [float(mirror.hemispherical(Component.RF, KLEMS_QUARTER.centre_xy[i])) for i in range(41)]
    assert traced.hemispherical_by_patch(Component.RF) == pytest.approx(expected, rel=0.05)
    share = np.diag(traced.matrices[Component.RF]) * KLEMS_QUARTER.projected
    assert (share > 0.5).all()  # the mirror ray stays in its patch
    tree = tensor_tree_of(mirror, rng, depth=3, rays=100, samples=10, incidences=("front",))
    assert tree.hemispherical(Component.RF, angles(20)) == pytest.approx(float(expected[5]), rel=0.2)


def test_gridded_rays_follow_the_values() -> None:
    bsdf = lti()
    assert isinstance(bsdf, GriddedBsdf)
    incident = angles(30, 45)
    m = 40_000
    out, weights = bsdf("front", with_z(incident[None], travel_sign("front")), m, np.random.default_rng(4))
    total = float(bsdf.hemispherical(Component.TF, incident))
    assert weights == pytest.approx(np.full((1, m), total))
    got = np.bincount(KLEMS_QUARTER.patch_of(out[0, :, :2]), minlength=41) / m
    grid = outgoing_grid(128)
    want = np.bincount(KLEMS_QUARTER.patch_of(grid), weights=bsdf.evaluate(Component.TF, incident, grid), minlength=41)
    want /= want.sum()
    assert (np.abs(got - want) < 5 * np.sqrt(want / m) + 0.02 * want + 1e-4).all()


def test_a_true_bsdf_passes_the_report() -> None:
    """ABg with equal parameters at all angles is symmetric in incident and outgoing direction."""
    laws = report(to_klems(SOURCES["abg"], KLEMS_QUARTER, incident=2))
    assert laws.problems(reciprocity=0.01) == []


def test_plots(tmp_path: Path) -> None:
    klems = KlemsBsdf(KLEMS_QUARTER, {Component.TF: np.full((41, 41), 0.5 / np.pi)})
    image = hemisphere_image(klems, Component.TF, np.zeros(2), 64)
    assert np.nanmean(image) == pytest.approx(0.5 / np.pi)
    assert np.isnan(image[0, 0])
    for name in ("x.svg", "x.png"):
        plot_scatter(tmp_path / name, SOURCES["abg"], Component.RF, (0, 40), 30.0, pixels=48)
        assert (tmp_path / name).stat().st_size > 2000
