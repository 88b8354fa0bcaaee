"""The reduction of goniometer readings: known truth in, the same truth out, and every decision told."""

import numpy as np
import pytest

from analysis.photometry.closing import Row90
from analysis.photometry.lm63 import FileGeneration, parse_lm63, render_lm63
from analysis.photometry.readings import Calibration, DarkReadings, GonioReadings, RoofReadings
from analysis.photometry.reduce import reduce_readings
from analysis.photometry.reduction import ReductionOptions
from labdaq.errors import DataError

GAMMAS = np.array([0, 5, 15, 25, 35, 45, 55, 65, 75, 85.0])
PLANES = np.arange(16) * 22.5
DISTANCE = 2.6
CERTIFICATE = {"TEST": "27", "TESTLAB": "here", "ISSUEDATE": "2010-07-22", "MANUFAC": "none"}


def truth(gamma: np.ndarray, c: np.ndarray) -> np.ndarray:
    """An intensity [cd] that is single-valued at the nadir."""
    return 800 * np.cos(np.radians(gamma)) * (1 + 0.6 * np.sin(np.radians(gamma)) * np.cos(np.radians(c - 110)))


def scan(noise: float = 0.0, seed: int = 0, drift: float = 0.2, dark: float = 0.0, gains: np.ndarray | None = None):
    """Sixteen planes of ten sensors in 150 s while the daylight falls by ``drift``; and the roof's readings."""
    rng = np.random.default_rng(seed)
    c, gamma = (a.ravel() for a in np.meshgrid(PLANES, GAMMAS, indexing="ij"))
    sensor = np.tile(np.arange(10), 16)
    time = np.repeat(np.linspace(5, 145, 16), 10) + 0.1 * sensor
    light = 1 - drift * (time / 150) ** 2
    lux = truth(gamma, c) / DISTANCE**2 * light * (1 + noise * rng.standard_normal(160))
    lux = lux / (np.ones(10) if gains is None else gains)[sensor] + dark * (1 + sensor)
    t = np.arange(0, 155, 5.0)
    roof = RoofReadings(time_s=t, lux=90_000 * (1 - drift * (t / 150) ** 2))
    return GonioReadings.of(gamma, c, lux, time, sensor, np.full(160, noise * 20 + 1e-3)), roof, light


def dark_readings(dark: float, noise: float = 0.0) -> DarkReadings:
    rng = np.random.default_rng(1)
    sensor = np.repeat(np.arange(10), 4)
    return DarkReadings(sensor=sensor, lux=dark * (1 + sensor) + noise * rng.standard_normal(40))


def test_all_effects_come_off() -> None:
    gains = np.linspace(0.95, 1.05, 10)
    readings, roof, light = scan(dark=0.3, gains=gains)
    result = reduce_readings(
        readings, roof, dark=dark_readings(0.3),
        calibration=Calibration(factor=gains, relative_uncertainty=np.full(10, 0.005), certificate="K-17"),
    )  # fmt: skip
    d = result.distribution
    expected = truth(GAMMAS, PLANES[:, None]) * light.mean()
    # the roof's parabola between readings 5 s apart: 0.2 (5/150)^2 / 8 = 3e-5 of the value
    assert d.candela[:-1, :10] == pytest.approx(expected, rel=5e-5)
    assert result.reference_lx == pytest.approx(90_000 * light.mean(), rel=1e-4)
    assert result.normalisation == pytest.approx(light.mean() / light, rel=1e-4)
    text = " | ".join(result.decisions)
    for word in ("dark readings of 0.3 to 3", "K-17", "normalised to", "near-field", "16 nadir readings", "gamma 90"):
        assert word in text


def test_without_normalisation_the_drift_would_stay() -> None:
    """The test of the test: a constant roof reading leaves the daylight's fall in the C-planes."""
    readings, roof, _ = scan()
    still = RoofReadings(time_s=roof.time_s, lux=np.full(roof.lux.size, 90_000.0))
    d = reduce_readings(readings, still).distribution
    ratio = d.candela[-2, 5] / truth(np.array(45.0), PLANES[-1])
    assert ratio == pytest.approx(1 - 0.2 * (145.5 / 150) ** 2, rel=1e-6)


def test_near_field_is_said_everywhere() -> None:
    readings, roof, _ = scan()
    result = reduce_readings(readings, roof, keywords=CERTIFICATE)
    assert result.file_name("test-27") == "test-27-near-2.60m.ies"
    data = render_lm63(result.distribution, generation=result.generation)
    back = parse_lm63(data)
    assert back.oddities == ()
    assert back.generation is FileGeneration.MEASURED_INTERPOLATED
    assert back.distribution.keywords["NEARFIELD"] == "2.6 2.6 2.6"
    assert back.distribution.keywords["_FIELD"] == "near"
    assert "far" not in data.decode().lower()
    assert back.distribution.keywords["_ROW90"] == "zero, not measured"


def test_row_90_and_generation() -> None:
    readings, roof, _ = scan()
    open_end = reduce_readings(readings, roof, options=ReductionOptions(row_90=None))
    assert open_end.distribution.gamma_deg[-1] == 85
    assert open_end.generation is FileGeneration.MEASURED
    line = reduce_readings(readings, roof, options=ReductionOptions(row_90=Row90.EXTRAPOLATED))
    last = line.distribution.candela
    assert last[:, -1] == pytest.approx(np.maximum(0, 1.5 * last[:, -2] - 0.5 * last[:, -3]))
    assert (line.uncertainty_cd[:, -1] > line.uncertainty_cd[:, -2]).all()
    assert (line.count[:, -1] == 0).all()


def test_uncertainty_covers_the_truth() -> None:
    """Over repeated noisy scans, the error in units of the stated standard uncertainty has rms one."""
    pulls = []
    noise = 0.01
    for seed in range(40):
        readings, roof, light = scan(noise=noise, seed=seed)
        stated = noise * readings.lux
        readings = GonioReadings.of(
            readings.gamma_deg, readings.c_deg, readings.lux, readings.time_s, readings.sensor, stated
        )
        exact = RoofReadings(time_s=roof.time_s, lux=roof.lux, relative_repeatability=0.0)
        options = ReductionOptions(distance_uncertainty_m=0.0, angle_uncertainty_deg=0.0, reject_outliers=False)
        result = reduce_readings(readings, exact, options=options)
        expected = truth(GAMMAS, PLANES[:, None]) * light.mean()
        pulls.append(((result.distribution.candela[:-1, :10] - expected) / result.uncertainty_cd[:-1, :10])[:, 1:])
    # 40 x 144 pulls: the rms of a unit normal has a standard error of 1/sqrt(2 n) = 0.9 %
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.04)
    # sixteen nadir readings are one, four times better
    assert result.uncertainty_cd[0, 0] == pytest.approx(0.01 * 800 / 4, rel=0.5)


def test_budget_adds_up() -> None:
    readings, roof, _ = scan(noise=0.01)
    options = ReductionOptions(distance_uncertainty_m=0.013)
    result = reduce_readings(readings, roof, options=options, dark=dark_readings(0.0, 0.02))
    assert set(result.budget) == {"readings", "dark", "daylight", "distance", "angle"}
    total = np.sqrt(sum(part**2 for part in result.budget.values()))
    assert result.uncertainty_cd == pytest.approx(total)
    assert result.budget["distance"] == pytest.approx(0.01 * result.distribution.candela)  # 2 x 0.5 %
    assert result.uncertainty_cd.shape == result.distribution.candela.shape == result.count.shape


def test_a_nadir_spike_is_left_out_and_told() -> None:
    """The report's test 15 shows a spike at nadir; among sixteen readings one stands out."""
    readings, roof, light = scan(noise=0.003)
    lux = readings.lux.copy()
    lux[30] *= 3
    spiked = GonioReadings.of(readings.gamma_deg, readings.c_deg, lux, readings.time_s, readings.sensor)
    result = reduce_readings(spiked, roof)
    assert result.distribution.candela[0, 0] == pytest.approx(800 * light.mean(), rel=0.005)
    assert result.count[0, 0] == 15
    assert any("outlier left out at gamma 0" in d for d in result.decisions)
    kept = reduce_readings(spiked, roof, options=ReductionOptions(reject_outliers=False))
    assert kept.distribution.candela[0, 0] > 1.1 * 800 * light.mean()


@pytest.mark.parametrize(("sigmas", "kept"), [(2.0, 16), (12.0, 15)])
def test_only_what_is_far_from_the_others_is_an_outlier(sigmas: float, kept: int) -> None:
    noise = 0.01
    readings, roof, _ = scan()
    lux = readings.lux.copy()
    nadir = np.arange(0, 160, 10)
    # sixteen values with a known spread: the quantiles of a normal distribution, the last one moved off
    quantiles = np.array([-1.5, -1.15, -0.9, -0.7, -0.5, -0.3, -0.15, 0, 0, 0.15, 0.3, 0.5, 0.7, 0.9, 1.15, sigmas])
    lux[nadir] *= 1 + noise * quantiles
    result = reduce_readings(GonioReadings.of(readings.gamma_deg, readings.c_deg, lux, readings.time_s), roof)
    assert result.count[0, 0] == kept


def test_missing_directions() -> None:
    readings, roof, _ = scan()
    lux = readings.lux.copy()
    lux[[23, 47, 51]] = np.nan  # (C 45, gamma 25), (C 90, gamma 65), (C 112.5, gamma 5)
    holed = GonioReadings.of(readings.gamma_deg, readings.c_deg, lux, readings.time_s, readings.sensor)
    with pytest.raises(DataError) as caught:
        reduce_readings(holed, roof)
    for place in ("gamma 25, C 45", "gamma 65, C 90", "gamma 5, C 112.5"):
        assert place in str(caught.value)
    result = reduce_readings(holed, roof, options=ReductionOptions(fill_missing=True, row_90=None, reference_lx=90e3))
    filled = result.distribution.candela[2, 3]
    neighbours = truth(np.array(25.0), PLANES[[1, 3]])
    assert filled == pytest.approx(neighbours.mean(), rel=1e-4)
    assert result.uncertainty_cd[2, 3] >= 0.5 * abs(np.diff(neighbours)[0]) * 0.99
    assert result.count[2, 3] == 0
    assert result.generation is FileGeneration.MEASURED_INTERPOLATED


def test_a_missing_first_or_last_plane_is_filled_around_the_circle() -> None:
    readings, roof, _ = scan()
    lux = readings.lux.copy()
    lux[[5, 155]] = np.nan  # gamma 45 in C 0 and C 337.5
    holed = GonioReadings.of(readings.gamma_deg, readings.c_deg, lux, readings.time_s, readings.sensor)
    d = reduce_readings(holed, roof, options=ReductionOptions(fill_missing=True, reference_lx=90e3)).distribution
    low, high = truth(np.array(45.0), np.array([315.0, 22.5]))
    assert d.at(45, 337.5) == pytest.approx(low + (high - low) / 3, rel=1e-4)
    assert d.at(45, 0) == pytest.approx(low + (high - low) * 2 / 3, rel=1e-4)


def test_a_repeated_plane_is_averaged() -> None:
    readings, roof, _ = scan(drift=0.1)
    again = slice(0, 10)
    doubled = GonioReadings.of(
        np.append(readings.gamma_deg, readings.gamma_deg[again]), np.append(readings.c_deg, np.full(10, 360.0)),
        np.append(readings.lux, readings.lux[again] * 1.02), np.append(readings.time_s, readings.time_s[again]),
        np.append(readings.sensor, readings.sensor[again]),
    )  # fmt: skip
    result = reduce_readings(doubled, roof, options=ReductionOptions(reference_lx=90_000.0))
    assert result.distribution.candela[0, 5] == pytest.approx(1.01 * truth(np.array(45.0), np.array(0.0)), rel=1e-4)
    assert result.count[0, 5] == 2
    assert result.count[1, 5] == 1


def test_what_is_refused() -> None:
    readings, roof, _ = scan()
    off = readings.c_deg.copy()
    off[17] += 5
    with pytest.raises(DataError, match=r"reading 17: C = 27.5 is 5.00 degrees off"):
        reduce_readings(GonioReadings.of(readings.gamma_deg, off, readings.lux, readings.time_s), roof)
    short = RoofReadings(time_s=roof.time_s[:10], lux=roof.lux[:10])
    with pytest.raises(DataError, match="s without one during the scan"):
        reduce_readings(readings, short)
    with pytest.raises(DataError, match=r"no dark reading of sensor.s. 3"):
        reduce_readings(readings, roof, dark=DarkReadings(sensor=np.delete(np.arange(10), 3), lux=np.zeros(9)))
    with pytest.raises(DataError, match="sensor 9 has no calibration factor"):
        reduce_readings(readings, roof, calibration=Calibration(factor=np.ones(9), relative_uncertainty=np.ones(9)))
    with pytest.raises(DataError, match="positive"):
        RoofReadings(time_s=np.arange(3.0), lux=np.array([1, 0, 1.0]))
    with pytest.raises(DataError, match=r"(?s)c_deg.*time_s"):
        GonioReadings.of([0, 5], [0], [1, 2], [np.nan, 1])
    with pytest.raises(DataError, match="distance_m"):
        ReductionOptions(distance_m=0.0)
    with pytest.raises(DataError, match="no reading"):
        GonioReadings.of([], [], [], [])


def test_negative_after_dark_is_clipped_and_told() -> None:
    readings, roof, _ = scan()
    result = reduce_readings(readings, roof, dark=DarkReadings(sensor=np.arange(10), lux=np.full(10, 12.0)))
    assert result.distribution.candela.min() == 0
    assert any("negative intensities set to 0" in d for d in result.decisions)
