"""Variants: what tallies say must equal what a run says, and each change must do what its physics says."""

import numpy as np
import pytest

from analysis.simulate.changes import Change, changed
from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.system import System, named
from analysis.simulate.variants import Outcome, VariantSet, variants
from labdaq.errors import ConfigError, DataError

RAYS = 40_000


def a_morning() -> list[Daylight]:
    return [
        daylight(31.2, 85.6, 45_717.0, 17_343.0, "uniform", "low"),
        daylight(60.0, 120.0, 90_000.0, 20_000.0, "overcast", "high"),
    ]


def flux(candela: np.ndarray, of: VariantSet) -> np.ndarray:
    """Flux [lm] of arrays (tests, C, gamma), trapezia in gamma and C."""
    gamma, c = np.radians(of.gamma_deg), np.radians(of.c_deg)
    return np.trapezoid(np.trapezoid(candela * np.sin(gamma), gamma, axis=-1), c, axis=-1)


@pytest.fixture(scope="module")
def box() -> VariantSet:
    changes = [
        Change("wall-reflectance", {"wall_reflectance": 0.80}),
        Change("bounce-truncation", {"max_bounces": 1}),
        Change("bounce-truncation", {"max_bounces": 0, "wall_reflectance": 0.5}),
        Change("lens-haze", {"haze": 0.2}),
        Change("lens-orientation", {"rotation_deg": 90.0}),
        Change("lens-orientation", {"mirrored": True}),
        Change("lens-orientation", {"rotation_deg": 30.0}),
        Change("circumsolar-aureole", {"aureole_deg": 5.0}),
        Change("soiling", {"soiling": 0.1}),
    ]
    return variants(named("box"), a_morning(), changes, rays=RAYS, threads=1)


def by_setting(of: VariantSet, **setting: object) -> Outcome:
    return next(outcome for change, outcome in of.variants if change.setting == setting)


def test_arrays_are_closed_and_complete(box: VariantSet) -> None:
    assert box.baseline.far.sun.shape == box.baseline.near.sky.shape == (2, 73, 37)
    for part in (box.baseline.far.sun, box.baseline.near.sky):
        assert np.array_equal(part[:, 0], part[:, -1])
        assert np.all(part >= 0.0) and np.all(part[..., -1] < 1e-9)  # nothing leaves along the ceiling
    assert np.all(flux(box.baseline.far.sun, box) > 1000.0)


def test_flux_is_the_same_from_far_and_near(box: VariantSet) -> None:
    """The sphere of the sensors catches all light that leaves the aperture. (Grid and smoothing: 2 %.)"""
    far, near = (flux(field.total, box) for field in (box.baseline.far, box.baseline.near))
    assert far == pytest.approx(near, rel=0.02)


def test_tallied_reflectance_equals_a_run_with_that_wall(box: VariantSet) -> None:
    traced = variants(named("box").with_settings({"wall.reflectance": 0.80}), a_morning(), [], rays=RAYS, threads=1)
    tallied = by_setting(box, wall_reflectance=0.80)
    assert flux(tallied.far.sun, box) == pytest.approx(flux(traced.baseline.far.sun, box), rel=0.01)
    assert flux(tallied.far.sky, box) == pytest.approx(flux(traced.baseline.far.sky, box), rel=0.01)
    again = box.again(wall_reflectance=0.80)
    assert np.allclose(again.near.sun, tallied.near.sun)


def test_by_bounce_adds_up_to_the_baseline(box: VariantSet) -> None:
    sun, sky = box.by_bounce("near")
    assert flux(sun.sum(axis=0), box) == pytest.approx(flux(box.baseline.near.sun, box), rel=0.01)
    n = np.arange(len(sun))[:, None, None, None]
    dull = ((0.8 / 0.95) ** n * sun).sum(axis=0)
    assert flux(dull, box) == pytest.approx(flux(by_setting(box, wall_reflectance=0.80).near.sun, box), rel=0.01)
    limited = by_setting(box, max_bounces=1).near.sky
    assert flux(sky[:2].sum(axis=0), box) == pytest.approx(flux(limited, box), rel=0.01)


def test_by_all_bounces_a_limit_leaves_the_first_of_them() -> None:
    """Below the tube light also bounces on a boot, which the count of the wall alone does not hold."""
    tube = variants(named("tube"), a_morning()[:1], [], rays=20_000, threads=1)
    on_the_wall, _ = tube.by_bounce("near")
    all_of_them, _ = tube.by_bounce("near", boot=True)
    assert flux(all_of_them.sum(axis=0), tube) == pytest.approx(flux(on_the_wall.sum(axis=0), tube), rel=1e-6)
    for limit in (2, 6):
        cut = flux(tube.again(max_bounces=limit).near.sun, tube)
        assert flux(all_of_them[: limit + 1].sum(axis=0), tube) == pytest.approx(cut, rel=0.02)
        assert np.all(flux(on_the_wall[: limit + 1].sum(axis=0), tube) > 1.01 * cut)


def test_without_bounces_reflectance_is_of_no_account(box: VariantSet) -> None:
    cut = box.again(max_bounces=0)
    both = by_setting(box, max_bounces=0, wall_reflectance=0.5)
    assert np.allclose(cut.far.sun, both.far.sun)
    assert np.all(flux(cut.far.sun, box) < flux(by_setting(box, max_bounces=1).far.sun, box))


def test_square_pyramids_look_alike_after_a_quarter_turn_and_in_a_mirror(box: VariantSet) -> None:
    for same in (by_setting(box, rotation_deg=90.0), by_setting(box, mirrored=True)):
        assert np.array_equal(same.far.sun, box.baseline.far.sun)
    turned = by_setting(box, rotation_deg=30.0)
    assert np.abs(turned.far.sun - box.baseline.far.sun).max() > 0.2 * box.baseline.far.sun.max()


def test_haze_lowers_the_peak_and_raises_the_floor(box: VariantSet) -> None:
    sun, hazy = box.baseline.far.sun, by_setting(box, haze=0.2).far.sun
    for before, after in zip(sun, hazy, strict=True):
        peak = np.unravel_index(np.argmax(before), before.shape)
        assert 0.5 < after[peak] / before[peak] < 0.9  # two lenses: at most 0.8² of the light is unscattered
        assert after[:, 4:30].min() > before[:, 4:30].min()


def test_an_aureole_changes_the_sun_and_leaves_the_sky(box: VariantSet) -> None:
    wide = by_setting(box, aureole_deg=5.0)
    assert np.array_equal(wide.far.sky, box.baseline.far.sky)
    assert np.all(wide.far.sun.max(axis=(1, 2)) < box.baseline.far.sun.max(axis=(1, 2)))
    assert flux(wide.far.sun, box) == pytest.approx(flux(box.baseline.far.sun, box), rel=0.05)


def test_dirt_takes_more_from_a_low_sun(box: VariantSet) -> None:
    left = flux(by_setting(box, soiling=0.1).far.sun, box) / flux(box.baseline.far.sun, box)
    assert left[0] < left[1] < np.exp(-0.1)


def test_same_rays_make_ratios_quiet() -> None:
    """Haze of 1 % changes the intensity by about as much; the noise of each run alone is several per cent."""
    tests = a_morning()[:1]
    result = variants(named("box"), tests, [Change("lens-haze", {"haze": 0.01})], rays=20_000, threads=1)
    base, hazy = result.baseline.near, result.variants[0][1].near
    bright = base.sun > 0.3 * base.sun.max()
    assert np.median(base.sun_uncertainty[bright] / base.sun[bright]) > 0.01
    ratio = hazy.sun[bright] / base.sun[bright]
    assert np.std(ratio) < 0.006
    assert 0.97 < np.median(ratio) < 1.0


def test_no_beam_no_sun_part() -> None:
    overcast = [daylight(40.0, 100.0, 20_000.0, 20_000.0, "overcast")]
    result = variants(named("top"), overcast, [], rays=5_000, threads=1)
    assert not result.baseline.far.sun.any()
    assert result.baseline.far.sky.any()


def test_threads_do_not_matter() -> None:
    changes = [Change("wall-scatter", {"scatter_deg": 2.0})]
    one, two = (variants(named("tube"), a_morning(), changes, rays=5_000, threads=t) for t in (1, 3))
    assert np.array_equal(one.variants[0][1].near.total, two.variants[0][1].near.total)


@pytest.mark.parametrize(
    ("setting", "place", "value"),
    [
        ({"rotation_deg": 20.0}, "entry.orientation_deg", 20.0),
        ({"rotation_deg": 20.0, "lenses": "exit"}, "entry.orientation_deg", 0.0),
        ({"haze": 0.1}, "exit.haze", 0.1),
        ({"scatter_deg": 3.0}, "wall.scatter_deg", 3.0),
        ({"entry.thickness_mm": 4.0}, "entry.thickness_mm", 4.0),
    ],
)
def test_settings_reach_their_place(setting: dict[str, object], place: str, value: float) -> None:
    system: System = changed(named("box"), setting)
    part, _, name = place.partition(".")
    assert getattr(getattr(system, part), name) == value


def test_wrong_settings_are_refused() -> None:
    for setting in ({"nonsense": 1}, {"wall_reflectance": 1.5}, {"haze": -1.0}, {"max_bounces": -1}):
        with pytest.raises(ConfigError):
            variants(named("box"), a_morning(), [Change("x", setting)], rays=1000, threads=1)


def test_daylight_that_cannot_be_is_refused() -> None:
    with pytest.raises(DataError, match="exceeds"):
        daylight(30.0, 90.0, 1000.0, 2000.0, "uniform")
    with pytest.raises(DataError, match="no sky"):
        daylight(30.0, 90.0, 3000.0, 2000.0, "sunny")
    with pytest.raises(DataError, match="from a sun at"):
        daylight(-3.0, 90.0, 3000.0, 2000.0, "uniform")


def test_daylight_has_the_illuminances_asked_for() -> None:
    for sky in ("uniform", "overcast", "perez", "cie:7", "ies-clear", "ies-partly-cloudy", "ies-overcast"):
        day = daylight(30.0, 90.0, 50_000.0, 12_000.0, sky)
        assert day.diffuse_lx == pytest.approx(12_000.0, rel=1e-9)
        assert day.normal_lx == pytest.approx(38_000.0 / 0.5)
