"""Scatter tables: exact where they should be, and true to a separate ray tracer of the sheet."""

import numba
import numpy as np
import pytest
from prism_sampler import sheet_samples

from analysis.simulate.components import Lens
from analysis.simulate.kernels.maps import circle
from analysis.simulate.lens import DELTA_UNITS, nodes, ring_table, sun_table, tables
from analysis.simulate.smooth import smoother
from analysis.simulate.source import cell_directions, suns
from analysis.simulate.system import named
from analysis.simulate.tracer import Settings, trace
from labdaq.directions import vector


def test_a_sheet_without_prisms_is_exact() -> None:
    """All light of a plane sheet goes on in its own direction or is mirrored: all differences are 0."""
    plane = Lens(slope_deg=0.0, blur_deg=0.0)
    made = tables(plane, samples=64, half=6)
    for table in (made.flat, made.prisms):
        lit = np.abs(table[..., 2]) > 1  # weight 1/32000 stands for light that was absorbed
        assert np.abs(table[..., :2])[lit].max() <= 1


def test_nodes_cover_an_eighth_of_the_hemisphere() -> None:
    directions = nodes(8)
    assert directions.shape == (45, 3)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert np.all(directions[:, 2] < 0.0) and np.all(directions[:, 1] >= -1e-12)
    assert np.all(directions[:, 1] <= directions[:, 0] + 1e-12)


def test_weights_and_sides_survive_packing() -> None:
    lens = Lens()
    spot = np.array([[0.3, 0.2, -np.sqrt(0.87)]])
    table = sun_table(lens, spot, 4096)[0]
    through = table[:, 2] > 0
    assert 0.3 < through.mean() < 0.99
    out = spot[0, :2] + table[:, :2] / DELTA_UNITS
    assert np.all(np.sum(out**2, axis=1) < 1.001)


@pytest.mark.parametrize("prisms", ["down", "up"])
def test_the_tracer_agrees_with_a_separate_sheet_tracer(prisms: str) -> None:
    """Far field of a flat lens under a sun: our tracer with the project's sheet, and plain counts of the test's own
    sheet tracer (uniform slope errors there, visible-area weighted here: equal without blur)."""
    lens = Lens(blur_deg=0.0, prisms=prisms)
    flat = named("box").replace(rise_m=0.0, entry=lens, exit=Lens(kind="none"), well_depth_m=1e-6)
    altitude, azimuth = 55.0, 70.0
    tally = trace(flat, suns(altitude, azimuth, radius_deg=0.0), Settings(rays=400_000, distance_m=0.0))
    travel = -vector(90.0 + altitude, 360.0 - azimuth)
    sent = travel * np.array([1.0, 1.0, 1.0 if prisms == "down" else -1.0])
    out, weight = sheet_samples(lens, prisms == "up", sent[None], 400_000, np.random.default_rng(4))
    passed = weight[0] * (out[0, :, 2] * sent[2] > 0.0)
    flux = flat.aperture_area_m2 * np.sin(np.radians(altitude))
    assert tally.flux()[0][0] / flux == pytest.approx(passed.mean(), abs=4e-3)  # 3 sd of 400,000 samples
    own = out[0] * np.array([1.0, 1.0, 1.0 if prisms == "down" else -1.0])
    for k in np.argsort(-passed)[:: len(passed) // 12][:6]:  # caps of 4 degrees around some of its directions
        near = own @ own[k] > np.cos(np.radians(4.0))
        expected = float(passed[near].sum() / len(passed))
        if expected < 0.02:
            continue
        x, y, z = (a[:, 0] for a in cell_directions(128, 1))
        cap = np.stack([x, y, -z], axis=1) @ own[k] > np.cos(np.radians(4.0))
        sharp = tally.collapsed()[0][:, 0, cap, 0].sum(axis=1).mean() / flux
        assert sharp == pytest.approx(expected, rel=0.12)  # cells of 1.1 degrees at the cap's edge


def test_a_ring_is_made_of_the_same_sheet() -> None:
    """Its rows have the transmittance of a table made for the same direction (sd of 8192 samples: 0.5 %)."""
    lens = Lens(prisms="up")
    spots, ring = ring_table(lens, 0.7, 8192)
    made = ring.swapaxes(0, 1).reshape(len(spots), -1, 3)
    assert np.allclose(np.linalg.norm(spots, axis=1), 1.0) and np.allclose(spots[:, 2], -0.7)
    for row in (0, 20, len(spots) - 1):
        single = sun_table(lens, spots[[row]], 8192)[0]
        both = [np.maximum(t[:, 2], 0).mean() / 32000.0 for t in (made[row], single)]
        assert both[0] == pytest.approx(both[1], abs=0.025)
    plane = ring_table(Lens(prisms="up", slope_deg=0.0, blur_deg=0.0), 0.7, 64)[1]
    assert np.abs(plane[..., :2])[np.abs(plane[..., 2]) > 1].max() <= 1


@pytest.mark.parametrize("turn", [0.0, 33.0])
def test_a_sun_through_a_clear_cover_uses_the_ring_as_it_would_the_table(turn: float) -> None:
    """Flux and intensity with and without the ring agree within what both state (between 2 and 6 %)."""
    tube = named("tube").with_settings({"boot_height_m": 0.0, "exit.orientation_deg": turn, "exit.mirrored": True})
    sun = suns(40.0, 120.0, 1000.0)
    ring, table = (trace(tube, sun, Settings(rays=400_000, sun_samples=n, bounces=1)) for n in (65_536, 0))
    assert ring.flux()[0] == pytest.approx(table.flux()[0], rel=0.01)
    gamma, c = np.array([10.0, 30.0, 50.0])[None, :], np.arange(0.0, 360.0, 30.0)[:, None]
    a, b = (tally.intensity(gamma, c) for tally in (ring, table))
    gap = (a.candela - b.candela) / np.hypot(a.uncertainty, b.uncertainty)
    assert np.sqrt(np.mean(gap**2)) < 1.6  # 36 directions; smoothing adds a little to statistics


def test_circle_is_cosine_and_sine() -> None:
    turns = np.linspace(0.0, 1.0, 1001)
    made = np.array(numba.njit(lambda turns: [circle(turn) for turn in turns])(turns))
    assert np.allclose(made, np.stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=1), atol=1e-12)


def test_smoothing_keeps_what_is_smooth() -> None:
    """Lumens per cell of known distributions come back as their candela."""
    gamma, c = np.arange(0.0, 88.0, 5.0)[None, :], np.arange(0.0, 360.0, 30.0)[:, None]
    use = smoother(gamma, c, (128, 64))
    x, y, z = cell_directions(128, 6)
    to = vector(gamma, c) * np.array([1.0, 1.0, -1.0])
    shapes = {
        "cosine": (lambda x, y, z: z, 1e-3),
        "tilted": (lambda x, y, z: z * (1.0 + 0.5 * x - 0.3 * y), 2e-3),
        "narrow": (lambda x, y, z: z**20, 1e-2),
    }
    for name, (shape, tolerance) in shapes.items():
        lumens = shape(x, y, z).mean(axis=1) * 2.0 * np.pi / 128**2
        for operator in use.sharp:
            back = (operator.weights @ lumens).reshape(use.shape)
            truth = shape(to[..., 0], to[..., 1], to[..., 2])
            assert np.allclose(back, truth, atol=tolerance * truth.max()), name
