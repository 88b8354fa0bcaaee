"""Klems bases and matrices, and the laws a BSDF must keep."""

import numpy as np
import pytest

from analysis.bsdf.basis import KLEMS_2X, KLEMS_4X, KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, OLD_HALF, AngleBasis
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, component_of, with_z
from analysis.bsdf.prism import PrismSheet, prism_tracer
from analysis.bsdf.report import made_reciprocal, report
from analysis.bsdf.tally import klems_of
from labdaq.errors import DataError

BASES = [KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, KLEMS_2X, KLEMS_4X, OLD_HALF]


def lambertian(part: float, basis: AngleBasis = KLEMS_FULL) -> np.ndarray:
    return np.full((basis.size, basis.size), part / np.pi)


def pane(transmittance: float, basis: AngleBasis = KLEMS_FULL) -> np.ndarray:
    return np.diag(transmittance / basis.projected)


@pytest.mark.parametrize("basis", BASES, ids=lambda b: f"{b.size}")
def test_a_basis_covers_the_hemisphere(basis: AngleBasis) -> None:
    assert basis.projected.sum() == pytest.approx(np.pi)
    rng = np.random.default_rng(0)
    radius, phi = np.sqrt(rng.random(200_000)), 2 * np.pi * rng.random(200_000)
    patches = basis.patch_of(np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1))
    share = np.bincount(patches, minlength=basis.size) / len(patches)
    expected = basis.projected / np.pi
    z = (share - expected) / np.sqrt(expected / len(patches))
    assert np.abs(z).max() < 5  # five standard errors of a count
    assert (basis.patch_of(basis.centre_xy) == np.arange(basis.size)).all()
    assert basis.centre_xy[basis.opposite] == pytest.approx(-basis.centre_xy)
    u, v = rng.random((2, basis.size))
    inside = basis.sample(np.arange(basis.size), u, v)
    assert (basis.patch_of(inside) == np.arange(basis.size)).all()


def test_counts() -> None:
    assert [b.size for b in BASES] == [145, 77, 41, 581, 2321, 73]
    with pytest.raises(ValueError, match="increase"):
        AngleBasis("x", (0, 30, 20, 90), (1, 2, 3))
    with pytest.raises(ValueError, match="cover 0 to 90"):
        AngleBasis("x", (0, 80), (1,))


def test_ideal_matrices_keep_the_laws() -> None:
    clear = KlemsBsdf(KLEMS_FULL, {Component.TF: pane(0.9), Component.TB: pane(0.9)})
    assert clear.diffuse(Component.TF) == pytest.approx(0.9)
    assert report(clear).problems() == []
    matt = KlemsBsdf(
        KLEMS_FULL,
        {
            Component.TF: lambertian(0.4), Component.TB: lambertian(0.4),
            Component.RF: lambertian(0.6), Component.RB: lambertian(0.6),
        },
    )  # fmt: skip
    laws = report(matt)
    assert laws.total_front == pytest.approx(np.ones(145))
    assert laws.furnace_back == pytest.approx(np.ones(145))
    assert all(pair.weighted == pytest.approx(0) for pair in laws.reciprocity)


def test_broken_laws_are_named() -> None:
    bright = KlemsBsdf(KLEMS_FULL, {Component.TF: lambertian(0.8), Component.RF: lambertian(0.3)})
    assert any("light from the front" in text and "1.1000" in text for text in report(bright).problems())
    one_way = KlemsBsdf(KLEMS_FULL, {Component.TF: lambertian(0.8), Component.TB: lambertian(0.1)})
    assert any("not reciprocal" in text for text in report(one_way).problems())
    rng = np.random.default_rng(1)
    noisy = KlemsBsdf(KLEMS_FULL, {c: lambertian(0.4) * rng.uniform(0.5, 1.5, (145, 145)) for c in Component})
    assert len(report(noisy).problems(reciprocity=0.05)) == 3
    assert all(pair.weighted < 1e-12 for pair in report(made_reciprocal(noisy)).reciprocity)


def test_reciprocity_is_paths_walked_backwards() -> None:
    """Element by element, for matrices without any symmetry: f(i -> o) = f'(-o -> -i)."""
    rng = np.random.default_rng(7)
    forward = rng.random((41, 41)) / 4
    backward = np.empty((41, 41))
    centre = KLEMS_QUARTER.centre_xy
    opposite = [int(np.abs(centre + xy).sum(axis=1).argmin()) for xy in centre]
    for o in range(41):
        for i in range(41):
            backward[opposite[i], opposite[o]] = forward[o, i]
    bsdf = KlemsBsdf(KLEMS_QUARTER, {Component.TF: forward, Component.TB: backward})
    assert report(bsdf).reciprocity[0].weighted == pytest.approx(0, abs=1e-12)
    turned = KlemsBsdf(KLEMS_QUARTER, {Component.TF: forward, Component.TB: forward.T})
    assert report(turned).reciprocity[0].weighted > 0.1


def test_a_transposed_matrix_is_caught() -> None:
    """A lens that sends everything to one side: transposed, it breaks the balance of energy."""
    matrix = np.zeros((145, 145))
    matrix[137] = 0.9 / KLEMS_FULL.projected[137]
    right = KlemsBsdf(KLEMS_FULL, {Component.TF: matrix})
    assert report(right).total_front == pytest.approx(np.full(145, 0.9))
    assert report(right).furnace_back.max() > 10  # such a thing cannot be, and the furnace says so
    wrong = KlemsBsdf(KLEMS_FULL, {Component.TF: matrix.T})
    assert report(wrong).total_front.max() > 10


def test_malformed_matrices_are_refused() -> None:
    with pytest.raises(DataError, match="145 patches"):
        KlemsBsdf(KLEMS_FULL, {Component.TF: np.zeros((144, 145))})
    with pytest.raises(DataError, match="negative"):
        KlemsBsdf(KLEMS_FULL, {Component.TF: -lambertian(1)})
    with pytest.raises(DataError, match="at least one"):
        KlemsBsdf(KLEMS_FULL, {})


def test_tracing_a_matrix_gives_the_matrix_back() -> None:
    rng = np.random.default_rng(2)
    truth = KlemsBsdf(
        KLEMS_QUARTER,
        {c: rng.random((41, 41)) ** 6 * (0.6 if c.transmits else 0.3) for c in Component},
    )  # fmt: skip
    rays = 20_000
    again = klems_of(truth, rng, basis=KLEMS_QUARTER, rays=rays, samples=20)
    for component in Component:
        # energy is exact: every ray of a patch carries the patch's total
        both = [again.hemispherical_by_patch(c) for c in Component if c.incidence == component.incidence]
        want = [truth.hemispherical_by_patch(c) for c in Component if c.incidence == component.incidence]
        assert sum(both) == pytest.approx(sum(want), rel=1e-12)
        part = truth.matrices[component] * truth.basis.projected[:, None]
        total = sum(want)
        sigma = np.sqrt(part * total / rays) / truth.basis.projected[:, None]
        many = part / total * rays > 30  # where a count of rays is nearly normal
        z = (again.matrices[component] - truth.matrices[component])[many] / sigma[many]
        assert many.sum() > 300
        assert np.abs(z).max() < 6


def test_a_pane_keeps_directions() -> None:
    clear = KlemsBsdf(KLEMS_FULL, {Component.TF: pane(0.9), Component.RF: pane(0.1)})
    xy = KLEMS_FULL.centre_xy[[0, 30, 140]]
    out, weights = clear("front", with_z(xy, 1.0), 200, np.random.default_rng(0))
    assert weights == pytest.approx(np.ones((3, 200)))
    assert (KLEMS_FULL.patch_of(out[..., :2]) == np.array([0, 30, 140])[:, None]).all()
    assert (out[..., 2] > 0).mean() == pytest.approx(0.9, abs=0.05)


@pytest.mark.parametrize("absorption", [0.0, 0.03])
def test_the_prismatic_sheet_keeps_the_laws(absorption: float) -> None:
    sheet = PrismSheet(absorption_per_mm=absorption)
    traced = klems_of(prism_tracer(sheet), np.random.default_rng(3), rays=4000)
    laws = report(traced)
    if absorption == 0:
        assert laws.total_front == pytest.approx(np.ones(145))
        assert laws.total_back == pytest.approx(np.ones(145))
        # reciprocity makes the furnace even: 145 x 4000 rays, each patch collects about 4000 of them
        assert np.abs(laws.furnace_front - 1).max() < 0.06
        assert np.abs(laws.furnace_back - 1).max() < 0.07
    else:
        assert max(laws.total_front.max(), laws.total_back.max()) < 1
    assert laws.diffuse[Component.TF] == pytest.approx(laws.diffuse[Component.TB], abs=0.004)


def test_noise_in_reciprocity_falls_with_the_root_of_the_rays() -> None:
    """So what is left at few rays is noise, not a law that is broken."""
    apart = []
    for rays in (500, 8000):
        traced = klems_of(prism_tracer(PrismSheet()), np.random.default_rng(4), basis=KLEMS_QUARTER, rays=rays)
        apart.append(report(traced).reciprocity[0].weighted)
    assert apart[1] == pytest.approx(apart[0] / 4, rel=0.25)


def test_the_cross_is_in_the_matrix() -> None:
    """Report, A.1 and figures 38, 40: normal light makes a cross along the facets, and none between its arms."""
    sheet = PrismSheet(slope_error_deg=2.0)
    traced = klems_of(prism_tracer(sheet), np.random.default_rng(5), rays=20_000, incidences=("front",))
    straight = traced.matrices[Component.TF][:, 0] * KLEMS_FULL.projected
    phi = np.degrees(np.arctan2(KLEMS_FULL.centre_xy[:, 1], KLEMS_FULL.centre_xy[:, 0])) % 90
    ring = KLEMS_FULL.ring == 2  # 15 to 25 degrees; the arms lie at 15.6
    arm, between = np.minimum(phi, 90 - phi) < 1, np.abs(phi - 45) < 1
    assert straight[ring & arm].min() > 0.08
    assert straight[ring & between].max() < 1e-3
    assert straight[0] < 1e-3  # no undeviated beam


def test_components_know_each_other() -> None:
    for component in Component:
        assert component_of(component.incidence, component.transmits) is component
        assert component.reciprocal.reciprocal is component
    assert Component.TF.reciprocal is Component.TB
    assert Component.RF.reciprocal is Component.RF
