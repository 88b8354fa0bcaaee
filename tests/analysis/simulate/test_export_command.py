"""`labdaq simulate --export` and `--ray-set`: whole folders, read by others."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.bsdf.basis import KLEMS_QUARTER
from analysis.bsdf.xml_read import read_bsdf
from analysis.photometry.lm63 import read_lm63
from analysis.simulate.export import folder as write
from analysis.simulate.radiance.tools import radiance
from analysis.simulate.whole import klems_of_system, tree_of_system
from labdaq.cli.simulate import command
from labdaq.errors import ConfigError, DataError

DAY = ["--global", "45717", "--diffuse", "17343", "--sun", "31.17,85.57"]


def simulate(*words: str) -> Result:
    return CliRunner().invoke(command, list(words))


def test_rays_that_miss_are_told_with_their_file_and_where_they_are(tmp_path: Path) -> None:
    """Places in millimetres that do not say so."""
    rays = tmp_path / "mm.txt"
    rays.write_text("100 0 900 0 0 -1 1\n-100 50 900 0 0 -1 1\n")
    done = simulate("box", "--ray-set", str(rays), "--out", str(tmp_path / "a.ies"))
    assert isinstance(done.exception, DataError)
    for words in ("mm.txt: no ray", "x -100 to 100", "z 900 to 900", "100% of them go down", "# unit: mm"):
        assert words in str(done.exception)


def test_a_folder_with_everything_and_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # few rays in wide cells and patches: their numbers are asked for in test_whole
    monkeypatch.setattr(write, "tree_of_system", partial(tree_of_system, depth=3, rays=200))
    monkeypatch.setattr(write, "klems_of_system", partial(klems_of_system, basis=KLEMS_QUARTER, rays=200))
    folder = tmp_path / "box"
    done = simulate("box", "--export", str(folder), *DAY, "--rays", "30000", "--json")
    assert done.exit_code == 0, done.output
    report = json.loads(done.output)
    names = {"skylight.obj", "cover.stl", "well.stl", "exit.stl", "entry.xml", "entry-klems.xml", "exit.xml",
             "exit-klems.xml", "whole.xml", "whole-klems.xml", "skylight.rad", "rays.txt", "rays.tm25ray",
             "README.md"}  # fmt: skip
    assert {Path(path).name for path in report["files"]} == names == {path.name for path in folder.iterdir()}
    assert report["not_written"] == [] and report["rays"] == 30_000
    assert radiance(["oconv", "skylight.rad"], b"", folder).startswith(b"#?RADIANCE")
    tree, klems = (read_bsdf(folder / name).bsdf for name in ("exit.xml", "exit-klems.xml"))
    for component in klems.components():
        assert klems.diffuse(component) == pytest.approx(
            float(np.mean(tree.hemispherical(component, _even()))), abs=0.02
        )
    flux = []
    for name in ("rays.txt", "rays.tm25ray"):
        out = tmp_path / f"{name}.ies"
        done = simulate("box", "--ray-set", str(folder / name), "--out", str(out), "--json")
        assert done.exit_code == 0, done.output
        report = json.loads(done.output)
        assert report["facts"]["rays"] == 30_000 and report["ray_set"].endswith(name)
        assert report["facts"]["sky"]["entering"] == pytest.approx(report["facts"]["rays_lm"], rel=1e-6)
        assert "_EGLOBAL" not in read_lm63(out).distribution.keywords
        flux.append(report["flux_lm"])
    direct = json.loads(simulate("box", *DAY, "--rays", "100000", "--out", str(tmp_path / "d.ies"), "--json").output)
    assert flux[0] == pytest.approx(flux[1], rel=1e-3)
    assert flux[0] == pytest.approx(direct["flux_lm"], rel=0.02)  # 30,000 rays


def _even() -> np.ndarray:
    from analysis.bsdf.disk import disk_of_square

    axis = (np.arange(24) + 0.5) / 24
    return disk_of_square(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2))


@pytest.mark.slow
def test_without_a_daylight_there_are_no_rays(tmp_path: Path) -> None:
    done = simulate("tube", "--export", str(tmp_path / "t"), "--set", "exit.haze=0.1")
    assert done.exit_code == 0, done.output
    assert not list((tmp_path / "t").glob("rays.*"))
    assert "skylight.rad: " in done.output and "haze" in done.output  # the reason why there is no scene
    assert (tmp_path / "t" / "boot.stl").is_file()


def test_words_that_contradict_each_other_are_named(tmp_path: Path) -> None:
    rays = tmp_path / "rays.txt"
    rays.write_text("0 0 5 0 0 -1 1\n")
    out = ["--out", str(tmp_path / "a.ies")]
    done = simulate("box", "--ray-set", str(rays), "--diffuse", "1", *out)
    assert isinstance(done.exception, ConfigError) and "--diffuse" in str(done.exception)
    done = simulate("box", "--ray-set", str(rays), "--export", str(tmp_path / "e"), *out)
    assert isinstance(done.exception, ConfigError)
    rays.write_text("9 0 5 0 0 -1 1\n")
    done = simulate("box", "--ray-set", str(rays), *out)
    assert isinstance(done.exception, DataError) and "no ray of the set meets the cover" in str(done.exception)
