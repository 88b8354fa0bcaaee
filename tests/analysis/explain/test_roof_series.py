"""Series of a roof meter under broken cloud, and what keeps their explanation honest."""

import dataclasses
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, write_case
from analysis.cases.model import CaseFile, Records
from analysis.explain.answer import answer
from analysis.explain.families import UNREST, evenly_restless
from analysis.explain.fit import Fit, Fitter
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.sluggish import low_passed
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.mechanisms.timing import ClockOffset, _altitude_later
from analysis.explain.mismatch import explain
from analysis.explain.noise import blocks_of
from analysis.explain.readings import Readings, sun_at
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.explain.series import predicted_noise, quiet, unrest
from analysis.explain.sky_flux import ABOUT_DEG, RINGS_DEG, SkyFlux, _flux
from analysis.explain.wander import Wandering
from tests.analysis.explain.campaign import SITE, Floats
from tests.analysis.explain.roof import beam_and_sky

STEP_S = 600
DAYS = tuple(datetime(2010, 7, day, 13, 0, tzinfo=UTC) for day in (20, 21, 22))
COUNT = 40


def moments(late_s: float = 0.0) -> Floats:
    """Times of all readings [ns], ``late_s`` later; (120,)."""
    starts = np.array([int(d.timestamp()) for d in DAYS])
    return np.asarray((starts[:, None] + STEP_S * np.arange(COUNT) + late_s) * 1e9).ravel()


def cloud(moment_ns: Floats, per_root_min: float) -> Floats:
    """The beam's share that gets through: an even random walk by half minutes, the same whoever asks; (120,)."""
    rng = np.random.default_rng(5)
    t = (moment_ns / 1e9 - DAYS[0].timestamp()) / 30.0
    walk = np.cumsum(rng.normal(0.0, per_root_min * np.sqrt(0.5), int(t.max()) + 200))
    return np.asarray(1.0 / (1.0 + np.exp(-np.interp(t + 100.0, np.arange(len(walk)), walk - walk.mean()))))


def series(
    folder: Path, late_s: float = 0.0, per_root_min: float = 0.3, gain: float | Floats = 1.0, noise: float = 0.003
) -> Case:
    """A meter whose clock is wrong, with noise of a third of a per cent, beside a true one with its own ``noise``."""
    rng = np.random.default_rng(8)
    light, parts = [], None
    for late, scatter in ((0.0, noise), (late_s, 0.003)):
        at = moments(late)
        table = CaseFile.model_validate({"format": "labdaq-case/1", "site": SITE, **_facts()})
        altitude, _ = _sun(at)
        beam, sky = beam_and_sky(altitude)
        beam = beam * cloud(at, per_root_min)
        parts = parts or (beam, sky)
        light.append((beam + sky) * (1.0 + scatter * rng.normal(size=len(at))))
    assert parts is not None
    n = len(light[0])
    share = light[0] / (parts[0] + parts[1])
    records = Records(
        test=np.repeat(np.arange(len(DAYS)), COUNT),
        channel=np.zeros(n, dtype=np.int64),
        utc_ns=moments().astype(np.int64),
        gamma_deg=np.full(n, np.nan),
        c_deg=np.full(n, np.nan),
        measured=gain * light[1],
        uncertainty=0.003 * light[1],
        simulated=light[0],
        sun=parts[0] * share,
        sky=parts[1] * share,
    )
    return write_case(folder, table, records, replace=True)


def _facts() -> dict[str, object]:
    return {
        "channel": [{"id": "roof", "kind": "illuminance-meter", "quantity": "illuminance", "unit": "lx"}],
        "test": [
            {"id": f"D{k}", "start": d, "end": d + timedelta(seconds=STEP_S * COUNT), "sky": "partly-cloudy",
             "global_illuminance_lx": 60_000.0, "diffuse_illuminance_lx": 16_000.0}
            for k, d in enumerate(DAYS)
        ],
    }  # fmt: skip


def _sun(moment_ns: Floats) -> tuple[Floats, Floats]:
    from analysis.sky.sun import Site, sun_position

    place = Site(SITE["latitude_deg"], SITE["longitude_deg"], SITE["elevation_m"])
    seen = sun_position(moment_ns.astype(np.int64), place)
    return np.asarray(seen.altitude_deg), np.asarray(seen.azimuth_deg)


def test_scatter_under_broken_cloud_alone_is_no_clock(tmp_path: Path) -> None:
    """Ten minutes lie between readings: what the cloud did in 40 s scatters as two places do that are apart."""
    content = answer(explain(series(tmp_path / "case", late_s=40.0)))
    assert content["verdict"] == "unexplained"
    assert content["mechanisms"] == []


def test_a_clock_whose_offset_shows_is_told_with_what_the_cloud_did(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two minutes lie between readings: the series itself tells some of it."""
    monkeypatch.setattr(sys.modules[__name__], "STEP_S", 120)
    content = answer(explain(series(tmp_path / "case", late_s=70.0)))
    (first,) = content["mechanisms"]
    assert first["id"] == "clock-offset"
    told = first["parameters"]["offset_min"]
    assert abs(told["value"] - 70.0 / 60.0) < 2.0 * told["uncertainty"] < 4.0, "neither wrong nor without content"


def test_a_clock_an_hour_off_is_summer_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of series of three hours and twenty minutes: what was beyond their ends is known from the sun alone."""
    monkeypatch.setattr(sys.modules[__name__], "STEP_S", 300)
    content = answer(explain(series(tmp_path / "case", late_s=3600.0, per_root_min=0.05)))
    assert content["mechanisms"][0]["id"] == "clock-offset"
    assert content["mechanisms"][0]["parameters"]["offset_min"]["value"] == pytest.approx(60.0, abs=4.0)


def test_a_clock_told_by_its_scatter_does_not_hide_what_is_beside_it(tmp_path: Path) -> None:
    """Half a minute of the sun's way is little; what the cloud did in it is not, and an offset beside it is large."""
    search = Search(Fitter(Scene(Readings.of(series(tmp_path / "case")))))
    terms = tuple(terms_of(BY_ID[name], search.scene)[0] for name in ("clock-offset", "dark-offset"))
    fit = Fit(terms, np.array([0.3, -2000.0]), np.zeros(0), np.zeros((0, 2)))
    assert search.least_effect(Hypothesis(fit, 0.0)) < 0.005
    assert search.least_effect(Hypothesis(fit, 0.0, wanders=(Wandering(UNREST, 0.5),))) > 0.02


def test_two_true_clocks_are_left_alone(tmp_path: Path) -> None:
    """The prediction's own noise must not look like an offset: interpolating it away would gain."""
    assert answer(explain(series(tmp_path / "case")))["verdict"] == "no-mismatch"


def test_a_rail_in_the_beam_is_a_conjecture_and_no_name(tmp_path: Path) -> None:
    altitude, azimuth = _sun(moments())
    beam, sky = beam_and_sky(altitude)
    taken = 0.3 * np.clip(1.0 - np.abs(azimuth - 235.0) / 15.0, 0.0, 1.0) * beam / (beam + sky)
    content = answer(explain(series(tmp_path / "case", per_root_min=0.05, gain=1.0 - taken)))
    assert content["verdict"] == "unexplained" and content["mechanisms"] == []
    best = max((u for u in content["unnamed"] if "conjecture" in u), key=lambda u: float(u["nats"]))
    assert best["along"] == "shaded beam" and best["nats"] > 100.0
    assert content["mismatch"], "what differs is located"


def test_a_meter_that_follows_the_temperature_is_a_conjecture_and_no_name(tmp_path: Path) -> None:
    """The air lags behind the sun by some hours; the meter loses 0.6 % of its sensitivity with each kelvin."""
    altitude, _ = _sun(moments())
    warmth = np.zeros(COUNT * len(DAYS))
    for day in range(len(DAYS)):
        air = 16.0
        for k in range(COUNT):
            row = day * COUNT + k
            air += STEP_S / 9000.0 * (16.0 + 20.0 * np.sin(np.radians(altitude[row])) - air)
            warmth[row] = air
    content = answer(explain(series(tmp_path / "case", per_root_min=0.05, gain=1.0 - 0.006 * (warmth - 24.0))))
    assert content["verdict"] == "unexplained" and content["mechanisms"] == []
    assert max(content["unnamed"], key=lambda u: float(u["nats"]))["along"] == "warming meter"


@pytest.mark.slow
def test_dew_is_a_conjecture_and_no_name(tmp_path: Path) -> None:
    """In an hour and a half two thirds of the water are gone; only on one morning was there any."""
    since_h = (moments() - moments()[0]) / 3.6e12
    wet = np.where(since_h < 20.0, np.exp(-since_h / 1.5), 0.0)
    content = answer(explain(series(tmp_path / "case", per_root_min=0.05, gain=1.0 - 0.3 * wet)))
    assert content["verdict"] == "unexplained" and content["mechanisms"] == []
    assert max(content["unnamed"], key=lambda u: float(u["nats"]))["along"] == "dew on a meter"


def test_a_scene_keeps_the_last_value_only(tmp_path: Path) -> None:
    scene = Scene(Readings.of(series(tmp_path)))
    made: list[float] = []

    def level(_: Scene, at: float) -> Floats:
        made.append(at)
        return np.full(3, at)

    for at in (1.0, 1.0, 2.0, 2.0, 1.0):
        assert np.all(scene.remember_last(level, at) == at)
    assert made == [1.0, 2.0, 1.0]
    assert len(scene.memory) == 1


def test_a_gain_is_not_taken_for_a_clock(tmp_path: Path) -> None:
    (first,) = answer(explain(series(tmp_path / "case", gain=1.05)))["mechanisms"]
    assert first["id"] == "meter-gain"
    assert first["parameters"]["error"]["value"] == pytest.approx(0.05, abs=0.015)


def test_unrest_is_what_the_cloud_does_in_a_minute(tmp_path: Path) -> None:
    """ln of (beam + sky) walks by the walk's step times d ln / d walk, which is known where the cloud is."""
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=0.1)))
    r = scene.readings
    share = cloud(moments(), 0.1)
    expected = 0.1 * (1.0 - share) * r.sun / r.simulated
    assert np.sqrt(np.mean(unrest(scene) ** 2)) == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.35)


def test_no_unrest_under_a_clear_sky(tmp_path: Path) -> None:
    """What is left is the prediction's noise: three tenths of a per cent, twice differenced, over twenty minutes."""
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=0.0)))
    assert np.sqrt(np.mean(unrest(scene) ** 2)) < 1.5 * 0.003 * np.sqrt(6.0 / 20.0) + 0.002


def test_noise_is_told_from_cloud() -> None:
    """Independent noise goes to a sixth of its variance and less; a random walk of twenty times its size stays."""
    rng = np.random.default_rng(3)
    t = np.arange(400.0)
    noise = rng.normal(0.0, 1.0, 400)
    both = np.full(400, np.sqrt(2.0))  # what readings state: the prediction's noise and their own
    way = 1000.0 - 0.02 * (t - 200.0) ** 2
    assert np.var(quiet(t, way + noise, both) - way) < 0.25
    cloud = np.cumsum(rng.normal(0.0, 20.0, 400))
    assert np.std(quiet(t, cloud + noise, both) - cloud - noise) < 1.5


@pytest.mark.parametrize("minutes", [0.5, 1.5, -2.4])
def test_a_clock_takes_no_noise_off_a_prediction(tmp_path: Path, minutes: float) -> None:
    """Straight lines between points average neighbours: any other series would then agree better with the mean."""
    case = series(tmp_path / "case", per_root_min=0.0)
    scene = Scene(Readings.of(case))
    (way,) = [t for t in terms_of(ClockOffset(), scene) if t.branch.value == "series"]
    true, later = (np.array([0.5, 1.0]) @ np.stack(beam_and_sky(_sun(moments(s))[0])) for s in (0.0, minutes * STEP_S))
    moved = predict(scene, (way,), np.array([minutes * STEP_S / 60.0]))
    inner = np.tile((np.arange(COUNT) >= 5) & (np.arange(COUNT) < COUNT - 5), len(DAYS))
    before, after = np.std((scene.readings.simulated / true)[inner]), np.std((moved / later)[inner])
    assert 0.85 * before < after < 1.3 * before


@pytest.mark.parametrize("noise", [0.004, 0.009])
def test_a_second_instruments_noise_is_found_and_is_no_clock(tmp_path: Path, noise: float) -> None:
    """More than the readings state: what averages neighbours must not gain by it."""
    scene = Scene(Readings.of(series(tmp_path / "case", per_root_min=0.0, noise=noise)))
    assert np.median(predicted_noise(scene) / scene.readings.simulated) == pytest.approx(noise, rel=0.25)
    search = Search(Fitter(scene), mechanisms=[BY_ID["clock-offset"]], conjectures=())
    assert max(h.evidence for h in search.singles()) < search.nothing().evidence + 12.0


def test_the_noise_of_a_model_is_what_readings_state(tmp_path: Path) -> None:
    r = Readings.of(series(tmp_path / "case", per_root_min=0.0, noise=0.0))
    assert predicted_noise(Scene(r)) == pytest.approx(np.sqrt(0.5) * r.noise)


def test_of_four_readings_most_noise_is_taken_off() -> None:
    """Two second differences are often large by chance: only much larger ones are a cloud's."""
    t, rng = np.arange(4.0), np.random.default_rng(3)
    noise = rng.normal(size=(500, 4))
    kept = np.array([quiet(t, 100.0 + 2.0 * t + x, np.ones(4)) - 100.0 - 2.0 * t for x in noise])
    inner = np.sqrt(np.mean(np.square((kept[:, 1:] + kept[:, :-1]) / 2.0)))
    halfway = np.sqrt(np.mean(np.square((noise[:, 1:] + noise[:, :-1]) / 2.0)))
    assert inner > 0.8 * halfway  # what is smooth already loses nothing more halfway between readings
    assert np.sqrt(np.mean(np.square(np.diff(kept, n=2)))) < 0.45 * np.sqrt(6.0)
    cloud = np.array([0.0, 0.0, -60.0, -60.0])
    assert quiet(t, 100.0 + cloud, np.ones(4)) == pytest.approx(100.0 + cloud, abs=1.0)


@pytest.mark.parametrize("minutes", [0.0, 0.4, -7.3, 20.0, 61.8, -179.9])
def test_the_sun_between_every_tenth_minute(tmp_path: Path, minutes: float) -> None:
    scene = Scene(Readings.of(series(tmp_path / "case")))
    r = scene.readings
    then = sun_at(r.case, r.utc_ns + np.int64(round(minutes * 60e9)))[0]
    up = then > 2.0  # refraction near the horizon is no cubic
    assert _altitude_later(scene, minutes)[up] == pytest.approx(then[up], abs=2e-3)


def test_a_low_pass_lags_a_ramp_and_settles_after_a_step() -> None:
    t = np.arange(40.0)
    assert low_passed(t, 5.0 + 2.0 * t, 3.0) == pytest.approx(5.0 + 2.0 * (t - 3.0))
    step = np.where(t >= 10.0, 1.0, 0.0)
    made = low_passed(t, step, 3.0)
    assert made[20] == pytest.approx(1.0 - (1.0 - made[10]) * np.exp(-10.0 / 3.0))
    assert made[39] == pytest.approx(1.0, abs=1e-3)


def test_a_cloud_between_the_first_two_readings_is_no_trend() -> None:
    t = np.arange(40.0)
    passing = np.where(t == 0.0, 0.2, 1.0)
    assert 0.0 < low_passed(t, passing, 10.0)[0] < passing[0] + 0.1


@pytest.mark.slow
def test_a_slow_meter_is_a_conjecture_and_no_name(tmp_path: Path) -> None:
    """The mean of the light of each minute of the last two hours, the older the less."""
    ages, lag_min = np.arange(0.0, 120.0), 12.0
    weights = np.exp(-ages / lag_min) / np.sum(np.exp(-ages / lag_min))

    def light(late_s: float) -> Floats:
        at = moments(late_s)
        beam, sky = beam_and_sky(_sun(at)[0])
        return beam * cloud(at, 0.05) + sky

    followed = sum(w * light(-60.0 * age) for age, w in zip(ages, weights, strict=True))
    content = answer(explain(series(tmp_path / "case", per_root_min=0.05, gain=followed / light(0.0))))
    assert content["verdict"] == "unexplained" and content["mechanisms"] == []
    best = max(content["unnamed"], key=lambda u: float(u["nats"]))
    assert best["along"] == "sluggish response"
    assert best["size"] == pytest.approx(lag_min, rel=0.25)


def test_a_day_is_one_block_and_days_are_not_remembered(tmp_path: Path) -> None:
    readings = Readings.of(series(tmp_path / "case"))
    assert [len(b.rows) for b in blocks_of(readings)] == [COUNT] * len(DAYS)


@pytest.mark.parametrize(("height", "normal"), [(20.0, 60_000.0), (50.0, 90_000.0), (75.0, 20_000.0)])
def test_the_sky_on_a_level_meter_is_that_of_its_rings(height: float, normal: float) -> None:
    """Shares add up; the sunward flow, and what comes from about the sun, are those of a plain grid of directions."""
    from analysis.sky.perez import PerezSky

    shares, sunward, about = _flux(height, normal, 15_000.0)
    zenith, round_ = np.meshgrid(np.radians(np.arange(0.25, 90.0, 0.5)), np.radians(np.arange(0.5, 360.0, 1.0)))
    v = np.stack([np.sin(zenith) * np.sin(round_), np.sin(zenith) * np.cos(round_), np.cos(zenith)], axis=-1)
    flow = PerezSky.from_illuminances(normal, 15_000.0, height, 0.0).luminance(v) * np.sin(zenith)
    assert shares.sum() == pytest.approx(1.0, abs=1e-6)
    assert sunward == pytest.approx(float(np.sum(flow * v[..., 1]) / np.sum(flow * v[..., 2])), abs=0.02)
    level = flow * v[..., 2]
    sun = np.array([0.0, np.cos(np.radians(height)), np.sin(np.radians(height))])
    near = float(level[v @ sun > np.cos(np.radians(ABOUT_DEG))].sum() / level.sum())
    assert about == pytest.approx(near, rel=0.08) and about > (1.0 - np.cos(np.radians(ABOUT_DEG)))
    low = float(level[zenith > np.radians(60.0)].sum() / level.sum())
    assert shares[RINGS_DEG > 60.0].sum() == pytest.approx(low, abs=0.01)


def test_no_beam_no_sunward_flow_to_speak_of(tmp_path: Path) -> None:
    """Under an overcast sky the flow comes from above, and what is unknown is an even sky."""
    assert abs(_flux(50.0, 0.0, 20_000.0)[1]) < 0.06
    readings = Readings.of(series(tmp_path / "case"))
    flux = SkyFlux.of(readings)
    assert flux.sunward.min() > -0.05 and flux.sunward.max() < 1.0
    assert sun_at(readings.case, readings.utc_ns)[0].min() > 5.0  # the case has no night


def test_a_few_shadows_are_no_clock(tmp_path: Path) -> None:
    """Three deep shadows under broken cloud scatter as much in all as an offset, but leave the other readings alone."""
    case = series(tmp_path / "case")
    measured = case.records.measured.copy()
    measured[[17, 58, 97]] *= 0.5
    shaded = dataclasses.replace(case, records=dataclasses.replace(case.records, measured=measured))
    content = answer(explain(shaded))
    assert "clock-offset" not in {m["id"] for m in content["mechanisms"]}
    scene = Scene(Readings.of(shaded))
    residual = scene.readings.stretched(scene.readings.measured) - scene.readings.stretched(scene.readings.simulated)
    assert not evenly_restless(scene, residual, 0.5)
