"""Fields are read between their directions as a smooth function, sharp images included."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.cases.model import Parts
from analysis.explain.fields import C_DEG, GAMMA_DEG, _from_rows, fields_of, from_files
from analysis.explain.geometry import bilinear
from analysis.explain.readings import Readings
from analysis.explain.sampler import Sampler
from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, write_lm63
from labdaq import directions
from tests.analysis.explain.campaign import TESTS, Floats, make_case, sky_part, sun_part

PEAK = directions.vector(np.array(32.0), np.array(73.0))


def image(gamma_deg: Floats, c_deg: Floats, width_deg: float = 12.0) -> Floats:
    """An image of the sun of this rms width, on an even sky [cd]."""
    away = directions.vector(gamma_deg, c_deg) @ PEAK - 1.0
    return np.asarray(300.0 * np.cos(np.radians(gamma_deg)) + 2000.0 * np.exp(away / np.radians(width_deg) ** 2))


def test_a_sharp_image_is_read_ten_times_as_well_as_along_straight_lines() -> None:
    field = image(GAMMA_DEG[None, :], C_DEG[:, None])[None]
    rng = np.random.default_rng(2)
    gamma, c = rng.uniform(0.0, 87.0, 4000), rng.uniform(-360.0, 720.0, 4000)
    read, exact = Sampler(np.zeros(4000, dtype=np.intp), gamma, c)(field), image(gamma, c)
    missed = np.max(np.abs(read - exact))
    assert missed < 0.001 * field.max()
    assert missed < 0.1 * np.max(np.abs(bilinear(gamma, c) @ field.ravel() - exact))


@given(st.floats(-90.0, 90.0), st.floats(-720.0, 720.0))
def test_a_plane_field_is_read_exactly(gamma_deg: float, c_deg: float) -> None:
    """Also across nadir, at the horizon, and where C begins again; nothing is negative."""
    height = Sampler(np.array([1]), np.array([gamma_deg]), np.array([c_deg]))
    even = np.stack([np.zeros((len(C_DEG), len(GAMMA_DEG))), np.broadcast_to(GAMMA_DEG, (len(C_DEG), len(GAMMA_DEG)))])
    expected = abs(gamma_deg) if abs(gamma_deg) >= GAMMA_DEG[1] else None  # at nadir it has an edge
    if expected is not None:
        assert height(even)[0] == pytest.approx(expected, abs=1e-4)
    assert height(even)[0] >= 0.0


def test_the_opposite_half_plane_lies_beyond_nadir() -> None:
    field = image(GAMMA_DEG[None, :], C_DEG[:, None])[None]
    one, other = (
        Sampler(np.zeros(1, dtype=np.intp), np.array([g]), np.array([c])) for g, c in ((-6.3, 20.0), (6.3, 200.0))
    )
    assert one(field) == pytest.approx(other(field), rel=1e-12)


def test_a_coarse_file_is_read_as_smoothly(tmp_path: Path) -> None:
    """Of 5 x 7.5 degrees, as many programs write; straight lines miss its image by three per cent."""
    case = make_case(tmp_path / "case")
    gamma, c = np.arange(0.0, 90.1, 5.0), np.arange(0.0, 360.1, 7.5)
    candela = image(gamma[None, :], c[:, None])
    candela[-1] = candela[0]
    facts = {"TEST": "T1", "TESTLAB": "none", "ISSUEDATE": "2011-06-01", "MANUFAC": "none"}
    made = Distribution(gamma, c, candela, facts)
    write_lm63(case.folder / "sun.ies", made, generation=FileGeneration.SIMULATED)
    sun, sky = from_files(case, Parts(sun="sun.ies", sky="sun.ies"))
    assert np.array_equal(sun, sky)
    exact = image(GAMMA_DEG[None, :], C_DEG[:, None])
    assert np.max(np.abs(sun - exact)) < 0.006 * exact.max()
    assert np.max(np.abs(made.at(GAMMA_DEG[None, :], C_DEG[:, None]) - exact)) > 0.025 * exact.max()


@pytest.mark.parametrize(("every", "most"), [(1, 0.025), (2, 0.07)])
def test_images_between_planes_are_read_from_the_rows(tmp_path: Path, every: int, most: float) -> None:
    """Planes 22.5° and 45° apart; along splines of the candela they are missed by .04 and .18 of the brightest."""
    rows = Readings.of(make_case(tmp_path / "case", files=False))
    rows = rows.only(np.round(rows.c_deg / 22.5).astype(int) % every == 0)
    found = fields_of(rows)
    for wanted, made in ((sun_part, found.sun), (sky_part, found.sky)):
        for test, field in zip(TESTS, made, strict=True):
            exact = wanted(test, GAMMA_DEG[None, :], C_DEG[:, None])
            assert np.max(np.abs(field - exact)) < most * exact.max()
            assert np.all(field >= 0.0)
            assert np.all(field[:, -1] < 1e-9 * exact.max()), "nothing goes level"


def test_a_dark_part_is_dark(tmp_path: Path) -> None:
    rows = Readings.of(make_case(tmp_path / "case", files=False))
    rows.sun[:] = 0.0
    assert np.all(fields_of(rows).sun == 0.0)


def test_rings_read_together_are_as_each_by_itself() -> None:
    """A ring with a plane read twice has planes of its own; the field is the same."""
    gamma, c = np.meshgrid(np.arange(0.0, 90.0, 7.5), np.arange(0.0, 360.0, 15.0))
    rows = gamma.ravel(), c.ravel(), image(gamma.ravel(), c.ravel())
    twice = (np.append(part, part[37]) for part in rows)
    assert _from_rows(*twice) == pytest.approx(_from_rows(*rows), rel=1e-9)
