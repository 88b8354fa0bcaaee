"""Sessions are predicted under their own skies, and become cases that say how."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.cases import read_case
from analysis.photometry.lm63 import read_lm63
from analysis.process.daylight import daylight_of
from analysis.process.prediction import Wish, simulate_sessions
from analysis.process.session import process_session
from analysis.sky.map import SkyMap
from labdaq.cli import cli
from labdaq.errors import ConfigError, DataError
from labdaq.session import Session
from tests.analysis.process.recorded import again, take_few

CLEAR = 'base = "top"\nentry.kind = "clear"\nrise_m = 0.0\n'


@pytest.fixture(scope="module")
def processed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = take_few(tmp_path_factory.mktemp("sessions"))
    process_session(path)
    return path


@pytest.fixture
def session(processed: Path, tmp_path: Path) -> Path:
    path = tmp_path / processed.name
    shutil.copytree(processed, path)
    return path


@pytest.fixture
def clear(tmp_path: Path) -> str:
    """A white well under a clear pane: quickly traced, as it has no prisms."""
    file = tmp_path / "clear.toml"
    file.write_text(CLEAR)
    return str(file)


def labdaq(*words: object) -> Result:
    return CliRunner().invoke(cli, [str(word) for word in words], standalone_mode=False)


def test_daylight_is_that_of_the_session(session: Path) -> None:
    light = daylight_of(Session.open(session))
    sky = SkyMap.load(session / "derived" / "sky.npz")
    account = json.loads((session / "derived" / "process.json").read_text())
    assert light.source == "map"
    assert light.daylight.diffuse_lx == pytest.approx(sky.horizontal_illuminance(), rel=1e-6)
    # the sun's part comes to the same number by another way
    assert light.daylight.normal_lx == pytest.approx(account["sky"]["sun"]["normal_illuminance_lx"], rel=1e-6)
    assert light.daylight.beam_lx + light.daylight.diffuse_lx == pytest.approx(
        account["sky"]["readings"]["global"]["mean"]
    )


def test_parts_add_up_and_come_again(session: Path, clear: str) -> None:
    (first,) = simulate_sessions([session], Wish(system=clear, rays=50_000))
    files = {name: (session / "derived" / name).read_bytes() for name in first["files"]}
    assert set(files) == {"simulated.ies", "simulated-sun.ies", "simulated-sky.ies"}
    total, sun, sky = (read_lm63(session / "derived" / name).distribution for name in first["files"])
    assert total.candela == pytest.approx(sun.candela + sky.candela, rel=1e-5, abs=1e-3)
    assert sun.keywords["_FIELD"] == "near"
    assert sun.keywords["NEARFIELD"] == "2.6 2.6 2.6"
    # a pane lets 92 % of what falls on its 2 ft square through; a white well as deep as it is wide, with a low sun,
    # more than an eighth of that, all by reflection
    entering = first["global_lx"] * 0.6096**2
    assert 0.125 * entering < first["flux_lm"] < 0.92 * entering
    simulate_sessions([session], Wish(system=clear, rays=50_000))
    assert files == {name: (session / "derived" / name).read_bytes() for name in files}
    assert (session / "derived" / "sky.hdr").is_file()
    assert (session / "derived" / "measured.ies").is_file()


def test_precision_sets_the_rays(session: Path, clear: str) -> None:
    (rough,) = simulate_sessions([session], Wish(system=clear, precision=0.02))
    (fine,) = simulate_sessions([session], Wish(system=clear, precision=0.01))
    # a pilot run tells the rays needed to some ten per cent of the error
    assert rough["uncertainty"] <= 0.02 * 1.1
    assert fine["uncertainty"] <= 0.01 * 1.1
    assert fine["rays"] > rough["rays"]


def test_a_case_says_how_it_was_predicted(processed: Path, clear: str, tmp_path: Path) -> None:
    paths = []
    for number in (1, 2):
        paths.append(tmp_path / f"session-{number}")
        shutil.copytree(processed, paths[-1])
    words = [word for path in paths for word in ("--session", path)]
    done = labdaq("simulate", clear, *words, "--rays", 50_000, "--json")
    assert done.exit_code == 0, done.output
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert [one["path"] for one in told] == [str(path) for path in paths]
    done = labdaq("compare", *paths, "--out", tmp_path / "case")
    assert done.exit_code == 0, (done.output, done.exception)
    case = read_case(tmp_path / "case")
    assert case.setup.simulation.field == "near"
    assert case.setup.simulation.engine == "labdaq tracer"
    assert case.setup.system[0].lens == "clear"
    assert case.setup.system[0].wall_finish == "diffuse"
    assert [test.id for test in case.tests] == ["few", "few-2"]
    roof = json.loads((processed / "derived" / "process.json").read_text())["sky"]
    for test in case.tests:
        # the same readings over the same time
        assert test.global_illuminance_lx == pytest.approx(roof["readings"]["global"]["mean"])
        assert test.diffuse_illuminance_lx == pytest.approx(roof["readings"]["diffuse"]["mean"])
        assert test.sun_altitude_deg == pytest.approx(roof["sun"]["altitude_deg"], abs=1e-6)
    records = case.records
    assert len(records) == 2 * 4 * 10
    parts = records.sun + records.sky
    assert parts == pytest.approx(records.simulated, rel=2e-3)
    total = read_lm63(paths[0] / "derived" / "simulated.ies").distribution
    mine = records.test == 0
    there = total.at(records.gamma_deg[mine], records.c_deg[mine])
    assert records.simulated[mine] == pytest.approx(there, rel=1e-4)
    assert np.isfinite(records.measured).all()


def test_predictions_of_two_kinds_are_no_case(processed: Path, clear: str, tmp_path: Path) -> None:
    paths = []
    for bounces in (None, 3):
        paths.append(tmp_path / f"session-{bounces}")
        shutil.copytree(processed, paths[-1])
        simulate_sessions(paths[-1:], Wish(system=clear, rays=20_000, max_bounces=bounces))
    done = labdaq("compare", *paths, "--out", tmp_path / "case")
    assert isinstance(done.exception, DataError)
    assert "is simulated in another way" in done.exception.message
    assert not (tmp_path / "case").exists()


def test_without_a_sky_map_a_model_stands_in(processed: Path, clear: str, tmp_path: Path) -> None:
    path = again(processed, tmp_path / "blind", lambda _: True)
    process_session(path)
    (told,) = simulate_sessions([path], Wish(system=clear, rays=20_000))
    assert told["sky"] == "perez"
    with_map = daylight_of(Session.open(processed)).daylight
    # the meter's disc hides the light around the sun from the model; the map has it filled in: 1.5 to 3 % of it
    assert told["diffuse_lx"] == pytest.approx(with_map.diffuse_lx, rel=0.04)
    assert told["sun_altitude_deg"] == pytest.approx(with_map.sun_altitude_deg, abs=1e-6)


def test_all_mistakes_are_told_before_anything_is_traced(processed: Path, tmp_path: Path) -> None:
    fresh = again(processed, tmp_path / "a", lambda _: True)
    done = labdaq("simulate", "--session", fresh, "--session", tmp_path / "none")
    assert isinstance(done.exception, DataError)
    assert "is not processed" in done.exception.message
    assert "there is no such folder" in done.exception.message
    odd = again(processed, tmp_path / "b", lambda _: True, system="attic")
    process_session(odd)
    with pytest.raises(ConfigError, match="attic"):
        simulate_sessions([odd])
    assert not (odd / "derived" / "simulate.json").exists()


def test_the_session_tells_daylight_and_place(session: Path) -> None:
    done = labdaq("simulate", "--session", session, "--sun", "30,120")
    assert "--sun" in str(getattr(done.exception, "message", ""))


def test_process_says_which_session_failed(session: Path, tmp_path: Path) -> None:
    done = labdaq("process", session, tmp_path / "none", "--json")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [bool(line["error"]) for line in lines] == [False, True]
    assert isinstance(done.exception, DataError)
    assert done.exception.exit_code == 65
    done = labdaq("process", session)
    assert "zenith: meter" in done.output
