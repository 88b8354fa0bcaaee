"""Tensor trees: as data, as text, as BSDFs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.bsdf.basis import KLEMS_QUARTER
from analysis.bsdf.disk import disk_of_square, square_of_disk
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, with_z
from analysis.bsdf.prism import PrismSheet, prism_tracer
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import tree_of
from analysis.bsdf.tree_tally import reciprocal_mean, tensor_tree_of
from analysis.bsdf.tree_text import parse_tree, render_tree
from labdaq.errors import DataError


@given(st.floats(0, 1), st.floats(0, 1))
def test_square_and_disc(a: float, b: float) -> None:
    point = np.array([a, b])
    disc = disk_of_square(point)
    assert np.hypot(*disc) <= 1 + 1e-12
    assert square_of_disk(disc) == pytest.approx(point, abs=1e-9)


def test_the_disc_keeps_areas() -> None:
    axis = (np.arange(400) + 0.5) / 400
    disc = disk_of_square(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))
    for radius in (0.2, 0.5, 0.9):
        assert (np.hypot(*disc.T) < radius).mean() == pytest.approx(radius**2, abs=2e-3)
    assert (np.arctan2(disc[:, 1], disc[:, 0]) < 1.0).mean() == pytest.approx(0.5 + 1 / (2 * np.pi), abs=2e-3)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([(3, 1), (3, 3), (4, 1), (4, 2)]), st.integers(0, 10**6), st.sampled_from([0, 50, 90]))
def test_any_tree_round_trips_through_text(form: tuple[int, int], seed: int, cull: int) -> None:
    rank, depth = form
    rng = np.random.default_rng(seed)
    dense = np.where(rng.random((2**depth,) * rank) < 0.5, 0.25, rng.random((2**depth,) * rank))
    tree = tree_of(dense, cull)
    if cull == 0:
        assert tree.dense(depth) == pytest.approx(dense)
    assert tree.dense(depth).mean() == pytest.approx(dense.mean())
    again = parse_tree(render_tree(tree), rank)
    places = rng.random((200, rank))
    assert again.values(places) == pytest.approx(tree.values(places), rel=1e-6)


def test_slices_are_what_values_say() -> None:
    rng = np.random.default_rng(1)
    tree = tree_of(rng.random((4,) * 4) ** 3, 60)
    for fixed in rng.random((10, 2)):
        corner, size, value = tree.slice(fixed)
        assert (size**2).sum() == pytest.approx(1)
        inside = corner + size[:, None] * rng.random((len(size), 2))
        points = np.concatenate([np.tile(fixed, (len(size), 1)), inside], axis=1)
        assert tree.values(points) == pytest.approx(value)


def test_grids_and_branches_have_the_order_of_radiance() -> None:
    """In a grid the last dimension runs fastest; branch bit 0 is the first dimension."""
    grid = parse_tree("{ 0 1 2 3 4 5 6 7 }", 3)
    assert grid.values(np.array([0.1, 0.1, 0.9])) == 1
    assert grid.values(np.array([0.9, 0.1, 0.1])) == 4
    nested = parse_tree("{ {0} {1} {2} {3} {4} {5} {6} {7} }", 3)
    assert nested.values(np.array([0.9, 0.1, 0.1])) == 1
    assert nested.values(np.array([0.1, 0.1, 0.9])) == 4
    deep = parse_tree("{ " + " ".join(str(i) for i in range(64)) + " }", 3)
    assert deep.values(np.array([0.3, 0.6, 0.9])) == 16 * 1 + 4 * 2 + 3


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "there is no tree"),
        ("{ 1 2 3 }", "line 5: 3 values in a node; 1, 8, 64"),
        ("{ }", "0 values"),
        ("{ {1} {2} }", "2 branches instead of 8"),
        ("{ 1 ", "ends within its braces"),
        ("{ 1 } }", "a brace closes"),
        ("{ 1 } { 2 }", "a second tree"),
        ("{ 1 } 2", "text after"),
        ("3 { 1 }", "outside the braces"),
        ("{\n{1}\n 5 {2} }", "line 6: values beside nested nodes"),
        ("{ one }", "not a number"),
        ("{ nan }", "not finite"),
    ],
)
def test_malformed_trees(text: str, reason: str) -> None:
    with pytest.raises(DataError, match=reason):
        parse_tree(text, 3, "x", first_line=5)


def test_a_lambertian_tree() -> None:
    bsdf = TensorTreeBsdf({Component.TF: tree_of(np.full((2,) * 4, 0.6 / np.pi))})
    xy = np.array([[0.0, 0.0], [0.5, -0.3]])
    assert bsdf.hemispherical(Component.TF, xy) == pytest.approx([0.6, 0.6])
    assert bsdf.hemispherical(Component.RF, xy) == pytest.approx([0, 0])
    out, weights = bsdf("front", with_z(xy, 1.0), 20_000, np.random.default_rng(0))
    assert weights == pytest.approx(np.full((2, 20_000), 0.6))
    assert (out[..., 2] ** 2).mean() == pytest.approx(0.5, abs=0.006)  # cosine squared under Lambert: 1/2
    assert np.abs(out[..., :2].mean(axis=1)).max() < 0.015


def test_tracing_a_tree_gives_its_values() -> None:
    rng = np.random.default_rng(3)
    trees = {c: tree_of(reciprocal_mean(rng.random((4,) * 4)) * 0.3, 0) for c in Component}
    truth = TensorTreeBsdf(trees)
    rays = 8000
    again = tensor_tree_of(truth, rng, depth=2, rays=rays, samples=100, cull_percent=0)
    for component in Component:
        got, want = again.trees[component].dense(2), trees[component].dense(2)
        # a value v over a cell of pi/16 takes the part v pi/16 / W of the rays, W the part of the light that goes on;
        # W is about 0.94 here (two components of mean 0.15), and for reflections the mean of two counts is compared
        sigma = np.sqrt(want * 0.94 / (rays * np.pi / 16) / (1 if component.transmits else 2))
        z = (got - want) / sigma
        assert np.sqrt((z**2).mean()) == pytest.approx(1, abs=0.2)
        assert got.mean() == pytest.approx(want.mean(), rel=0.01)


def test_an_isotropic_tree_turns_with_the_light() -> None:
    rng = np.random.default_rng(4)
    bsdf = TensorTreeBsdf({Component.TF: tree_of(rng.random((8,) * 3), 0)})
    incident, outgoing = np.array([0.4, 0.1]), rng.uniform(-0.6, 0.6, (50, 2))
    c, s = np.cos(1.1), np.sin(1.1)
    spin = np.array([[c, s], [-s, c]])
    first = bsdf.evaluate(Component.TF, incident, outgoing)
    assert bsdf.evaluate(Component.TF, incident @ spin, outgoing @ spin) == pytest.approx(first)
    out, _ = bsdf("front", with_z(incident[None], 1.0), 4000, rng)
    assert (bsdf.evaluate(Component.TF, incident, out[0, :, :2]) > 0).all()


def test_the_sheet_as_a_tree_of_both_ranks() -> None:
    sheet = PrismSheet()
    rng = np.random.default_rng(5)
    xy = disk_of_square(rng.random((40, 2)))
    trees = [tensor_tree_of(prism_tracer(sheet), rng, depth=depth, rays=1000) for depth in (4, 5)]
    assert trees[0].rank == 4
    for side in ("front", "back"):
        out, weights = prism_tracer(sheet)(side, with_z(xy, 1.0 if side == "front" else -1.0), 4000, rng)
        through = (out[..., 2] > 0) == (side == "front")
        exact = np.where(through, weights, 0).mean(axis=1)
        component = Component.TF if side == "front" else Component.TB
        # total reflection makes cliffs in the transmittance; a cell as wide as 7 (3.6) degrees averages over them
        coarse, fine = (np.abs(tree.hemispherical(component, xy) - exact).mean() for tree in trees)
        assert fine < coarse < 0.08
        assert fine < 0.04
    isotropic = tensor_tree_of(prism_tracer(sheet), rng, rank=3, depth=4, rays=2000)
    assert isotropic.hemispherical(Component.TF, np.zeros(2)) == pytest.approx(0.87, abs=0.03)


def test_reciprocal_mean_is_reciprocal() -> None:
    rng = np.random.default_rng(6)
    bsdf = TensorTreeBsdf({Component.RF: tree_of(reciprocal_mean(rng.random((4,) * 4)), 0)})
    a, b = rng.uniform(-0.6, 0.6, (2, 30, 2))
    assert bsdf.evaluate(Component.RF, a, b) == pytest.approx(bsdf.evaluate(Component.RF, -b, -a))


def test_trees_that_do_not_fit_are_refused() -> None:
    three, four = tree_of(np.ones((2,) * 3)), tree_of(np.ones((2,) * 4))
    with pytest.raises(DataError, match="rank"):
        TensorTreeBsdf({Component.TF: three, Component.TB: four})
    with pytest.raises(DataError, match="at least one"):
        TensorTreeBsdf({})
    with pytest.raises(ValueError, match="power of two"):
        tree_of(np.ones((3, 3, 3)))
    assert isinstance(KlemsBsdf(KLEMS_QUARTER, {Component.TF: np.ones((41, 41))}), KlemsBsdf)
