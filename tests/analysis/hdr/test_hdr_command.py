"""``labdaq merge`` as it is typed: real stacks, one error for all mistakes, nothing half-written."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from analysis.hdr.lens_file import read_lens
from analysis.hdr.radiance_picture import read_picture
from analysis.sky.map import SkyMap
from labdaq.cli.merge import command
from labdaq.errors import ConfigError, LabdaqError
from tests.analysis.hdr.camera import LADDER, picture_bracket, raw_bracket
from tests.analysis.radiance_tools import radiance
from tests.analysis.recordings import recording

CANON = """
[lens]                      # fitted to the pipeline's own picture
centre = [1847.65, 2838.74]
radius = 1835.3
projection = "equisolid"
vignetting = [0.1755458928191, -0.528613562104476]
[luminance]
scale = 32.19               # 87 N² / ISO, times that camera's 1.18
row = [0.265, 0.670, 0.065]
"""


def typed(*words: str | Path) -> dict[str, object]:
    """What the command prints as JSON; its errors are raised."""
    done = CliRunner().invoke(command, [*map(str, words), "--json"], catch_exceptions=False, standalone_mode=False)
    report: dict[str, object] = json.loads(done.output)
    return report


@pytest.fixture(scope="module")
def raws(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], np.ndarray]:
    rng = np.random.default_rng(0)
    cells = 10 ** rng.uniform(1.0, 3.5, (50, 60))
    rate = np.repeat(np.repeat(cells, 2, axis=0), 2, axis=1)
    return raw_bracket(tmp_path_factory.mktemp("raws"), rate), cells


def test_the_memorial_stack(tmp_path: Path) -> None:
    folder = recording("memorial")
    report = typed(
        *sorted(folder.glob("*.png")), "--times", folder / "shutter_times.txt", "--out", tmp_path / "map.hdr",
        "--save-response", tmp_path / "kept.json", "--master", tmp_path / "map.npz",
    )  # fmt: skip
    assert report["size"] == [768, 512]
    assert report["unit"] == "relative"
    assert b"512" in radiance("getinfo", "-d", tmp_path / "map.hdr")
    picture = read_picture(tmp_path / "map.hdr").luminance
    with np.load(tmp_path / "map.npz") as master:
        np.testing.assert_allclose(picture, master["signal"], rtol=0.004)
        assert master["variance"].shape == master["flags"].shape == (768, 512)
    frozen = typed(
        *sorted(folder.glob("*.png")), "--times", folder / "shutter_times.txt", "--out", tmp_path / "again.hdr",
        "--response", tmp_path / "kept.json",
    )  # fmt: skip
    np.testing.assert_array_equal(read_picture(tmp_path / "again.hdr").luminance, picture)
    assert frozen["record"]["response"]["kind"] == "file"  # type: ignore[index]


@pytest.mark.slow
def test_the_canon_fisheye_bracket_against_its_own_pipeline(tmp_path: Path) -> None:
    folder = recording("fisheye-bracket")
    (tmp_path / "lens.toml").write_text(CANON)
    files = sorted((folder / "JPEG").glob("*.JPG"))
    theirs = SkyMap.from_picture(folder / "pipeline-output-1000x1000.hdr")
    assert theirs.horizontal_illuminance() == pytest.approx(900.94, abs=0.1)
    for options in (["--response", folder / "cal" / "Response_function.rsp"], []):
        report = typed(*files, "--lens", tmp_path / "lens.toml", "--out", tmp_path / "map.hdr", *options)
        seen = float(radiance("evalglare", "-V", tmp_path / "map.hdr", ends=1).split()[0])
        assert seen == pytest.approx(report["illuminance"], rel=1e-3)
        # their response and ours differ by 10 % between neighbouring exposures; illuminances by 4 % either way
        assert seen == pytest.approx(900.94, rel=0.06)
        ours = SkyMap.from_picture(tmp_path / "map.hdr")
        both = (theirs.luminance > 1.0) & (ours.luminance > 0.0) & (theirs.directions[..., 2] > 0.1)
        ratio = np.log(ours.luminance[both] / theirs.luminance[both])
        assert float(np.median(np.abs(ratio - np.median(ratio)))) < 0.05


def test_raw_files_and_a_scale(raws: tuple[list[Path], np.ndarray], tmp_path: Path) -> None:
    one = typed(*raws[0], "--out", tmp_path / "one.hdr")
    ten = typed(*raws[0], "--out", tmp_path / "ten.hdr", "--scale", "10")
    assert (one["unit"], ten["unit"]) == ("relative", "cd/m2")
    ratio = read_picture(tmp_path / "ten.hdr").luminance / read_picture(tmp_path / "one.hdr").luminance
    assert float(np.median(ratio)) == pytest.approx(10.0, rel=0.002)
    assert one["size"] == [50, 60]


def test_words_for_people(raws: tuple[list[Path], np.ndarray], tmp_path: Path) -> None:
    done = CliRunner().invoke(command, [*map(str, raws[0]), "--out", str(tmp_path / "map.hdr")], standalone_mode=False)
    for part in ("16 exposures, raw", "refined", "median uncertainty", "60 x 50"):
        assert part in done.output


def test_colour(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rate = 10 ** rng.uniform(-1.0, 2.0, (60, 60, 1)) * np.array([0.5, 1.0, 1.5])
    files = picture_bracket(tmp_path, rate)
    (tmp_path / "times.txt").write_text("\n".join(str(t) for t in LADDER))
    typed(*files, "--times", tmp_path / "times.txt", "--out", tmp_path / "map.hdr", "--colour", "--response", "srgb")
    picture = read_picture(tmp_path / "map.hdr")
    assert any(line.startswith("PRIMARIES=") for line in picture.header)
    assert 0.3 < float(np.median(picture.rgb[..., 0] / picture.rgb[..., 2])) < 0.4


def test_all_mistakes_at_once_and_nothing_written(raws: tuple[list[Path], np.ndarray], tmp_path: Path) -> None:
    (tmp_path / "times.txt").write_text("1\n-2\nsoon\n")
    (tmp_path / "cut.dng").write_bytes(raws[0][0].read_bytes()[:3000])
    (tmp_path / "lens.toml").write_text("[lens]\nradius = -4\nfocal = 8\n")
    before = sorted(tmp_path.iterdir())
    words = [raws[0][0], tmp_path / "cut.dng", tmp_path / "gone.dng", "--times", tmp_path / "times.txt"]
    with pytest.raises(LabdaqError) as caught:
        typed(*words, "--lens", tmp_path / "lens.toml", "--response", "maybe", "--out", tmp_path / "map.hdr")
    text = str(caught.value)
    for part in ("line 2", "line 3", "cut.dng", "gone.dng", "lens.centre", "lens.radius", "lens.focal", "maybe"):
        assert part in text, text
    assert sorted(tmp_path.iterdir()) == before


def test_exit_codes(raws: tuple[list[Path], np.ndarray], tmp_path: Path) -> None:
    def ends(*words: str | Path) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-m", "labdaq", "merge", *map(str, words)], capture_output=True, text=True, check=False
        )
        assert "Traceback" not in done.stderr
        return done.returncode, done.stderr

    (tmp_path / "times.txt").write_text("1\n2\n3\n")
    code, said = ends(*raws[0][:2], "--times", tmp_path / "times.txt", "--out", tmp_path / "map.hdr")
    assert (code, "3 exposure times for 2 files" in said) == (65, True)
    assert ends(*raws[0], "--out", tmp_path / "no" / "map.hdr")[0] == 74
    assert ends(*raws[0], "--out", tmp_path / "map.png")[0] == 64
    assert ends(*raws[0])[0] == 64
    assert sorted(p.name for p in tmp_path.iterdir()) == ["times.txt"]


def test_a_lens_file_says_what_is_wrong_with_it(tmp_path: Path) -> None:
    path = tmp_path / "lens.toml"
    path.write_text(CANON)
    kept = read_lens(path)
    assert kept.crop.of(np.zeros((3744, 5616), np.uint8)).shape == (kept.crop.height, kept.crop.width)
    lens = kept.lens_in(kept.crop)
    assert lens.centre_row == pytest.approx(1835.3 + 2.0, abs=2.0)
    path.write_text('[lens]\ncentre = [9, 9]\nradius = 5\nvignetting = { "5.6" = [-0.3], "8" = [-0.2] }\n')
    by_aperture = read_lens(path)
    assert by_aperture.lens_in(by_aperture.crop, 8.0).vignetting == (-0.2,)
    for aperture in (4.0, None):
        with pytest.raises(ConfigError, match=r"f/5\.6, f/8"):
            by_aperture.lens_in(by_aperture.crop, aperture)
    for text, complaint in (
        ("[lens]\ncentre = [1, 2]\nradius = 5\nvignetting = { wide = [0.1] }\n", "wide"),
        ("[lens]\ncentre = [1, 2]\nradius = 5\nvignetting = [-2.0]\n", "light"),
        ("[lens\n", "file"),
        ("[lens]\ncentre = [1]\nradius = 'big'\n", "radius"),
    ):
        path.write_text(text)
        with pytest.raises(ConfigError, match=complaint):
            read_lens(path)
