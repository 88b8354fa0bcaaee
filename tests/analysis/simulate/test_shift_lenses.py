"""Lenses that are told by the differences of direction cosines which they make."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.cases.model import Floats
from analysis.simulate.aims import can_be_followed_back
from analysis.simulate.components import Lens
from analysis.simulate.daylight import daylight, sun_source
from analysis.simulate.lens_shift import REACH, SIDE, cells, shift_samples, shift_tables
from analysis.simulate.predict import predict
from analysis.simulate.system import System
from analysis.simulate.tally import Tally
from analysis.simulate.tracer import Settings, trace
from labdaq import directions
from labdaq.errors import ConfigError, SimulationError

DAY = daylight(60.0, 120.0, 80_000.0, 12_000.0, "perez")
GAMMA, C = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.0, 5.0)


def sends(*shifts: tuple[float, float]) -> Lens:
    """A lens with as much light at each of a few shifts east and north."""
    density = np.zeros((SIDE, SIDE))
    for x, y in shifts:
        density[np.argmin(np.abs(cells() - x)), np.argmin(np.abs(cells() - y))] += 1.0
    return Lens(kind="shift", shifts=tuple(density.ravel().tolist()))


def window(lens: Lens) -> System:
    """A hole in the roof, closed by one lens."""
    return System(rise_m=0.0, well_depth_m=1e-3, entry=lens)


def traced(system: System) -> Tally:
    """The sun below it."""
    source = sun_source([DAY])
    assert source is not None
    return trace(system, source, Settings(rays=20_000, samples=2_048, sun_samples=2_048, distance_m=0.0))


def light(system: System) -> Floats:
    """Candela (P, G) of the sun below it."""
    return traced(system).intensity(GAMMA[None, :], C[:, None], "far").candela[0]


def brightest(system: System) -> Floats:
    """Direction cosines east and north of its brightest direction."""
    seen = light(system)
    p, g = np.unravel_index(np.argmax(seen), seen.shape)
    return np.asarray(directions.vector(GAMMA[g], C[p]))[:2]


SUN = -np.asarray(directions.sky_vector(60.0, 120.0))[:2]


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.32, -0.2), (-0.4, 0.12)])
def test_an_image_lies_where_its_shift_says(shift: tuple[float, float]) -> None:
    assert brightest(window(sends(shift))) == pytest.approx(SUN + np.array(shift), abs=0.05)


@pytest.mark.parametrize("kept", [0.0, 0.4, 0.8])
def test_a_lens_that_draws_light_keeps_a_share_of_its_direction(kept: float) -> None:
    shift = (0.2, -0.1)
    lens = dataclasses.replace(sends(shift), kept=kept)
    assert brightest(window(lens)) == pytest.approx(kept * SUN + np.array(shift), abs=0.05)
    turned = window(lens).with_settings({"entry.orientation_deg": 90.0})
    assert brightest(turned) == pytest.approx(kept * SUN + np.array([0.1, 0.2]), abs=0.05)


@pytest.mark.parametrize(
    ("axis_deg", "made"), [(0.0, (0.45, 0.0)), (90.0, (0.2, 0.0)), (45.0, (0.325, 0.125)), (-45.0, (0.325, -0.125))]
)
def test_a_stretched_lens_shifts_further_along_an_axis(axis_deg: float, made: tuple[float, float]) -> None:
    """And less far across it, by as much."""
    lens = dataclasses.replace(sends((0.3, 0.0)), stretch=0.5, stretch_axis_deg=axis_deg)
    assert brightest(window(lens)) == pytest.approx(SUN + np.array(made), abs=0.05)
    assert shift_tables(lens, 2_048, 8)[0] is not shift_tables(sends((0.3, 0.0)), 2_048, 8)[0]


@given(st.floats(0.0, 180.0), st.floats(-0.6, 1.5))
def test_a_stretch_the_other_way_is_one_across(axis_deg: float, by: float) -> None:
    lens = sends((0.1, 0.05), (-0.2, 0.1))
    across = {"stretch": 1.0 / (1.0 + by) - 1.0, "stretch_axis_deg": axis_deg + 90.0}
    down = np.tile([0.0, 0.0, -1.0], (8, 1))
    one, other = (
        shift_samples(dataclasses.replace(lens, **how), False, down, 16, np.random.default_rng(3))[0]
        for how in ({"stretch": by, "stretch_axis_deg": axis_deg}, across)
    )
    assert one == pytest.approx(other, abs=1e-9)


def test_a_pattern_is_turned_mirrored_and_lost() -> None:
    x, y = 0.36, 0.08
    lens = window(sends((x, y)))
    turned = lens.with_settings({"entry.orientation_deg": 90.0})
    assert brightest(turned) == pytest.approx(SUN + np.array([-y, x]), abs=0.05)
    assert brightest(lens.with_settings({"entry.mirrored": True})) == pytest.approx(SUN + np.array([-x, y]), abs=0.05)
    ring = light(lens.with_settings({"entry.isotropic": True}))
    both = light(window(sends((x, y), (-x, -y), (y, -x), (-y, x))))
    assert ring.max() < 0.5 * both.max()


def test_no_shift_is_a_clear_slab() -> None:
    """Both lose what Fresnel's equations and the material take."""
    moved, plain = (traced(window(lens)).balance for lens in (sends((0.0, 0.0)), Lens(kind="clear")))
    assert moved.out / moved.entering == pytest.approx(plain.out / plain.entering, rel=0.003)


@given(
    st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.95, 0.95), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1)
)
def test_no_light_comes_of_nothing(x: float, y: float, along: float, turn: float, seed: int) -> None:
    sent = np.array([[along * np.cos(6.3 * turn), along * np.sin(6.3 * turn), -np.sqrt(1.0 - along**2)]])
    out, weight = shift_samples(sends((x, y), (0.0, 0.0)), False, sent, 64, np.random.default_rng(seed))
    assert np.allclose(np.linalg.norm(out, axis=-1), 1.0) and np.all(out[..., 2] < 0.0)
    assert np.all((weight >= 0.0) & (weight <= 1.0))
    step = cells()[1] - cells()[0]
    near = np.abs(out[..., :2] - sent[:, None, :2] - (x, y)) <= step + 1e-9
    stays = np.abs(out[..., :2] - sent[:, None, :2]) <= step + 1e-9
    assert np.all(near.all(axis=-1) | stays.all(axis=-1) | (weight == 0.0))


def test_each_direction_and_each_turn_has_the_whole_density() -> None:
    """Also where a pattern is turned at random, one sample for each turn."""
    lens = sends((0.4, 0.0), (-0.4, 0.0))
    down = np.tile([0.0, 0.0, -1.0], (4_000, 1))
    alone, _ = shift_samples(lens, False, down, 1, np.random.default_rng(1))
    right = alone[:, 0, 0] > 0.0
    assert np.mean(right) == pytest.approx(0.5, abs=0.02)
    assert np.mean(right[: len(right) // 2]) == pytest.approx(0.5, abs=0.05)
    many, _ = shift_samples(lens, False, down[:3], 1_000, np.random.default_rng(1))
    assert np.mean(many[..., 0] > 0.0, axis=1) == pytest.approx(0.5, abs=0.002)


@pytest.mark.parametrize("shifts", [(), (1.0, 2.0), (1.0, -1.0, 0.0, 0.0), (0.0,) * 9])
def test_shares_that_are_none_are_refused(shifts: tuple[float, ...]) -> None:
    with pytest.raises(ConfigError, match="shares of a square of cells"):
        System(name="odd").with_settings({"entry.kind": "shift", "entry.shifts": shifts})
    with pytest.raises(ConfigError, match="shares of a square of cells"):
        System(name="odd").with_settings({"entry.shifts": (1.0,)})


def test_the_other_engine_refuses_what_it_cannot_do() -> None:
    with pytest.raises(SimulationError, match="density of shifts"):
        predict(window(sends((0.1, 0.0))), DAY, engine="radiance")
    assert not can_be_followed_back(window(sends((0.1, 0.0))))


def test_a_turned_or_hazy_lens_needs_no_table_of_its_own() -> None:
    lens = sends((0.1, 0.0))
    other = dataclasses.replace(lens, orientation_deg=20.0, haze=0.1, mirrored=True)
    assert shift_tables(other, 2_048, 8)[0] is shift_tables(lens, 2_048, 8)[0]


def test_shifts_reach_as_far_as_is_said() -> None:
    assert cells()[0] == -REACH and cells()[-1] == REACH and cells()[SIDE // 2] == pytest.approx(0.0, abs=1e-12)
