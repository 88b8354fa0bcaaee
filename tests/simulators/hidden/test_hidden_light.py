"""Sun, sky, clouds and clocks: what is concealed in them must do what it says and nothing else."""

import math
import subprocess
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from labdaq.clock import NS, utc_ns_of
from labdaq.directions import angle_between, sky_vector
from simulators.hidden.light import PerezLight, Site, SunTable, clear_day, sun_angles
from simulators.hidden.light_faults import Drift, FaultedLight, SourceFaults
from simulators.hidden.perez import clearness_brightness, coefficients, relative_luminance
from simulators.hidden.ripple import Ripple
from simulators.hidden.symmetry import IDENTITY, sky_nodes

GREENWOOD = Site(34.2176, -82.1084, 180.0)
TEST_18 = utc_ns_of(datetime(2010, 7, 22, 13, 13, 22, 500000, tzinfo=UTC))
NODES = sky_nodes(57, (IDENTITY,))
WEIGHT = NODES.directions[:, 2] * NODES.solid_angle


@pytest.fixture(scope="module")
def light() -> PerezLight:
    table = SunTable(GREENWOOD, TEST_18 - 3600 * NS, TEST_18 + 3600 * NS)
    return PerezLight(table, TEST_18, 54_800.0, 17_343.0)


def test_the_sun_is_where_the_report_has_it(light: PerezLight) -> None:
    # test 18 at its middle: 31.198 apparent, azimuth 85.571 (greenwood-tests.csv, pvlib)
    assert angle_between(light.table(TEST_18), sky_vector(31.198, 85.571)) < 0.003
    between = TEST_18 + 77 * NS
    altitude, azimuth = sun_angles(GREENWOOD, np.array([between]))
    assert angle_between(light.table(between), sky_vector(altitude, azimuth)[0]) < 1e-4


def test_the_sky_holds_its_illuminance(light: PerezLight) -> None:
    assert light.luminance(NODES.directions, TEST_18) @ WEIGHT == pytest.approx(17_343.0, rel=1e-6)
    assert WEIGHT.sum() == pytest.approx(math.pi, rel=0.005)
    later = TEST_18 + 600 * NS
    assert light.diffuse(later) > light.diffuse(TEST_18)
    assert light.sun(later).normal_lx > light.sun(TEST_18).normal_lx


def test_perez_is_bright_about_the_sun_and_dark_across_from_it(light: PerezLight) -> None:
    sun = light.table(TEST_18)
    near = light.luminance(sky_vector(31.0, 95.0), TEST_18)
    across = light.luminance(sky_vector(60.0, 265.0), TEST_18)
    assert near > 4.0 * across
    clearness, brightness = clearness_brightness(54_800.0, 17_343.0, 31.2)
    assert 2.0 < clearness < 4.5  # a clear, somewhat hazy morning
    below = relative_luminance(sky_vector(-5.0, 0.0), sun, clearness, brightness)
    assert below == 0.0


@pytest.mark.parametrize(
    ("altitude", "clearness", "brightness"), [(31.2, 3.2, 0.17), (60.0, 5.5, 0.1), (45.0, 1.03, 0.3), (20.0, 1.4, 0.25)]
)
def test_the_coefficients_are_gendaylits(altitude: float, clearness: float, brightness: float) -> None:
    pyradiance = pytest.importorskip("pyradiance")
    program = Path(pyradiance.__file__).parent / "bin" / "gendaylit"
    words = ["-ang", str(altitude), "0", "-P", str(clearness), str(brightness)]
    text = subprocess.run([program, *words], capture_output=True, text=True, check=True).stdout
    # ... perezlum.cal / 0 / 10 diffuse ground a b c d e sun(3)
    theirs = [float(x) for x in text.split("perezlum.cal")[1].split()[4:9]]
    ours = coefficients(math.radians(90.0 - altitude), clearness, brightness)
    assert ours == pytest.approx(theirs, abs=2e-6)  # gendaylit prints six decimals


def test_an_overcast_sky_is_brighter_above_than_on_the_rim() -> None:
    sun = sky_vector(40.0, 180.0)
    clearness, brightness = clearness_brightness(0.0, 12_000.0, 40.0)
    zenith, rim = (relative_luminance(sky_vector(a, 90.0), sun, clearness, brightness) for a in (90.0, 3.0))
    assert 1.4 < zenith / rim < 3.5


def test_a_clear_day_is_like_the_reports() -> None:
    # test 22: altitude 49.7, global 84.3 klx, diffuse 18.0 klx
    normal, diffuse = clear_day(49.7, 3.3)
    assert normal * math.sin(math.radians(49.7)) + diffuse == pytest.approx(84_300.0, rel=0.12)
    assert diffuse == pytest.approx(18_000.0, rel=0.2)


def _horizontal(light: FaultedLight) -> float:
    sun = light.sun(TEST_18)
    points, each = light.halo(TEST_18)
    total = sun.normal_lx * sun.direction[2] + light.luminance(NODES.directions, TEST_18) @ WEIGHT
    return float(total + each * points[:, 2].sum())


def test_another_split_keeps_the_global(light: PerezLight) -> None:
    honest = _horizontal(SourceFaults().over(light))
    for faults in (SourceFaults(diffuse_shift=0.3), SourceFaults(disc_half_angle_deg=6.0)):
        split = faults.over(light)
        assert _horizontal(split) == pytest.approx(honest, rel=1e-6)
        assert split.sun(TEST_18).normal_lx < light.sun(TEST_18).normal_lx
    # 2.5 to 3.2 % of a plain Perez diffuse lies within 5 degrees (sky-and-sun.md)
    assert 0.02 < SourceFaults(disc_half_angle_deg=5.0).over(light)._shift(TEST_18) < 0.045


def test_a_halo_takes_from_the_disc_what_it_gives_around(light: PerezLight) -> None:
    halo = SourceFaults(halo=0.2, halo_deg=3.0, halo_power=1.0).over(light)
    points, each = halo.halo(TEST_18)
    assert halo.sun(TEST_18).normal_lx == pytest.approx(0.8 * light.sun(TEST_18).normal_lx)
    assert each * len(points) == pytest.approx(0.2 * light.sun(TEST_18).normal_lx, rel=0.02)
    # exp(-a / 3°) over the sphere: mean angle 2 x 3 degrees
    assert np.mean(angle_between(points, halo.sun(TEST_18).direction)) == pytest.approx(6.0, rel=0.05)
    fine = sky_nodes(109, (IDENTITY,))
    glow = halo.glow(fine.directions, TEST_18) - halo.luminance(fine.directions, TEST_18)
    assert glow @ fine.solid_angle == pytest.approx(0.2 * light.sun(TEST_18).normal_lx, rel=0.05)


def test_a_late_clock_shows_a_later_sun(light: PerezLight) -> None:
    late = SourceFaults(clock_s=600.0).over(light)
    assert late.sun(TEST_18).direction == pytest.approx(light.table(TEST_18 + 600 * NS))


def test_drifting_cloud_moves_and_has_its_depth(light: PerezLight) -> None:
    cloudy = SourceFaults(drift=Drift(0.1, crossing_s=40.0, seed=4)).over(light)
    passed = np.array([cloudy.transmission(TEST_18 + k * NS) for k in range(0, 3000, 5)])
    assert np.std(passed) == pytest.approx(0.1, rel=0.35)  # forty waves, fifty minutes
    seconds = np.array([cloudy.transmission(TEST_18 + k * NS) for k in range(200)])
    # the shortest wave, 0.15 of the layer's height, passes in 15 s: 0.1 x 1.4 x 2 pi / 15 s at the very most
    assert 1e-3 < np.abs(np.diff(seconds)).max() < 0.06
    again = SourceFaults(drift=Drift(0.1, crossing_s=40.0, seed=4)).over(light)
    assert again.transmission(TEST_18) == cloudy.transmission(TEST_18)


def test_clouds_pass_only_in_their_spans_by_the_clock_of_the_record(light: PerezLight) -> None:
    span = (TEST_18, TEST_18 + 60 * NS)
    late = SourceFaults(clock_s=600.0, drift=Drift(0.1, seed=4, spans_ns=(span,))).over(light)
    true_ns, up = TEST_18 + 600 * NS, sky_vector(60.0, 80.0)[None]
    assert late.transmission(true_ns + 30 * NS) != 1.0
    assert late.transmission(true_ns + 90 * NS) == late.transmission(TEST_18 + 30 * NS) == 1.0
    without = SourceFaults(clock_s=600.0).over(light)
    assert late.luminance(up, TEST_18 + 90 * NS) == without.luminance(up, TEST_18 + 90 * NS)


def test_a_skyline_hides_what_lies_behind_it(light: PerezLight) -> None:
    built = SourceFaults(skyline=(60.0, 110.0, 40.0, 0.2)).over(light)
    assert built.sun(TEST_18).normal_lx == 0.0
    behind, free = sky_vector(20.0, 80.0), sky_vector(20.0, 200.0)
    assert built.luminance(behind, TEST_18) == pytest.approx(0.2 * 17_343.0 / math.pi)
    assert built.luminance(free, TEST_18) == light.luminance(free, TEST_18)


def test_a_ripple_has_its_size_and_no_seams() -> None:
    values = np.concatenate([Ripple(np.random.default_rng(k), 0.02)(NODES.directions) for k in range(12)])
    assert np.std(values) == pytest.approx(0.02, rel=0.15)
    ripple = Ripple(np.random.default_rng(1), 0.02)
    ring = sky_vector(np.full(721, 10.0), np.linspace(0.0, 360.0, 721))
    assert ripple(ring)[0] == pytest.approx(ripple(ring)[-1])
    assert np.abs(np.diff(ripple(ring))).max() < 0.002


def test_a_neutral_fault_changes_nothing(light: PerezLight) -> None:
    same = SourceFaults().over(light)
    assert same.sun(TEST_18).normal_lx == light.sun(TEST_18).normal_lx
    assert same.luminance(NODES.directions, TEST_18) == pytest.approx(light.luminance(NODES.directions, TEST_18))
    assert replace(SourceFaults(), clock_s=0.0) == SourceFaults()
