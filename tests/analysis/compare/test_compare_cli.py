"""The commands: what they write, what they say, and one clear error with its exit code for bad input."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.cases import read_case
from tests.analysis.commands import Run
from tests.analysis.compare.light import distribution, lobe, on_arm, record, session_header, sky_part, write_ies
from tests.analysis.recordings import recording

beam = lobe(35.0, 90.0, 4000.0)


def _files(folder: Path) -> Path:
    write_ies(folder / "m.ies", on_arm(sky_part))
    write_ies(folder / "sun.ies", distribution(beam))
    write_ies(folder / "sky.ies", distribution(sky_part))
    return folder


def test_files_become_a_case_and_a_report(labdaq: Run, tmp_path: Path) -> None:
    f = _files(tmp_path)
    code, out, err = labdaq(
        "compare", "--measured", f / "m.ies", "--simulated-sun", f / "sun.ies", "--simulated-sky", f / "sky.ies",
        "--rival", "flat", f / "sky.ies", "--test", "T7", "--system", "box", "--noise", "0.5", "--out", f / "case",
        "--report", f / "report",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert "145 records of 1 tests" in out
    assert "flat: flux 1.000 of the recording's, shape difference 0.000" in out
    case = read_case(f / "case")
    assert case.tests[0].id == "T7"
    assert case.setup.system[0].wall_reflectance == 0.95
    assert case.records.has_parts.all()
    assert (f / "report" / "report.html").is_file()
    code, out, _ = labdaq("compare", f / "case", "--report", f / "again", "--json")
    told = json.loads(out)
    assert (code, told["records"], told["report"]) == (0, 145, str(f / "again" / "report.html"))


def test_a_list_and_a_table_of_lux(labdaq: Run, tmp_path: Path) -> None:
    f = _files(tmp_path / "in")
    (f / "readings.csv").write_text("gamma_deg,c_deg,lux\n0,0,100\n45,90,80\n")
    (f / "list.toml").write_text(
        'format = "labdaq-comparison/1"\n[goniometer]\ndistance_m = 2.6\n[[test]]\nid = "T1"\n'
        'measured = "readings.csv"\nsimulated = { total = "sky.ies" }\n'
    )
    assert labdaq("compare", "--list", f / "list.toml", "--out", tmp_path / "a")[0] == 0
    code, _, err = labdaq(
        "compare", "--measured", f / "readings.csv", "--simulated", f / "sky.ies", "--distance", "2.6", "--out",
        tmp_path / "b",
    )  # fmt: skip
    assert (code, err) == (0, "")
    for name in ("a", "b"):
        assert read_case(tmp_path / name).records.measured.tolist() == pytest.approx([676.0, 540.8])


def test_sessions_become_a_case(labdaq: Run, tmp_path: Path) -> None:
    path = record(tmp_path / "sessions", session_header(), sky_part)
    code, _, err = labdaq("compare", path, "--out", tmp_path / "case")
    assert code == 65
    assert "has no prediction" in err
    write_ies(path / "derived" / "simulated-sun.ies", distribution(beam))
    write_ies(path / "derived" / "simulated-sky.ies", distribution(sky_part))
    code, out, _ = labdaq("compare", path, "--out", tmp_path / "case")
    assert code == 0
    assert "160 records of 1 tests" in out
    assert "1 readings of gonio.g45 must not be used" in out
    f = _files(tmp_path)
    code, _, _ = labdaq("compare", path, "--simulated", f / "sky.ies", "--out", tmp_path / "total")
    assert code == 0
    assert not read_case(tmp_path / "total").records.has_parts.any()


def test_greenwood_s_recipes_work_by_their_names(labdaq: Run, tmp_path: Path) -> None:
    table = recording("greenwood-tests.csv")
    code, out, err = labdaq("compare", "--recipe", "greenwood-zenith", "--table", table, "--out", tmp_path / "zenith")
    assert (code, err) == (0, "")
    assert "32 records of 32 tests" in out
    code, out, err = labdaq("compare", "--recipe", "greenwood-roof-meters", "--table", table, "--out", tmp_path / "m")
    assert (code, err) == (0, "")
    assert "7 records of 7 tests" in out
    assert "no file was given for table 'calibration sets'" in out
    code, out, _ = labdaq("compare", tmp_path / "zenith", "--report", tmp_path / "report")
    assert code == 0
    assert "sky.zenith 1.341 of the recording's" in out
    assert not (tmp_path / "report" / "campaign.csv").exists()


WRONG = {
    "no source": ((), 64, "give one source"),
    "two sources": (("CASE", "--measured", "m.ies"), 64, "not INPUTS and --measured together"),
    "no target": (("CASE",), 64, "say what to make"),
    "a case of a case": (("CASE", "--out", "x"), 64, "these are cases already"),
    "a table without a recipe": (("--table", "t.csv", "--out", "x"), 64, "go together"),
    "files without a case": (("--measured", "m.ies", "--simulated", "sky.ies"), 64, "--out CASE is needed"),
    "a prediction for a table": (("--table", "t", "--recipe", "r", "--rival", "a", "b", "--out", "x"), 64, "belong to"),
    "half a prediction": (("--measured", "m.ies", "--simulated-sun", "sun.ies", "--out", "x"), 78, "give sun and sky"),
    "no prediction": (("--measured", "m.ies", "--out", "x"), 78, "give sun and sky, or total"),
    "no such file": (("--measured", "n.ies", "--simulated", "sky.ies", "--out", "x"), 65, "n.ies"),
    "not a distribution": (("--measured", "m.ies", "--simulated", "t.csv", "--out", "x"), 65, "t.csv"),
    "no such case": (("nothing", "--report", "x"), 65, "nothing/case.toml: there is no such file"),
    "no such list": (("--list", "n.toml", "--out", "x"), 78, "n.toml: cannot be read"),
    "no such recipe": (("--table", "t.csv", "--recipe", "soup", "--out", "x"), 78, "recipes are greenwood-roof-meters"),
    "an unfit table": (("--table", "t.csv", "--recipe", "greenwood-zenith", "--out", "x"), 65, "fits no table"),
    "a full folder": (("--measured", "m.ies", "--simulated", "sky.ies", "--out", "full"), 74, "not empty"),
    "negative noise": (("--measured", "m.ies", "--simulated", "sky.ies", "--noise", "-1", "--out", "x"), 78, "percent"),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_is_one_clear_error(name: str, labdaq: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words, expected, told = WRONG[name]
    folder = _files(tmp_path)
    monkeypatch.chdir(folder)
    (folder / "t.csv").write_text("a,b\n1,2\n")
    (folder / "full").mkdir()
    (folder / "full" / "mine").write_text("x")
    labdaq("compare", "--measured", "m.ies", "--simulated", "sky.ies", "--out", "CASE")
    before = sorted(p.name for p in folder.iterdir())
    code, out, err = labdaq("compare", *words)
    assert code == expected, err
    assert told in err
    assert "Traceback" not in err
    assert out == ""
    assert sorted(p.name for p in folder.iterdir()) == before


def test_a_pack_is_exported_and_checked(labdaq: Run, tmp_path: Path) -> None:
    f = _files(tmp_path)
    labdaq("compare", "--measured", f / "m.ies", "--simulated", f / "sky.ies", "--out", f / "case")
    code, out, err = labdaq("benchmark", "export", f / "case", "--out", f / "pack", "--json")
    assert (code, err) == (0, "")
    files = json.loads(out)["files"]
    code, out, _ = labdaq("benchmark", "check", f / "pack", "--json")
    assert code == 0
    assert json.loads(out) == {"benchmark": str(f / "pack"), "files": files, "ok": True}
    (f / "pack" / "README.txt").write_text("hello")
    code, out, err = labdaq("benchmark", "check", f / "pack")
    assert (code, out) == (65, "")
    assert "README.txt: was changed" in err
    assert labdaq("benchmark", "export", f / "case", "--out", f / "p2", "--licence", "mine")[0] == 78
    assert not (f / "p2").exists()


def test_help_needs_no_heavy_library() -> None:
    heavy = ["pandas", "matplotlib", "cv2", "pvlib", "scipy", "numba", "pyradiance", "rawpy"]
    code = (
        "import sys; from labdaq.cli import cli; cli(['compare', '--help'], standalone_mode=False);"
        f"print([m for m in {heavy} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "greenwood-zenith" in done.stdout
