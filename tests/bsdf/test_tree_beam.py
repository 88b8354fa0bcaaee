"""Trees for the light of a few beams: where they are fine, what they let through, and both ways round."""

import numpy as np
import pytest

from analysis.bsdf.disk import disk_of_square, square_of_disk
from analysis.bsdf.model import Component, Floats
from analysis.bsdf.prism import PrismSheet, prism_tracer
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import Tree
from analysis.bsdf.tree_beam import beam_trees
from analysis.bsdf.tree_tally import trace_dense
from analysis.bsdf.tree_text import parse_tree, render_tree

DEPTH = 5
BEAMS = np.array([[0.3, 0.2, np.sqrt(1.0 - 0.13)], [-0.61, 0.11, np.sqrt(1.0 - 0.61**2 - 0.11**2)]])
TRACER = prism_tracer(PrismSheet())


@pytest.fixture(scope="module")
def trees() -> dict[Component, Tree]:
    return beam_trees(TRACER, "front", BEAMS, 0.2665, np.random.default_rng(1), depth=DEPTH, rays=100_000)


def test_each_beam_has_the_transmittance_of_its_own_direction(trees: dict[Component, Tree]) -> None:
    """And nothing passes from anywhere else; 1e-2 is four standard deviations of 40,000 rays and more."""
    bsdf = TensorTreeBsdf(trees)
    found = bsdf.hemispherical(Component.TF, BEAMS[:, :2])
    out, weights = TRACER("front", BEAMS, 40_000, np.random.default_rng(2))
    assert found == pytest.approx(np.mean(weights * (out[..., 2] > 0.0), axis=1), abs=1e-2)
    elsewhere = bsdf.hemispherical(Component.TF, np.array([[0.5, 0.2], [0.3, -0.3], [-0.61, -0.4]]))
    assert np.all(elsewhere == 0.0)


def test_cells_are_fine_under_the_beams_alone(trees: dict[Component, Tree]) -> None:
    under, beside = (trees[Component.TF].slice(square_of_disk(np.array(xy)))[1] for xy in (BEAMS[0, :2], [0.8, -0.5]))
    assert set(under) == {0.5**DEPTH, 0.5 ** (DEPTH - 1)}, "neighbours differ by one level"
    assert np.mean(under == 0.5**DEPTH) == pytest.approx(0.4 / 1.3, abs=0.02)
    assert np.all(beside >= 0.25)


def test_paths_walked_backwards_have_the_same_value(trees: dict[Component, Tree]) -> None:
    bsdf, rng = TensorTreeBsdf(trees), np.random.default_rng(3)
    out: Floats = 0.7 * (2.0 * rng.random((500, 2)) - 1.0)
    there = bsdf.evaluate(Component.TF, BEAMS[1, :2], out)
    assert np.count_nonzero(there) > 100
    assert np.array_equal(there, bsdf.evaluate(Component.TB, -out, -BEAMS[1, :2]))


def test_a_beam_scatters_as_the_whole_sheets_tree_says() -> None:
    """At depth 4, from the middle of a cell and as wide: what each outgoing cell gets, within 0.02 of all light."""
    cell = np.array([10, 7])
    xy = disk_of_square((cell + 0.5) / 16)
    middle = np.array([[*xy, np.sqrt(1.0 - xy @ xy)]])
    made = beam_trees(TRACER, "front", middle, 3.6, np.random.default_rng(4), depth=4, rays=100_000)
    beam = made[Component.TF].dense()[tuple(cell)]
    whole = trace_dense(TRACER, "front", 4, 4, 1000, np.random.default_rng(5))[0][tuple(cell)]
    share = np.pi / 256
    assert np.abs(beam - whole).max() * share < 0.02
    assert abs(beam.sum() - whole.sum()) * share < 0.04


def test_the_trees_survive_as_text(trees: dict[Component, Tree]) -> None:
    for tree in trees.values():
        again = parse_tree(render_tree(tree), 4)
        assert np.array_equal(again.branches.shape, tree.branches.shape)
        assert np.allclose(again.dense(), tree.dense(), rtol=1e-6, atol=0.0)
