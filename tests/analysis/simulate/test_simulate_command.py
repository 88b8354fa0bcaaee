"""`labdaq simulate` from its words to the files."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.photometry.lm63 import FileGeneration, read_lm63
from analysis.simulate.daylight import follows_sun, sky_model
from labdaq.cli.simulate import command
from labdaq.errors import ConfigError, DataError, StorageError

DAY = ["--global", "45717", "--diffuse", "17343", "--sun", "31.17,85.57"]


def simulate(*words: str) -> Result:
    return CliRunner().invoke(command, list(words))


def test_file_and_parts_add_up(tmp_path: Path) -> None:
    out = tmp_path / "T18.ies"
    done = simulate("box", "--out", str(out), *DAY, "--rays", "20000", "--parts", "--json", "--name", "T18")
    assert done.exit_code == 0, done.output
    report = json.loads(done.output)
    total, sun, sky = (read_lm63(path) for path in report["files"])
    assert [Path(path).name for path in report["files"]] == ["T18.ies", "T18-sun.ies", "T18-sky.ies"]
    assert total.oddities == () or not total.oddities
    assert total.generation is FileGeneration.SIMULATED
    assert np.allclose(total.distribution.candela, sun.distribution.candela + sky.distribution.candela, rtol=1e-5)
    assert total.distribution.flux() == pytest.approx(report["flux_lm"], rel=1e-5)
    assert total.distribution.gamma_deg[-1] == 90.0
    words = total.distribution.keywords
    assert words["TEST"] == "T18" and words["_FIELD"] == "far" and words["_SUNALT"].startswith("31.17")
    facts = report["facts"]["sun"]
    assert facts["out"] < facts["entering"]


def test_near_field_with_a_room_is_brighter_at_high_gamma(tmp_path: Path) -> None:
    common = [*DAY, "--rays", "20000", "--distance", "2.6"]
    for name, room in (("dark", []), ("lit", ["--room", "0.3,0.2"])):
        assert simulate("top", "--out", str(tmp_path / f"{name}.ies"), *common, *room).exit_code == 0
    dark, lit = (read_lm63(tmp_path / f"{name}.ies").distribution for name in ("dark", "lit"))
    assert dark.keywords["NEARFIELD"].startswith("2.6")
    ratio = lit.candela.mean(axis=0)[:-1] / dark.candela.mean(axis=0)[:-1]
    assert np.all(ratio > 1.0) and ratio[-2] > ratio[10] + 0.1


def test_directions_of_the_arm(tmp_path: Path) -> None:
    words = [*DAY, "--rays", "20000", "--distance", "2.6", "--out", str(tmp_path / "a.ies")]
    assert simulate("top", *words, "--directions", "arm").exit_code == 0
    seen = read_lm63(tmp_path / "a.ies").distribution
    assert list(seen.gamma_deg) == [0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0, 90.0]
    assert list(seen.c_deg) == list(np.arange(0.0, 360.1, 22.5))
    assert simulate("top", *words).exit_code == 0
    fine = read_lm63(tmp_path / "a.ies").distribution
    # 20,000 rays: 10 % of a direction's noise, and the counted nadir lies on a peak
    assert seen.candela[0, 0] == pytest.approx(fine.candela[0, 0], rel=0.4)


def test_a_system_from_toml_and_settings(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('base = "tube"\nwell_depth_m = 0.5\nwall.reflectance = 0.9\n')
    out = str(tmp_path / "a.ies")
    words = ["--sky", "overcast", "--diffuse", "10000", "--rays", "20000", "--json"]
    plain = json.loads(simulate(str(tmp_path / "mine.toml"), "--out", out, *words).output)
    brighter = json.loads(
        simulate(str(tmp_path / "mine.toml"), "--out", out, *words, "--set", "wall.reflectance=0.99").output
    )
    assert plain["sun"] is None and plain["system"] == "mine"
    assert brighter["flux_lm"] > 1.02 * plain["flux_lm"]


def test_time_and_site_place_the_sun(tmp_path: Path) -> None:
    """Test 18 of the Greenwood report: 31.17 degrees (31.20 with refraction) at azimuth 85.6 in the middle."""
    words = ["--global", "45717", "--diffuse", "17343", "--time", "2010-07-22T13:13:22Z", "--rays", "2000", "--json"]
    report = json.loads(simulate("box", "--out", str(tmp_path / "a.ies"), *words).output)
    assert report["sun"]["altitude_deg"] == pytest.approx(31.198, abs=0.05)
    assert report["sun"]["azimuth_deg"] == pytest.approx(85.57, abs=0.05)


@pytest.mark.parametrize("sky", ["cie:1", "cie:3", "cie:5", "ies-overcast", "overcast", "uniform"])
def test_skies_that_do_not_follow_the_sun_need_none(tmp_path: Path, sky: str) -> None:
    words = ["--diffuse", "15000", "--sky", sky, "--rays", "1000", "--json"]
    done = simulate("box", "--out", str(tmp_path / "a.ies"), *words)
    assert done.exit_code == 0, done.exception
    assert json.loads(done.output)["sun"] is None


def test_the_skies_that_follow_the_sun_are_those_whose_luminance_does() -> None:
    """Luminances for two suns differ for a sky that follows the sun, and for no other."""
    up = np.array([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]])
    for name in [*(f"cie:{k}" for k in range(1, 16)), "overcast", "uniform", "ies-overcast", "ies-clear", "clear"]:
        low, high = (sky_model(name, *sun, 20_000.0, 20_000.0)(up) for sun in ((20.0, 90.0), (60.0, 200.0)))
        assert np.allclose(low / low[2], high / high[2]) != follows_sun(name), name


@pytest.mark.parametrize(
    ("words", "error", "says"),
    [
        ([], ConfigError, "--diffuse"),
        (["--diffuse", "1000", "--sky", "cie:2"], ConfigError, "where is the sun"),
        (["--diffuse", "1000", "--sky", "cie:16", "--sun", "30,90"], DataError, "cie:16"),
        (["--diffuse", "1000"], ConfigError, "where is the sun"),
        (["--diffuse", "1000", "--sun", "3"], ConfigError, "--sun"),
        (["--diffuse", "1000", "--sun", "30,90", "--time", "2010-07-22"], ConfigError, "--time"),
        (["--diffuse", "1000", "--time", "noon"], ConfigError, "noon"),
        ([*DAY, "--room", "0.04"], ConfigError, "--distance"),
        ([*DAY, "--room", "0.04", "--distance", "9"], ConfigError, "do not fit"),
        ([*DAY, "--set", "wall.reflectance=2"], ConfigError, "wall.reflectance"),
        ([*DAY, "--set", "wall.color=2", "--set", "x=1"], ConfigError, "wall.color.*\n.*x: no such"),
        (["--sky", "sunny", "--diffuse", "1000", "--sun", "30,90"], DataError, "sunny"),
        (["--sky", "none.hdr"], DataError, "none.hdr"),
        (["--global", "10", "--diffuse", "1000", "--sun", "30,90"], DataError, "exceeds"),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(
    tmp_path: Path, words: list[str], error: type[Exception], says: str
) -> None:
    out = tmp_path / "a.ies"
    done = simulate("box", "--out", str(out), "--rays", "1000", *words)
    assert isinstance(done.exception, error)
    with pytest.raises(error, match=says):
        raise done.exception
    assert not out.exists()


def test_places_and_names_of_files(tmp_path: Path) -> None:
    assert simulate("box", "--out", str(tmp_path / "a.txt"), *DAY).exit_code == 2
    assert isinstance(simulate("box", "--out", str(tmp_path / "no" / "a.ies"), *DAY).exception, StorageError)
    assert isinstance(simulate("cube", "--out", str(tmp_path / "a.ies"), *DAY).exception, ConfigError)


def test_settings_are_listed() -> None:
    done = simulate("--list-settings")
    assert done.exit_code == 0 and "wall.reflectance = 0.95" in done.output
