"""A luminance of the zenith that is read beside illuminances: the station's roof, all of it in one case."""

from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import Case, write_case
from analysis.cases.model import CaseFile, Records
from analysis.explain.fit import Fitter
from analysis.explain.hypers import ON_THE_ROOF, lattice_of
from analysis.explain.mechanisms.base import predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import ROOF, SKY, Readings
from analysis.explain.scene import Scene
from analysis.explain.search import Search
from analysis.sky.sun import Site, sun_position
from labdaq import directions
from tests.analysis.explain.campaign import SITE, Floats, _at
from tests.analysis.explain.roof import beam_and_sky

DAYS = (_at(22, 13, 0), _at(24, 13, 0))
STEPS = np.arange(20) * 24.0
"""Minutes after a day's beginning."""
UTC_NS = np.concatenate([int(day.timestamp()) * 10**9 + (STEPS * 60e9).astype(np.int64) for day in DAYS])
SUN = sun_position(UTC_NS, Site(SITE["latitude_deg"], SITE["longitude_deg"], SITE["elevation_m"]))
ALTITUDE, AZIMUTH = np.asarray(SUN.altitude_deg), np.asarray(SUN.azimuth_deg)
BEAM, DIFFUSE = beam_and_sky(ALTITUDE)
LUMINANCE = 0.3 * DIFFUSE
COUNT = len(UTC_NS)
CHANNELS = {
    "global": {"kind": "illuminance-meter", "quantity": "illuminance", "unit": "lx"},
    "diffuse": {"kind": "illuminance-meter", "quantity": "illuminance", "unit": "lx"},
    "zenith": {"kind": "luminance-meter", "quantity": "luminance", "unit": "cd/m2"},
}


def station(folder: Path, **readings: Floats) -> Case:
    """Two days of a global, a shaded and a luminance meter, whose prediction has no parts; as predicted unless told."""
    none, rng = np.full(COUNT, np.nan), np.random.default_rng(4)
    predicted = {"global": BEAM + DIFFUSE, "diffuse": DIFFUSE, "zenith": LUMINANCE}
    measured = {
        name: readings.get(name, value) * (1.0 + 0.003 * rng.normal(size=COUNT)) for name, value in predicted.items()
    }
    records = Records(
        test=np.tile(np.repeat([0, 1], len(STEPS)), 3),
        channel=np.repeat([0, 1, 2], COUNT),
        utc_ns=np.tile(UTC_NS, 3),
        gamma_deg=np.concatenate([none, none, np.full(COUNT, 180.0)]),
        c_deg=np.concatenate([none, none, np.zeros(COUNT)]),
        measured=np.concatenate(list(measured.values())),
        uncertainty=0.003 * np.concatenate(list(predicted.values())),
        simulated=np.concatenate(list(predicted.values())),
        sun=np.concatenate([BEAM, np.zeros(COUNT), none]),
        sky=np.concatenate([DIFFUSE, DIFFUSE, none]),
    )
    table = {
        "format": "labdaq-case/1",
        "site": SITE,
        "channel": [{"id": name, **what} for name, what in CHANNELS.items()],
        "test": [
            {"id": f"D{k}", "start": day, "end": day + timedelta(minutes=float(STEPS[-1] + 1)), "sky": "clear"}
            for k, day in enumerate(DAYS)
        ],
    }
    return write_case(folder, CaseFile.model_validate(table), records, replace=True)


def scene_of_station(folder: Path, **readings: Floats) -> Scene:
    return Scene(Readings.of(station(folder / "case", **readings)))


def leaning(east_deg: float) -> Floats:
    """What a head reads that leans to the east, by vectors; its diffuse light is that of the whole sky."""
    lean = np.array([np.sin(np.radians(east_deg)), 0.0, np.cos(np.radians(east_deg))])
    return np.asarray(BEAM / np.sin(np.radians(ALTITUDE)) * (directions.sky_vector(ALTITUDE, AZIMUTH) @ lean) + DIFFUSE)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of_station(tmp_path_factory.mktemp("zenith"))


def test_a_luminance_beside_illuminances_is_the_skys(scene: Scene) -> None:
    r = scene.readings
    assert r.has_parts and scene.on_the_roof and lattice_of(r) is ON_THE_ROOF
    assert np.array_equal(r.sky[r.kind == SKY], r.simulated[r.kind == SKY])
    assert not np.any(r.sun[r.kind == SKY])
    assert r.sun[r.kind == ROOF] == pytest.approx(np.concatenate([BEAM, np.zeros(COUNT)]))


def test_a_lean_of_one_meter_explains_more_than_anything_else(tmp_path: Path) -> None:
    names = ("meter-tilt", "meter-gain", "meter-range-limit", "nonlinearity", "dark-offset", "saturation")
    scene = scene_of_station(tmp_path, **{"global": leaning(3.0)})
    search = Search(Fitter(scene), mechanisms=[BY_ID[name] for name in names], conjectures=())
    best, second, *_ = search.singles()
    assert best.ids == ("meter-tilt",) and best.evidence > max(second.evidence, search.nothing().evidence) + 20.0
    north, east = best.fit.theta
    assert abs(north) < 1.0 and east == pytest.approx(3.0, abs=0.5)


def test_what_a_camera_or_a_range_does_is_asked_of_the_luminance_alone(scene: Scene) -> None:
    r, saturation = scene.readings, BY_ID["saturation"]
    for term in terms_of(saturation, scene):
        changed = predict(scene, (term,), np.array([1.5, *(p.centre for p in term.parameters[1:])]))
        assert not np.any((changed != r.simulated) & (r.kind == ROOF))
        assert np.any(changed != r.simulated)
    assert BY_ID["exposure-error"].why_not(scene) == "there is no camera among the channels"


@pytest.mark.parametrize("way", ["", "all daylight"])
def test_one_clock_moves_all_readings(scene: Scene, way: str) -> None:
    """In the morning half an hour later is brighter, on the meters and at the zenith."""
    term = next(t for t in terms_of(BY_ID["clock-offset"], scene) if t.branch.label == way)
    later = predict(scene, (term,), np.array([30.0]))
    morning = np.tile(np.tile(STEPS < 120.0, 2), 3)
    assert np.all(later[morning] > 1.005 * scene.readings.simulated[morning])


@pytest.mark.parametrize("way", ["", "through the shading disc", "about the shading disc"])
def test_another_disc_changes_what_the_shaded_meter_reads_alone(scene: Scene, way: str) -> None:
    r, split = scene.readings, BY_ID["sky-sun-ratio"]
    assert not split.why_not(scene)  # the tests' illuminances are not needed
    term = next(t for t in terms_of(split, scene) if t.branch.label == way)
    changed = predict(scene, (term,), np.array([0.1]))
    assert np.all(changed[COUNT : 2 * COUNT] > r.simulated[COUNT : 2 * COUNT])
    assert np.array_equal(
        np.delete(changed, np.s_[COUNT : 2 * COUNT]), np.delete(r.simulated, np.s_[COUNT : 2 * COUNT])
    )
