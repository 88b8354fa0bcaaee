"""Responses on disk, the bench that uses them, heads, meters and the camera: each fault does what it says."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from labdaq.clock import NS, utc_ns_of
from labdaq.directions import sky_vector, vector
from simulators.hidden.arm import ArmFaults
from simulators.hidden.bench import Bench, RoomFaults, Scan, Spot, fields, readings
from simulators.hidden.camera import CameraFaults, Scene, merged, photograph, seen_direction, tinted
from simulators.hidden.defects import answers, sun_change, with_defect
from simulators.hidden.heads import HeadFaults, angular_response, bent, ended, lagging, read
from simulators.hidden.light import PerezLight, Site, SunTable
from simulators.hidden.light_faults import SourceFaults
from simulators.hidden.maps import Field, smooth
from simulators.hidden.meter import MeterFaults, SkySeries, read_meter
from simulators.hidden.responses import Response, response
from simulators.hidden.room import Room
from simulators.hidden.skylight import Defect, box, tube
from simulators.hidden.symmetry import IDENTITY, sky_nodes
from simulators.hidden.tracer import Answer, trace

SITE = Site(34.2176, -82.1084, 180.0)
NOON = utc_ns_of(datetime(2010, 7, 22, 15, 8, tzinfo=UTC))
GAMMAS = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0])
PLANES = np.arange(16) * 22.5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("responses")


@pytest.fixture(scope="module")
def tubes(folder: Path) -> Response:
    return response(tube(), rays_per_node=1500, folder=folder)


@pytest.fixture(scope="module")
def light() -> PerezLight:
    return PerezLight(SunTable(SITE, NOON - 7200 * NS, NOON + 7200 * NS), NOON, 90_000.0, 18_800.0)


def _scan(distance_m: float = 2.6) -> Scan:
    times = NOON + (np.arange(160).reshape(16, 10) * NS).astype(np.int64)
    return Scan(GAMMAS, PLANES, times, distance_m)


def test_a_response_is_traced_once(folder: Path, tubes: Response) -> None:
    before = sorted((p, p.stat().st_mtime_ns) for p in folder.rglob("*.npy"))
    again = response(tube(), rays_per_node=1500, folder=folder)
    assert sorted((p, p.stat().st_mtime_ns) for p in folder.rglob("*.npy")) == before
    assert np.array_equal(again.base, tubes.base)
    assert not [p for p in folder.iterdir() if p.name.startswith(".")]


def test_a_response_agrees_with_tracing_that_sun(tubes: Response) -> None:
    sun = sky_vector(52.0, 33.0)
    direct = smooth(trace(tube(), sun, 200_000, 77).flux[0])
    assert tubes.sun(sun).flux() == pytest.approx(trace(tube(), sun, 200_000, 77).below_lm, rel=0.03)
    ours = tubes.sun(sun).values
    assert np.corrcoef(ours[0].ravel(), direct[0].ravel())[0, 1] > 0.93  # the spline blurs the sun by 1.6 degrees


def test_an_even_sky_is_the_sum_of_its_suns(tubes: Response) -> None:
    nodes = tubes.nodes
    sky = tubes.sky(np.ones((1, len(nodes.where))))[0]
    chosen = np.random.default_rng(1).choice(len(nodes.where), 60, replace=False)
    flux = [tubes.sun(nodes.directions[k]).flux() for k in chosen]
    weight = nodes.solid_angle[chosen]
    assert sky.flux() == pytest.approx(np.average(flux, weights=weight) * nodes.solid_angle.sum(), rel=0.15)
    even = sky.intensity(vector(np.full(4, 40.0), np.arange(4) * 90.0 + 10.0))
    assert np.ptp(even) < 0.02 * even.mean()  # only the square lens singles out directions


def test_answers_interpolate_between_what_was_traced(tubes: Response) -> None:
    sun = sky_vector(30.0, 250.0)
    nominal = tubes.sun(sun).flux()
    traced = trace(tube(), sun, 150_000, 3, (Answer(), Answer(wall_reflectance=0.95), Answer(max_bounces=4)))
    exact = traced.flux[:, 0].sum(axis=(1, 2))
    assert tubes.with_answer(Answer(wall_reflectance=0.95)).sun(sun).flux() / nominal == pytest.approx(
        exact[1] / exact[0], rel=0.02
    )
    assert tubes.with_answer(Answer(max_bounces=4)).sun(sun).flux() / nominal == pytest.approx(
        exact[2] / exact[0], rel=0.08
    )
    assert tubes.with_answer(Answer()) is tubes
    drawn = replace(tube(), exit=replace(tube().exit, haze=0.05), entry=replace(tube().entry, haze=0.05))
    hazed = Field(smooth(trace(drawn, sun, 300_000, 3).flux[0]))
    ours = tubes.with_answer(Answer(haze=0.05)).sun(sun)
    assert ours.flux() / nominal == pytest.approx(hazed.flux() / (exact[0]), rel=0.03)
    ring = vector(np.full(24, 80.0), np.arange(24) * 15.0)  # where next to nothing goes without haze
    assert ours.intensity(ring).mean() == pytest.approx(hazed.intensity(ring).mean(), rel=0.3)
    with pytest.raises(ValueError, match="bounce limits"):
        tubes.with_answer(Answer(max_bounces=5))


def test_only_round_skylights_turn_without_tracing(folder: Path, tubes: Response) -> None:
    sun = sky_vector(50.0, 100.0)
    turned = tubes.turned(30.0)
    directions = vector(np.full(12, 35.0), np.arange(12) * 30.0)
    # the skylight and the sun turned together: the same light, turned
    other = tubes.sun(sky_vector(50.0, 130.0)).intensity(vector(np.full(12, 35.0), np.arange(12) * 30.0 - 30.0))
    assert turned.sun(sun).intensity(directions) == pytest.approx(other, rel=1e-9)
    with pytest.raises(ValueError, match="only a round"):
        response(box(), rays_per_node=1000, folder=folder).turned(10.0)


def test_the_bench_sums_sun_sky_and_room(tubes: Response, light: PerezLight) -> None:
    scan, honest = _scan(), SourceFaults().over(light)
    below = fields(tubes, honest, int(scan.times_ns.min()), int(scan.times_ns.max()))
    dark = Bench(RoomFaults(), ArmFaults()).light(below, honest, scan)
    assert np.all(dark.room == 0.0) and dark.sun.min() >= 0.0 < dark.sky.min()
    lit = Bench(RoomFaults(room=Room(walls=0.05, floor=0.02, ceiling=0.05)), ArmFaults()).light(below, honest, scan)
    assert lit.sun == pytest.approx(dark.sun)
    share = (lit.room / lit.total).reshape(16, 10).mean(axis=0)
    assert share[9] > 5.0 * share[0] > 0.0
    far = Bench(RoomFaults(), ArmFaults()).light(below, honest, _scan(20.0), far=True)
    near = Bench(RoomFaults(), ArmFaults()).light(below, honest, _scan(20.0))
    assert np.sum(near.total) == pytest.approx(np.sum(far.total), rel=0.05)


def test_a_spot_shades_or_mirrors_only_where_it_is(tubes: Response, light: PerezLight) -> None:
    scan, honest = _scan(), SourceFaults().over(light)
    below = fields(tubes, honest, int(scan.times_ns.min()), int(scan.times_ns.max()))
    clean = Bench(RoomFaults(), ArmFaults()).light(below, honest, scan).total.reshape(16, 10)
    for spot, sign in ((Spot(45.0, 90.0, 8.0, shade=0.5), -1.0), (Spot(45.0, 90.0, 8.0, mirror=0.5), 1.0)):
        seen = Bench(RoomFaults(spots=(spot,)), ArmFaults()).light(below, honest, scan).total.reshape(16, 10)
        change = sign * (seen - clean) / clean
        assert change[4, 5] == np.max(change) > 0.05
        assert np.abs(change[12]).max() < 1e-6


def test_stray_light_is_there_without_the_skylight(light: PerezLight) -> None:
    bench = Bench(RoomFaults(stray_lx=0.4, leak=1e-5, leak_c_deg=90.0), ArmFaults())
    stray = bench.stray(SourceFaults().over(light), _scan()).reshape(16, 10)
    assert stray.min() >= 0.4
    assert stray[4, 9] > stray[12, 9]


def test_heads_do_what_their_faults_say() -> None:
    level = np.array([1.0, 100.0, 900.0, 4000.0])
    assert bent(level, HeadFaults(curve=0.05)) == pytest.approx(level * (level / 1000.0) ** 0.05)
    assert bent(level, HeadFaults(curve=0.1, curve_form="parabola", curve_reference_lx=4000.0))[3] == pytest.approx(
        4400.0
    )
    steps = bent(level, HeadFaults(curve=0.01, curve_form="ranges")) / level
    assert np.all(np.diff(steps) >= 0.0) and steps[-1] > steps[0]
    for form in ("soft", "exponential", "clip", "knee"):
        short = ended(level, 1000.0, form)
        assert np.all(short <= np.minimum(level, 1000.0) + 1e-9) and np.all(np.diff(short) >= 0.0)
        assert short[0] == pytest.approx(level[0], rel=2e-3)
    for form in ("sine2", "quartic", "step"):
        at = angular_response(np.cos(np.radians([0.0, 60.0, 80.0])), 0.06, form)
        assert at[0] == pytest.approx(1.0, abs=1e-3)
        assert at[1] == pytest.approx(0.94, abs=1e-3)
        assert at[2] < at[1]
    with pytest.raises(ValueError, match="no such form"):
        ended(level, 1.0, "other")


def test_a_lag_remembers_and_forgets() -> None:
    value = np.array([0.0, 1.0, 1.0, 1.0, 1.0])
    late = lagging(value, np.arange(5) * 1.0, 1.0)
    assert late[1] == pytest.approx(1.0 - math.exp(-1.0))
    assert late[4] == pytest.approx(1.0 - math.exp(-4.0))


def test_readings_come_back_in_the_scans_layout(tubes: Response, light: PerezLight) -> None:
    scan, honest = _scan(), SourceFaults().over(light)
    times = scan.times_ns[::-1].copy()  # the last plane was visited first
    scan = replace(scan, times_ns=times)
    bench = Bench(RoomFaults(), ArmFaults())
    below = fields(tubes, honest, int(times.min()), int(times.max()))
    lit = bench.light(below, honest, scan)
    plain = readings(lit, np.zeros(160), bench.sensors(scan), scan, HeadFaults())
    assert plain == pytest.approx(lit.total)
    warm = readings(lit, np.zeros(160), bench.sensors(scan), scan, HeadFaults(warming_per_k=1.0, kelvin_per_hour=36.0))
    ratio = (warm / plain).reshape(16, 10)
    assert ratio[0, 9] > ratio[15, 0] == pytest.approx(1.0)
    gains = readings(lit, np.zeros(160), bench.sensors(scan), scan, HeadFaults(gains={3: 1.1}, dark_lx=0.5)) - 0.5
    assert (gains / plain).reshape(16, 10)[:, 3] == pytest.approx(np.full(16, 1.1))
    share = np.full(4, 0.9)
    blue = read(np.ones(4), share, np.arange(4), np.arange(4.0), HeadFaults(blue=0.1))
    assert blue == pytest.approx(np.full(4, 1.04))


def test_a_defect_only_takes() -> None:
    for defect, gap in ((Defect(sector_deg=(20.0, 130.0)), False), (Defect(gap_m=(0.2, 0.4)), True)):
        broken = with_defect(box(), defect, fogged=False)
        change = sun_change(broken, answers(False, gap), sky_vector(45.0, 100.0), 1)
        assert change.max() <= 1e-9 and change.min() < -0.05
    fogged = sun_change(
        with_defect(box(), Defect(sector_deg=(20.0, 130.0)), True), answers(True, False), sky_vector(45.0, 100.0), 1
    )
    assert fogged.min() < -0.05 and fogged.max() > 0.05  # scattered light comes out elsewhere


def _series(light: PerezLight) -> SkySeries:
    times = NOON + np.arange(-60, 61, 10) * 60 * NS
    return SkySeries(SourceFaults().over(light), times.astype(np.int64))


def test_a_level_meter_reads_the_horizontal_illuminance(light: PerezLight) -> None:
    series = _series(light)
    level = read_meter(series, MeterFaults(), SITE.longitude_deg, 0.2)
    assert level == pytest.approx(sum(series.parts()))
    assert series.parts()[1][6] == pytest.approx(18_800.0, rel=0.01)


def test_a_tilted_meter_favours_its_side(light: PerezLight) -> None:
    series = _series(light)
    level = read_meter(series, MeterFaults(), SITE.longitude_deg, 0.2)
    east, west = (
        read_meter(series, MeterFaults(tilt_deg=3.0, tilt_azimuth_deg=a), SITE.longitude_deg, 0.2)
        for a in (90.0, 270.0)
    )
    # 15:08 UTC: the sun stands in the east-south-east, 55 degrees high
    assert np.all(east > level) and np.all(west < level)
    beam = series.normal_lx * series.sun[:, 0] * math.sin(math.radians(3.0))
    assert east - west == pytest.approx(2.0 * beam, rel=0.25)  # the sky's own slope is the rest


def test_meters_have_their_other_faults(light: PerezLight) -> None:
    series = _series(light)
    level = read_meter(series, MeterFaults(), SITE.longitude_deg, 0.2)

    def ratio(**faults: object) -> np.ndarray:
        return read_meter(series, MeterFaults(**faults), SITE.longitude_deg, 0.2) / level  # type: ignore[arg-type]

    assert ratio(gain=1.03) == pytest.approx(np.full(13, 1.03))
    poor = ratio(heads=HeadFaults(response=0.05))
    assert np.all(poor < 1.0) and poor[0] < poor[-1]  # lower sun loses more
    assert ratio(heads=HeadFaults(end_lx=60_000.0, end_form="clip")).min() < 0.99
    shaded = ratio(shadow=(95.0, 105.0, 88.0))
    assert 0 < np.sum(shaded < 0.6) < 13
    dewy = ratio(dew=0.5, dew_until_s=3600.0)
    assert dewy[0] < 0.8 and dewy[-1] == pytest.approx(1.0)


def _scene(light: PerezLight) -> Scene:
    nodes = sky_nodes(39, (IDENTITY,))

    def look(directions: np.ndarray) -> np.ndarray:
        return light.luminance(directions, NOON)

    sun = light.sun(NOON)
    return Scene(nodes, look(nodes.directions), look, sun.direction, sun.normal_lx, 0.05)


def test_a_true_camera_reports_the_sky(light: PerezLight) -> None:
    directions = sky_vector(np.array([90.0, 60.0, 30.0, 10.0]), np.array([0.0, 200.0, 310.0, 20.0]))
    assert photograph(directions, _scene(light), CameraFaults()) == pytest.approx(light.luminance(directions, NOON))


def test_cameras_have_their_faults(light: PerezLight) -> None:
    directions = sky_vector(np.array([89.9, 60.0, 30.0, 10.0]), np.array([0.0, 200.0, 310.0, 20.0]))
    scene = _scene(light)
    plain = photograph(directions, scene, CameraFaults())
    dark_rim = photograph(directions, scene, CameraFaults(falloff=0.3)) / plain
    assert np.all(np.diff(dark_rim) < 0.0) and dark_rim[3] == pytest.approx(1.0 - 0.3 * (80.0 / 90.0) ** 2, rel=1e-3)
    veiled = photograph(directions, scene, CameraFaults(glare=0.05, glare_power=0.0)) / plain
    assert veiled[np.argmin(plain)] > 1.0  # what is dark gains
    blue = tinted(sky_vector(np.array([60.0, 60.0]), np.array([120.0, 290.0])), scene, 0.2)
    assert 1.0 < blue[0] < blue[1] < 1.2  # the sun stands near azimuth 104
    white = tinted(directions, replace(scene, overcast=1.0), 0.2)
    assert white == pytest.approx(np.ones(4))


def test_a_merge_of_a_true_bracket_is_exact_and_a_false_one_is_not() -> None:
    level = np.array([50.0, 800.0, 5000.0, 30_000.0, 150_000.0])
    assert merged(level, CameraFaults()) == pytest.approx(level)
    engraved = merged(level, CameraFaults(shutter=1.0, shutter_form="marked")) / level
    assert np.ptp(engraved) > 0.01 and np.all(np.abs(engraved - 1.0) < 0.08)
    steep = merged(level, CameraFaults(curve=0.05)) / level
    assert steep[2] == pytest.approx(1.0) and np.all(np.diff(steep) > 0.0)
    assert merged(np.array([1e6]), CameraFaults())[0] < 1e6  # beyond the shortest exposure


def test_a_projection_error_moves_the_middle_and_keeps_the_rim() -> None:
    seen = seen_direction(sky_vector(np.array([90.0, 45.0, 0.5]), np.zeros(3)), CameraFaults(projection=1.0))
    angles = np.degrees(np.arccos(seen[:, 2]))
    assert angles[0] == pytest.approx(0.0, abs=1e-6)
    assert angles[1] < 44.0  # equisolid: the middle of the picture is larger
    assert angles[2] == pytest.approx(89.5, abs=0.2)
