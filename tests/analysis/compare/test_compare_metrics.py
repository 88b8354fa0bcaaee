"""What a comparison says in numbers: conservation, bounds, known lobes, and uncertainties against brute force."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from analysis.cases import Case, Records, write_case
from analysis.cases.model import CaseFile
from analysis.compare.metrics import compare
from analysis.compare.peaks import Peak, find_peaks, match_peaks
from analysis.compare.scan import Scan, scan_of
from analysis.compare.shape import agreement, rings
from analysis.compare.simulations import simulations
from analysis.photometry import Distribution
from labdaq import directions
from labdaq.errors import DataError
from tests.analysis.compare.light import GAMMAS, PLANES, Intensity, distribution, lobe, on_arm, sky_part, write_ies


def _case(folder: Path, tests: dict[str, tuple[Intensity, Intensity]], *, noise: float = 0.005, **more: object) -> Case:
    """Tests by id, each recorded under the first light and predicted by the second."""
    gamma, c = (a.ravel() for a in np.meshgrid(GAMMAS, PLANES))
    n = len(gamma)
    measured = np.concatenate([m(gamma, c) for m, _ in tests.values()])
    predicted = np.concatenate([s(gamma, c) for _, s in tests.values()])
    channels = [
        {"id": f"gonio.g{g:g}", "kind": "goniometer", "quantity": "luminous_intensity", "unit": "cd"} for g in GAMMAS
    ]
    setup = CaseFile.model_validate(
        {
            "format": "labdaq-case/1",
            "channel": channels,
            "test": [{"id": i, "system": i[0], "sky": "clear"} for i in tests],
            **more,
        }
    )
    unknown = np.full(n * len(tests), np.nan)
    records = Records(
        test=np.repeat(np.arange(len(tests)), n),
        channel=np.tile(np.searchsorted(GAMMAS, gamma), len(tests)),
        utc_ns=np.full(len(unknown), -1),
        gamma_deg=np.tile(gamma, len(tests)),
        c_deg=np.tile(c, len(tests)),
        measured=measured,
        uncertainty=noise * measured,
        simulated=predicted,
        sun=unknown,
        sky=unknown,
    )
    return write_case(folder, setup, records)


def _scan(of: Intensity, folder: Path) -> Scan:
    case = _case(folder, {"T1": (of, of)})
    scan = scan_of(case, 0, simulations(case))
    assert scan is not None
    return scan


def test_solid_angles_and_flux_are_those_of_the_sphere(tmp_path: Path) -> None:
    scan = _scan(sky_part, tmp_path / "c")
    assert len(scan.gamma) == 1 + 9 * 16
    assert scan.solid_angle.sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(85.0))), rel=1e-12)
    closed = on_arm(sky_part)
    upto85 = Distribution(closed.gamma_deg[:-1], closed.c_deg, closed.candela[:, :-1])
    assert scan.solid_angle @ scan.measured == pytest.approx(upto85.flux(), rel=1e-12)
    lopsided = _scan(lobe(35.0, 90.0, 4000.0), tmp_path / "d")
    closed = on_arm(lobe(35.0, 90.0, 4000.0))
    upto85 = Distribution(closed.gamma_deg[:-1], closed.c_deg, closed.candela[:, :-1])
    assert lopsided.solid_angle @ lopsided.measured == pytest.approx(upto85.flux(), rel=1e-12)


def test_a_half_plane_is_read_on_and_between_planes(tmp_path: Path) -> None:
    beam = lobe(35.0, 90.0, 4000.0)
    scan = _scan(beam, tmp_path / "c")
    for c in (0.0, 45.0, 337.5, 360.0):
        np.testing.assert_allclose(scan.along(scan.measured, c), beam(np.array(GAMMAS), np.array(c)))
    half = (beam(np.array(GAMMAS), np.array(337.5)) + beam(np.array(GAMMAS), np.array(0.0))) / 2
    np.testing.assert_allclose(scan.along(scan.measured, 348.75), half)


intensities = st.lists(st.floats(0.0, 1e5), min_size=12, max_size=12).map(np.array)
ANGLES = np.linspace(0.05, 0.4, 12)


@given(intensities, intensities, st.floats(1e-3, 1e3))
def test_the_shape_difference_is_a_distance_that_knows_no_scale(a: np.ndarray, b: np.ndarray, k: float) -> None:
    assume(a.sum() > 1.0 and b.sum() > 1.0)
    none = np.zeros(12)
    there, back = agreement(a, none, b, ANGLES), agreement(b, none, a, ANGLES)
    scaled, same = agreement(a, none, k * b, ANGLES), agreement(a, none, k * a, ANGLES)
    assert there is not None
    assert back is not None
    assert scaled is not None
    assert same is not None
    assert -1e-12 <= there.shape_difference <= 1 + 1e-12
    assert there.shape_difference == pytest.approx(back.shape_difference, abs=1e-9)
    assert scaled.shape_difference == pytest.approx(there.shape_difference, abs=1e-9)
    assert scaled.flux_ratio == pytest.approx(k * there.flux_ratio, rel=1e-9)
    assert same.shape_difference == pytest.approx(0.0, abs=1e-9)
    assert same.rms_scaled_percent == pytest.approx(0.0, abs=1e-4)
    assert same.scale == pytest.approx(1 / k)


def test_light_that_goes_elsewhere_is_counted_as_such() -> None:
    a, b = np.array([1.0, 0.0, 3.0, 0.0]), np.array([0.0, 5.0, 0.0, 0.0])
    even = np.ones(4)
    apart = agreement(a, np.zeros(4), b, even)
    assert apart is not None
    assert apart.shape_difference == 1.0
    # a quarter of the light moved
    moved = agreement(np.array([1.0, 1, 1, 1]), np.zeros(4), np.array([0.0, 2, 1, 1]), even)
    assert moved is not None
    assert moved.shape_difference == pytest.approx(0.25)
    assert moved.flux_ratio == 1.0
    assert moved.rms_percent == pytest.approx(100 * np.sqrt(2) / 2)
    assert agreement(a, np.zeros(4), 0 * a, even) is None
    assert agreement(a * np.nan, np.zeros(4), a, even) is None


def test_uncertainties_are_those_of_repeated_noise() -> None:
    """Against 20 000 noisy recordings; their own scatter leaves 0.5 % on a standard deviation and we allow 5 %."""
    rng = np.random.default_rng(1)
    truth = rng.uniform(50, 1000, 60)
    simulated = truth * rng.uniform(0.7, 1.3, 60)
    noise, angle = 0.01 * truth + 1.0, rng.uniform(0.01, 0.1, 60)
    told = agreement(truth, noise, simulated, angle)
    assert told is not None
    drawn = [
        (a.shape_difference, a.flux_ratio)
        for a in (agreement(truth + noise * rng.normal(size=60), noise, simulated, angle) for _ in range(20_000))
        if a is not None
    ]
    shape, ratio = np.array(drawn).T
    assert told.shape_uncertainty == pytest.approx(shape.std(), rel=0.05)
    assert told.flux_ratio_uncertainty == pytest.approx(ratio.std(), rel=0.05)
    same = [
        a.shape_difference
        for a in (agreement(truth + noise * rng.normal(size=60), noise, truth, angle) for _ in range(2_000))
        if a is not None
    ]
    # the flux is normalised, which takes one of 60 degrees of freedom out of the noise
    assert told.shape_noise == pytest.approx(np.mean(same), rel=0.05)


def test_chi2_is_one_for_a_right_prediction() -> None:
    rng = np.random.default_rng(2)
    truth = rng.uniform(50, 1000, 4000)
    noise = 0.02 * truth
    told = agreement(truth + noise * rng.normal(size=4000), noise, truth, np.ones(4000))
    assert told is not None
    assert told.chi2_per_direction == pytest.approx(1.0, abs=4 * np.sqrt(2 / 4000))
    unknown = agreement(truth, 0 * noise, truth, np.ones(4000))
    assert unknown is not None
    assert np.isnan(unknown.chi2_per_direction)


def test_rings_tell_the_difference_against_gamma() -> None:
    gamma = np.repeat([0.0, 45.0, 85.0], [1, 4, 4])
    measured = np.array([100.0, 10, 20, 30, 40, 0, 0, 0, 0])
    simulated = np.array([90.0, 12, 20, 30, 48, 1, 1, 1, 1])
    found = rings(gamma, measured, np.ones(9), simulated)
    np.testing.assert_allclose(found.percent[:2], [-10.0, 10.0])
    np.testing.assert_allclose(found.uncertainty[:2], [0.9, 1.1 * 2.0])  # 2 cd in 100 cd, times 110/100
    np.testing.assert_allclose((found.lowest[1], found.highest[1]), (0.0, 20.0), atol=1e-12)
    assert np.isnan(found.percent[2])


@settings(max_examples=80, deadline=None)
@given(st.floats(0.0, 70.0), st.floats(0.0, 360.0), st.floats(14.0, 30.0))
def test_a_lobe_is_found_between_the_directions_that_were_read(at_gamma: float, at_c: float, width: float) -> None:
    """A Gaussian lobe is a parabola in the logarithm, but for the sphere's curvature over the neighbours.

    That curvature was seen to cost up to 6e-4 degrees and 2e-5 of the height on the arm's grid of 10 by 22.5.
    """
    centre = directions.vector(at_gamma, at_c)

    def bare(gamma: np.ndarray, c: np.ndarray) -> np.ndarray:
        angle = directions.angle_between(directions.vector(gamma, c), centre)
        return 1000.0 * np.exp(-0.5 * (angle / width) ** 2)

    scan = _grid(bare)
    found = find_peaks(scan, scan.measured, 0.001 * scan.measured)
    assert len(found) == 1
    off = directions.angle_between(directions.vector(found[0].gamma_deg, found[0].c_deg), centre)
    assert off < 0.01
    assert found[0].candela == pytest.approx(1000.0, rel=1e-3)
    assert found[0].prominence_candela <= 1000.0


def _grid(of: Intensity) -> Scan:
    """The arm's directions without a case around them."""
    gamma = np.concatenate([[0.0], np.tile(GAMMAS[1:], 16)])
    c = np.concatenate([[0.0], np.repeat(PLANES, 9)])
    cell = np.column_stack([np.zeros(16, dtype=np.int64), 1 + np.arange(144).reshape(16, 9)])
    values = of(gamma, c)
    return Scan(np.array(GAMMAS), np.array(PLANES), cell, gamma, c, values, 0 * values, np.ones(145), {})


def test_two_lobes_are_two_peaks_and_noise_is_none() -> None:
    two = _grid(lambda g, c: sky_part(g, c) + lobe(35, 90, 4000, 10)(g, c) + lobe(45, 270, 2500, 10)(g, c))
    found = find_peaks(two, two.measured, 0.005 * two.measured)
    assert [(round(p.gamma_deg, -1), round(p.c_deg / 22.5) * 22.5) for p in found] == [(30.0, 90.0), (40.0, 270.0)]
    rng = np.random.default_rng(3)
    for _ in range(50):
        values = two.measured * (1 + 0.02 * rng.normal(size=145))
        assert len(find_peaks(two, values, 0.02 * values)) == 2
    dark = find_peaks(two, 0 * two.measured, two.measured)
    assert dark == []


def test_the_report_s_mirrored_peak_is_not_taken_for_the_recorded_one() -> None:
    """Report, figure 79: "they all seem to mirror the measured data with the peak on the opposite side"."""

    def peak(gamma: float, c: float, height: float = 100.0) -> Peak:
        return Peak(gamma, c, height, height)

    pairs = match_peaks([peak(45, 90)], [peak(35, 270)])
    assert [(p.measured is None, p.simulated is None) for p in pairs] == [(False, True), (True, False)]
    pairs = match_peaks([peak(45, 90), peak(35, 270, 200)], [peak(40, 270), peak(55, 90)])
    assert [round(p.apart_deg or 0, 6) for p in pairs] == [10.0, 5.0]
    # the nearest belong together, not the first
    pairs = match_peaks([peak(20, 0), peak(40, 0)], [peak(35, 0)])
    assert pairs[0].simulated is None
    assert pairs[1].apart_deg == pytest.approx(5.0)


def test_any_number_of_simulations_stand_against_one_recording(tmp_path: Path) -> None:
    beam = lobe(35.0, 90.0, 4000.0)
    turned = lobe(35.0, 180.0, 4000.0)
    tests = {"box-1": (beam, lambda g, c: 1.1 * beam(g, c)), "top-1": (sky_part, sky_part)}
    write_ies(tmp_path / "turned.ies", distribution(turned))
    case = _case(tmp_path / "a", tests)
    other = replace(case, setup=case.setup.model_copy(update={"simulation": type(case.setup.simulation)(engine="B")}))
    rows = case.records.test == 0
    records = replace(case.records, simulated=0.5 * case.records.simulated).where(rows)
    other = Case(tmp_path / "b", other.setup.model_copy(update={"test": case.setup.test[:1]}), records)
    found = compare(case, [other])
    assert [s.name for s in found.simulations] == ["simulation", "B"]
    box, top = found.tests
    assert set(box.against) == {"simulation", "B"}
    assert set(top.against) == {"simulation"}  # the other case does not hold this test
    assert box.against["simulation"].agreement.flux_ratio == pytest.approx(1.1)
    assert box.against["B"].agreement.flux_ratio == pytest.approx(0.55)
    assert box.against["B"].agreement.shape_difference == pytest.approx(0.0, abs=1e-12)
    labels = [(g.label, g.simulation, len(g.tests)) for g in found.groups]
    assert labels == [
        ("all tests", "simulation", 2),
        ("all tests", "B", 1),
        ("system b", "simulation", 1),
        ("system b", "B", 1),
        ("system t", "simulation", 1),
        ("sky clear", "simulation", 2),
        ("sky clear", "B", 1),
    ]
    together = found.groups[0]
    assert together.flux_ratio == pytest.approx(1.05)
    np.testing.assert_allclose(together.rings.percent, 5.0)
    np.testing.assert_allclose(together.rings.highest, 10.0)
    stranger = Case(tmp_path / "c", other.setup, records.where(np.zeros(len(records), bool)))
    with pytest.raises(DataError, match="shares no record"):
        compare(case, [stranger])


def test_rivals_and_variants_of_a_case_are_simulations_too(tmp_path: Path) -> None:
    beam, turned = lobe(35.0, 90.0, 4000.0), lobe(35.0, 180.0, 4000.0)
    file = {"total": "simulated/turned.ies"}
    more = {
        "rival": [{"name": "Rival", "simulated": {"T1": file}}],
        "variant": [{"mechanism": "lens-orientation", "setting": {"rotation_deg": 90.0}, "simulated": {"T1": file}}],
    }
    case = _case(tmp_path / "plain", {"T1": (beam, beam)})
    setup = CaseFile.model_validate({**case.setup.model_dump(exclude_unset=True), **more})
    ies = write_ies(tmp_path / "turned.ies", distribution(turned)).read_bytes()
    case = write_case(tmp_path / "case", setup, case.records, files={"simulated/turned.ies": ies})
    assert [s.name for s in simulations(case)] == ["simulation", "Rival"]
    names = [s.name for s in simulations(case, variants=True)]
    assert names == ["simulation", "Rival", "lens-orientation (rotation_deg = 90.0)"]
    told = compare(case, variants=True).tests[0].against
    for name in names[1:]:
        assert told[name].agreement.flux_ratio == pytest.approx(1.0, abs=2e-3)  # the file's grid of 2.5 degrees
        assert told[name].agreement.shape_difference > 0.5
        assert [p.apart_deg for p in told[name].peaks] == [None, None]
    bad = CaseFile.model_validate({**case.setup.model_dump(exclude_unset=True), "rival": [{"name": "x"}]})
    with pytest.raises(DataError, match=r"case\.toml: rival\[1\]\.simulated"):
        simulations(replace(case, setup=bad))
    bad = CaseFile.model_validate(
        {**case.setup.model_dump(exclude_unset=True), "rival": [{"name": "x", "simulated": {"T9": file}}]}
    )
    with pytest.raises(DataError, match="x: there is no test 'T9'"):
        simulations(replace(case, setup=bad))
