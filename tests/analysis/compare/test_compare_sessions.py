"""Recorded sessions beside simulated distributions become a case."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from analysis.cases.model import Simulation, System
from analysis.compare.from_sessions import NoiseOfHeads, case_from_sessions
from analysis.compare.predicted import Predicted
from analysis.compare.simulated_session import OtherChannel, SimulatedSession, SimulatedVariant, with_predictions
from labdaq.clock import NS, utc_ns_of
from labdaq.errors import DataError
from labdaq.session import Session
from labdaq.station import Station
from tests.analysis.compare.light import (
    GAMMAS,
    PLANES,
    START,
    distribution,
    lobe,
    record,
    session_header,
    sky_part,
    write_ies,
)

beam = lobe(35.0, 90.0, 4000.0)


def _light(gamma: np.ndarray, c: np.ndarray) -> np.ndarray:
    return beam(gamma, c) + sky_part(gamma, c)


def _predicted() -> Predicted:
    return Predicted(sun=distribution(beam), sky=distribution(sky_part))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return Session.open(record(tmp_path_factory.mktemp("sessions"), session_header(), _light))


def test_a_session_becomes_a_case(session: Session, tmp_path: Path) -> None:
    item = SimulatedSession(session=session, predicted=_predicted())
    draft = case_from_sessions([item], title="one", simulation=Simulation(engine="closed form", field="near"))
    case = draft.write(tmp_path / "case")
    r = case.records
    assert len(r) == 160
    assert [c.id for c in case.channels] == [f"gonio.g{g:g}" for g in GAMMAS]
    # candela = lx d², times the certificate's factor; the light came from the very distributions, which the case
    # interpolates between 2.5 degrees: for a lobe of width w that errs by (2.5/w)²/8 of its height
    good = np.isfinite(r.measured)
    assert good.sum() == 159
    np.testing.assert_allclose(r.measured[good] / 1.02, r.simulated[good], atol=4000 * (2.5 / 18) ** 2 / 4)
    np.testing.assert_allclose(r.sun + r.sky, r.simulated)
    np.testing.assert_allclose(r.sky, sky_part(r.gamma_deg, r.c_deg), atol=1.0)
    assert (r.gamma_deg[~good], r.c_deg[~good]) == ([45.0], [90.0])
    assert draft.notes == (f"{session.path.name}: 1 readings of gonio.g45 must not be used and are empty",)
    # noise alone, not the calibration's 2.5 %
    sensitivity = np.array(Station.built_in().goniometer.sensitivities_v_per_lx)[np.searchsorted(GAMMAS, r.gamma_deg)]
    floor = 0.0005 / sensitivity * 2.6**2 * 1.02
    np.testing.assert_allclose(r.uncertainty[good], np.hypot(0.003 * r.measured, floor)[good])
    # each reading has its own time: planes 9 s apart in the order they were visited
    by_plane = {c: r.utc_ns[r.c_deg == c] for c in PLANES}
    assert all(np.ptp(t) == 0 for t in by_plane.values())
    assert np.diff([by_plane[c][0] for c in PLANES]).tolist() == [9 * NS] * 15


def test_the_facts_come_from_the_session(session: Session, tmp_path: Path) -> None:
    case = case_from_sessions([SimulatedSession(session=session, predicted=_predicted())]).write(tmp_path / "case")
    setup, test = case.setup, case.tests[0]
    assert setup.site is not None
    assert (setup.site.latitude_deg, setup.site.elevation_m) == (34.2176, 180.0)
    assert setup.room is not None
    assert setup.room.size_m == (5.486, 5.486, 5.486)
    assert setup.goniometer is not None
    assert setup.goniometer.gammas_deg == GAMMAS
    assert setup.goniometer.c_planes_deg == PLANES
    assert setup.goniometer.sensor_half_angle_deg == 60.0
    system = case.system_of(test)
    assert system is not None
    assert (system.kind, system.wall_reflectance, system.well_depth_m) == ("box", 0.95, 0.61)
    assert test.id == "T18"
    assert test.start is not None
    assert test.end is not None
    assert utc_ns_of(test.start) == START - NS // 4
    assert (test.end - test.start).total_seconds() == pytest.approx(135.5)
    # report, chapter 8: sun altitude 31.3, azimuth 85.6 in this test
    assert test.sun_altitude_deg == pytest.approx(31.15, abs=0.1)
    assert test.sun_azimuth_deg == pytest.approx(85.5, abs=0.1)
    # mean of the unshaded head between first and last plane, with its certificate's factor
    assert test.global_illuminance_lx == pytest.approx((45_000 + 10 * 30) * 0.99)
    assert test.diffuse_illuminance_lx == pytest.approx(17_000 * 0.99)
    assert test.sky == "clear"
    sun = case.distribution("simulated/T18-sun.ies")
    np.testing.assert_allclose(sun.candela, distribution(beam).candela, rtol=1e-8, atol=1e-4)
    assert sun.keywords["ISSUEDATE"] == "2010-07-22"


def test_variants_other_channels_and_repeats(session: Session, tmp_path: Path) -> None:
    turned = Predicted(total=distribution(lobe(35.0, 180.0, 4000.0)))
    variant = SimulatedVariant(mechanism="lens-orientation", setting={"rotation_deg": 90.0}, predicted=turned)
    roof = OtherChannel(predict=lambda utc_ns: 45_000.0 + 0.0 * utc_ns, noise_relative=0.0025)
    item = SimulatedSession(session=session, predicted=_predicted(), variants=[variant], others={"sky.global": roof})
    system = System(id="box", kind="box", wall_reflectance=0.9)
    case = case_from_sessions([item, item], systems=[system], noise=NoiseOfHeads(relative=0.01, volts=0.0)).write(
        tmp_path / "case"
    )
    assert [t.id for t in case.tests] == ["T18", "T18-2"]
    assert case.setup.system == (system,)
    assert len(case.setup.variant) == 1
    assert set(case.setup.variant[0].simulated) == {"T18", "T18-2"}
    assert case.setup.variant[0].setting == {"rotation_deg": 90.0}
    parts = case.setup.variant[0].simulated["T18-2"]
    assert parts.total == "simulated/variant-1/T18-2-total.ies"
    assert case.distribution(parts.total).at(35.0, 180.0) > 3000.0
    roof_channel = next(k for k, c in enumerate(case.channels) if c.id == "sky.global")
    assert case.channels[roof_channel].kind == "illuminance-meter"
    rows = case.records.channel == roof_channel
    assert rows.sum() == 2 * 72
    np.testing.assert_allclose(case.records.uncertainty[rows], 0.0025 * case.records.measured[rows])
    assert np.isnan(case.records.gamma_deg[rows]).all()
    arm = ~rows & np.isfinite(case.records.measured)
    np.testing.assert_allclose(case.records.uncertainty[arm], 0.01 * case.records.measured[arm])
    # rows of a test stand together, in the order of time
    assert (np.diff(case.records.test) >= 0).all()
    assert all((np.diff(case.records.utc_ns[case.records.test == k]) >= 0).all() for k in (0, 1))


def test_what_does_not_fit_is_refused(session: Session, tmp_path: Path) -> None:
    narrow = distribution(sky_part).resampled(np.arange(0.0, 61.0, 5.0), np.arange(0.0, 361.0, 5.0))
    with pytest.raises(DataError, match="covers gamma 0 to 60, but there is a reading at 65"):
        case_from_sessions([SimulatedSession(session=session, predicted=Predicted(total=narrow))])
    with pytest.raises(DataError, match="sun part and the sky part together"):
        Predicted(sun=narrow)
    with pytest.raises(DataError, match="neither"):
        Predicted()
    with pytest.raises(DataError, match="no session"):
        case_from_sessions([])
    moved = Station.built_in().model_dump()
    moved["goniometer"]["distance_m"] = 3.0
    other = record(tmp_path, session_header("T19", station=Station.model_validate(moved)), _light)
    items = [SimulatedSession(session=s, predicted=_predicted()) for s in (session, Session.open(other))]
    with pytest.raises(DataError, match="a-T19: its goniometer differs from that of a-T18"):
        case_from_sessions(items)
    missing = OtherChannel(predict=lambda utc_ns: 0.0 * utc_ns)
    item = SimulatedSession(session=session, predicted=_predicted(), others={"sky.zenith": missing})
    with pytest.raises(DataError, match=r"no reading of sky\.zenith"):
        case_from_sessions([item])


def test_predictions_are_found_beside_their_sessions(session: Session, tmp_path: Path) -> None:
    copy = tmp_path / session.path.name
    shutil.copytree(session.path, copy)
    with pytest.raises(DataError, match=r"has no prediction: neither simulated-sun\.ies and simulated-sky\.ies nor"):
        with_predictions([copy])
    write_ies(copy / "derived" / "simulated.ies", distribution(sky_part))
    assert set(with_predictions([copy])[0].predicted.parts) == {"total"}
    write_ies(copy / "derived" / "simulated-sun.ies", distribution(beam))
    write_ies(copy / "derived" / "simulated-sky.ies", distribution(sky_part))
    assert set(with_predictions([copy])[0].predicted.parts) == {"sun", "sky"}
    given = with_predictions([copy], {"total": copy / "derived" / "simulated-sun.ies"})
    assert given[0].predicted.total is not None
    with pytest.raises(DataError, match="belong to one session"):
        with_predictions([copy, session.path], {"total": copy / "derived" / "simulated.ies"})
    with pytest.raises(DataError) as caught:
        with_predictions([copy, session.path, tmp_path / "nothing"])
    lines = caught.value.message.splitlines()
    assert len(lines) == 2
    assert "has no prediction" in lines[0]
    assert "not a session" in lines[1]
