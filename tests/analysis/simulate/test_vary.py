"""`labdaq simulate --vary`: variants beside a baseline, from its tallies or traced again."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.cases import read_case
from analysis.photometry.lm63 import read_lm63
from labdaq.cli.compare import command as compare
from labdaq.cli.simulate import command
from labdaq.errors import ConfigError

DAY = ["--global", "45717", "--diffuse", "17343", "--sun", "31.17,85.57", "--rays", "20000"]


def simulate(*words: str) -> Result:
    return CliRunner().invoke(command, list(words))


def candela(path: Path) -> np.ndarray:
    return read_lm63(path).distribution.candela


def test_tallies_give_what_runs_give(tmp_path: Path) -> None:
    """Cut and dull variants cost no rays; runs that are cut or dull from the start agree.

    The cut one to rounding: its paths are the same to the last bounce that counts. In the dull one weak rays meet
    Russian roulette earlier, and smoothing is chosen anew: the flux agrees within the noise of 20,000 rays.
    """
    done = simulate("box", "--out", str(tmp_path / "a.ies"), *DAY, "--json", "--vary", "cut:max_bounces=1",
                    "--vary", "dull:wall.reflectance=0.8", "--vary", "same:wall_reflectance=0.95")  # fmt: skip
    assert done.exit_code == 0, done.exception
    cut, dull, same = json.loads(done.output)["variants"]
    assert [v["traced"] for v in (cut, dull, same)] == [False, False, False]
    assert Path(cut["files"][0]) == tmp_path / "a-cut.ies" and cut["setting"] == {"max_bounces": 1}
    assert np.array_equal(candela(tmp_path / "a-same.ies"), candela(tmp_path / "a.ies"))
    out = ["--out", str(tmp_path / "b.ies"), *DAY, "--json"]
    alone = json.loads(simulate("box", *out, "--max-bounces", "1").output)
    assert cut["flux_lm"] == pytest.approx(alone["flux_lm"], rel=2e-3)
    alone = json.loads(simulate("box", *out, "--set", "wall.reflectance=0.8").output)
    assert dull["flux_lm"] == pytest.approx(alone["flux_lm"], rel=0.03)
    assert cut["flux_lm"] < json.loads(done.output)["flux_lm"] > dull["flux_lm"]


def test_what_is_traced_again_is_the_run_with_that_setting(tmp_path: Path) -> None:
    """Same seed, same rays: the file of the variant is that of a run of its own, but for what it says of itself."""
    words = ["--distance", "2.6", "--room", "0.04"]
    done = simulate("box", "--out", str(tmp_path / "a.ies"), *DAY, *words, "--parts",
                    "--vary", "turned:rotation_deg=30,lenses=exit")  # fmt: skip
    assert done.exit_code == 0, done.exception
    assert "a-turned-sun.ies" in done.output and "traced again" in done.output
    own = ["--set", "exit.orientation_deg=30"]
    assert simulate("box", "--out", str(tmp_path / "b.ies"), *DAY, *words, "--parts", *own).exit_code == 0
    for part in ("", "-sun", "-sky"):
        assert np.array_equal(candela(tmp_path / f"a-turned{part}.ies"), candela(tmp_path / f"b{part}.ies"))
    told = read_lm63(tmp_path / "a-turned.ies").distribution.keywords
    assert told["_VARIANT"] == "turned: rotation_deg = 30, lenses = exit"
    assert "_VARIANT" not in read_lm63(tmp_path / "a.ies").distribution.keywords


def test_directions_that_are_scored_are_scored_again(tmp_path: Path) -> None:
    words = ["--directions", "arm", "--distance", "2.6"]
    done = simulate("top", "--out", str(tmp_path / "a.ies"), *DAY, *words, "--json", "--vary", "cut:max_bounces=0")
    assert done.exit_code == 0, done.exception
    report = json.loads(done.output)
    assert report["variants"][0]["traced"] and report["variants"][0]["flux_lm"] < 0.9 * report["flux_lm"]


def test_variants_stand_in_a_list_of_labdaq_compare(tmp_path: Path) -> None:
    """The example of docs/simulation.md; the baseline itself stands for what was measured."""
    done = simulate("box", "--out", str(tmp_path / "T18.ies"), *DAY, "--parts", "--vary", "turned:rotation_deg=45")
    assert done.exit_code == 0, done.exception
    (tmp_path / "tests.toml").write_text("""
format = "labdaq-comparison/1"

[[test]]
id = "T18"
system = "box"
measured = "T18.ies"
simulated = { sun = "T18-sun.ies", sky = "T18-sky.ies" }

[[variant]]
mechanism = "lens-orientation"
setting = { rotation_deg = 45.0 }
simulated = { T18 = { sun = "T18-turned-sun.ies", sky = "T18-turned-sky.ies" } }
""")
    made = CliRunner().invoke(compare, ["--list", str(tmp_path / "tests.toml"), "--out", str(tmp_path / "case")])
    assert made.exit_code == 0, made.exception
    case = read_case(tmp_path / "case")
    assert case.setup.variant[0].setting == {"rotation_deg": 45.0}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--vary", "dull"], "NAME:setting=value"),
        (["--vary", "a/b:haze=0.1"], "a/b"),
        (["--vary", "a-sun:haze=0.1"], "those of parts"),
        (["--vary", "a:haze=0.1", "--vary", "a:haze=0.2"], "twice"),
        (["--vary", "a:haze"], "not key=value"),
        (["--vary", "a:colour=3"], "variant a.*colour: no such"),
        (["--vary", "a:wall.reflectance=2"], "variant a: wall.reflectance: 2"),
        (["--vary", "a:max_bounces=-1"], "variant a: max_bounces: -1"),
        (["--vary", "a:rotation_deg=much"], "rotation_deg: 'much'"),
        (["--vary", "a:mirrored=perhaps"], "variant a.*mirrored"),
        (["--vary", "a:distance_m=3"], "distance"),
        (["--vary", "a:haze=0.1", "--engine", "radiance"], "--engine radiance"),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(tmp_path: Path, words: list[str], says: str) -> None:
    done = simulate("box", "--out", str(tmp_path / "a.ies"), *DAY, *words)
    assert isinstance(done.exception, ConfigError)
    with pytest.raises(ConfigError, match=f"(?s){says}"):
        raise done.exception
    assert not list(tmp_path.iterdir())
