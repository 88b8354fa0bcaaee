"""A benchmark is whole, the same every time, readable without labdaq, and every spoilt byte is found."""

import csv
import hashlib
import shutil
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import read_case
from analysis.compare.benchmark import export_benchmark
from analysis.compare.benchmark_check import check_benchmark
from analysis.compare.benchmark_texts import Licence
from analysis.compare.from_files import case_from_files
from analysis.compare.from_sessions import case_from_sessions
from analysis.compare.listing import Listing
from analysis.compare.predicted import Predicted
from analysis.compare.simulated_session import SimulatedSession, SimulatedVariant
from analysis.hdr.radiance_picture import write_luminance
from analysis.photometry.lm63 import FileGeneration, read_lm63
from analysis.photometry.testdata import TestData
from labdaq.config import parse
from labdaq.errors import ConfigError, DataError, StorageError
from labdaq.session import Session
from tests.analysis.compare.light import distribution, lobe, on_arm, record, session_header, sky_part, write_ies

beam = lobe(35.0, 90.0, 4000.0)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with a sky map, a case of it, and a case of files with a rival and its own idea of the box."""
    folder = tmp_path_factory.mktemp("inputs")
    session = Session.open(record(folder / "sessions", session_header(), sky_part))
    sky = np.full((8, 8), 3000.0)
    (session.path / "derived").mkdir(exist_ok=True)
    write_luminance(session.path / "derived" / "sky.hdr", sky)
    (session.path / "derived" / "notes.bin").write_bytes(b"x")
    predicted = Predicted(sun=distribution(beam), sky=distribution(sky_part))
    variant = SimulatedVariant(mechanism="soiling", setting={"tau": 0.1}, predicted=predicted)
    item = SimulatedSession(session=session, predicted=predicted, variants=[variant])
    case_from_sessions([item], title="of a session").write(folder / "cases" / "box")
    write_ies(folder / "m.ies", on_arm(sky_part))
    write_ies(folder / "s.ies", distribution(sky_part))
    text = """format = "labdaq-comparison/1"
        goniometer = { distance_m = 2.6 }
        system = [{ id = "box", kind = "box", wall_reflectance = 0.9 }]
        test = [{ id = "T1", system = "box", measured = "m.ies", simulated = { total = "s.ies" } }]
        rival = [{ name = "R", simulated = { T1 = { total = "s.ies" } } }]"""
    case_from_files(parse(text, Listing, "list"), folder).write(folder / "more" / "box")
    return folder


@pytest.fixture
def packed(inputs: Path, tmp_path: Path) -> Path:
    given = [inputs / "sessions", inputs / "cases", inputs / "more" / "box"]
    export_benchmark(given, tmp_path / "pack", licence=Licence("CC0-1.0", "us"), title="A test")
    return tmp_path / "pack"


def test_the_pack_is_read_with_plain_tools(packed: Path, inputs: Path) -> None:
    done = subprocess.run(["sha256sum", "-c", "--quiet", "MANIFEST.sha256"], cwd=packed, check=False)
    assert done.returncode == 0
    about = tomllib.loads((packed / "benchmark.toml").read_text())
    assert (about["licence"], about["cases"], about["sessions"], about["tests"]) == ("CC0-1.0", 2, 1, 3)
    with (packed / "tests.csv").open(newline="") as file:
        first, second, session = csv.DictReader(file)
    assert [r["source"] for r in (first, second, session)] == ["cases/box", "cases/box-2", "sessions/a-T18"]
    # two boxes that are not alike
    assert (first["system_file"], second["system_file"]) == ("systems/box.toml", "systems/box-2.toml")
    assert tomllib.loads((packed / second["system_file"]).read_text())["wall_reflectance"] == 0.9
    for name in ("simulated_sun_ies", "simulated_sky_ies"):
        assert (packed / first[name]).is_file()
    assert (packed / second["simulated_total_ies"]).read_bytes() == (inputs / "s.ies").read_bytes()
    assert session["sky_hdr"] == "sessions/a-T18/derived/sky.hdr"
    assert (packed / session["sky_hdr"]).is_file()
    assert not (packed / "sessions/a-T18/derived/notes.bin").exists()
    assert float(session["sun_altitude_deg"]) == pytest.approx(31.15, abs=0.1)
    assert session["start_utc"] == "2010-07-22T13:11:59.750Z"
    with (packed / "sessions/a-T18/readings.csv").open(newline="") as file:
        readings = list(csv.DictReader(file))
    assert len(readings) == 72 * 2 + 160
    spoilt = [r for r in readings if r["usable"] == "no"]
    assert [(r["value"], r["flags"], r["gamma_deg"], r["c_deg"]) for r in spoilt] == [
        ("", "over-range", "45.0", "90.0")
    ]
    arm = [r for r in readings if r["channel"] == "gonio.g35" and r["c_deg"] == "90.0"]
    assert float(arm[0]["value"]) * 2.6**2 == pytest.approx(float(sky_part(35.0, 90.0)))
    header = tomllib.loads((packed / "sessions/a-T18/session.toml").read_text())
    assert header["station"]["goniometer"]["distance_m"] == 2.6
    assert header["outcome"] == "finished"


def test_the_readme_tells_what_is_there(packed: Path) -> None:
    text = (packed / "README.txt").read_text()
    for word in (
        "sha256sum -c",
        "C = 0 towards north",
        "records.csv",
        "readings.csv",
        "CC0-1.0",
        "systems/",
        "photometry/",
    ):
        assert word in text
    with (packed / "tests.csv").open(newline="") as file:
        for column in next(csv.reader(file)):
            assert column in text
    for csv_file in ("cases/box/records.csv", "sessions/a-T18/readings.csv"):
        with (packed / csv_file).open(newline="") as file:
            for column in next(csv.reader(file)):
                assert column in text
    assert max(map(len, text.splitlines())) <= 120


def test_every_column_has_a_unit(packed: Path) -> None:
    with (packed / "columns.csv").open(newline="") as file:
        told = [(row["file"], row["column"]) for row in csv.DictReader(file) if row["unit"] and row["meaning"]]
    tables = [p.relative_to(packed).as_posix() for p in packed.rglob("*.csv")]
    assert {"tests.csv", "columns.csv", "cases/box/records.csv", "sessions/a-T18/readings.csv"} <= set(tables)
    for name in tables:
        with (packed / name).open(newline="") as file:
            header = next(csv.reader(file))
        assert [column for pattern, column in told if fnmatch(name, pattern)] == header


def test_recorded_photometry_is_near_field_and_says_so(packed: Path) -> None:
    found = read_lm63(packed / "photometry" / "box-2-T1-measured.ies")
    assert found.oddities == ()
    assert found.generation is FileGeneration.MEASURED_INTERPOLATED
    told = TestData.from_keywords(found.distribution.keywords)
    assert (told.field, told.distance_m) == ("near", 2.6)
    np.testing.assert_allclose(found.distribution.candela, on_arm(sky_part).candela, rtol=1e-8, atol=1e-6)
    # one reading of the session is missing: no .ies is made up
    assert not (packed / "photometry" / "box-T18-measured.ies").exists()


def test_cases_come_out_as_they_went_in(packed: Path, inputs: Path) -> None:
    again = read_case(packed / "cases" / "box")
    original = read_case(inputs / "cases" / "box")
    assert again.setup == original.setup
    np.testing.assert_array_equal(again.records.measured, original.records.measured)
    assert again.setup.variant[0].simulated["T18"].names
    assert (packed / "cases" / "box-2" / "simulated" / "rival-1" / "T1-total.ies").is_file()


def test_the_same_input_gives_the_same_bytes(packed: Path, inputs: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere"
    shutil.copytree(inputs, moved)
    given = [moved / "sessions", moved / "cases", moved / "more" / "box"]
    export_benchmark(given, tmp_path / "again", licence=Licence("CC0-1.0", "us"), title="A test")
    assert (tmp_path / "again" / "MANIFEST.sha256").read_text() == (packed / "MANIFEST.sha256").read_text()


def test_a_raw_session_comes_out_as_it_was_recorded(inputs: Path, tmp_path: Path) -> None:
    export_benchmark([inputs / "sessions"], tmp_path / "pack", licence=Licence(), raw=True)
    session = Session.open(tmp_path / "pack" / "sessions" / "a-T18" / "original")
    assert len(session.readings()) == 72 * 2 + 160
    assert session.sealed
    assert check_benchmark(tmp_path / "pack") > 5


def test_an_intact_pack_is_told_so_and_every_spoilt_file_is_found(packed: Path) -> None:
    lines = (packed / "MANIFEST.sha256").read_text().splitlines()
    assert check_benchmark(packed) == len(lines)
    for line in lines:
        name = line[66:]
        data = (packed / name).read_bytes()
        (packed / name).write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        with pytest.raises(DataError) as caught:
            check_benchmark(packed)
        assert f"{name}: was changed" in caught.value.message
        (packed / name).write_bytes(data)
    assert check_benchmark(packed) == len(lines)


def test_missing_additional_and_foreign_entries_are_found(packed: Path) -> None:
    (packed / "tests.csv").rename(packed / "tset.csv")
    manifest = packed / "MANIFEST.sha256"
    manifest.write_text(manifest.read_text() + "0" * 64 + "  ../outside\nnonsense\n")
    with pytest.raises(DataError) as caught:
        check_benchmark(packed)
    found = caught.value.message
    assert "tests.csv: is missing" in found
    assert "tset.csv: is not in the manifest" in found
    assert found.count("is not a check sum and the name of a file") == 2
    manifest.unlink()
    with pytest.raises(DataError, match="not a benchmark"):
        check_benchmark(packed)
    with pytest.raises(DataError, match="not a benchmark"):
        check_benchmark(packed / "nowhere")


def _resealed(packed: Path, name: str, data: bytes | None) -> None:
    """Change a file as one who also corrects the check sums."""
    if data is None:
        (packed / name).unlink()
    else:
        (packed / name).write_bytes(data)
    files = sorted(p for p in packed.rglob("*") if p.is_file() and p.name != "MANIFEST.sha256")
    lines = [f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.relative_to(packed).as_posix()}\n" for p in files]
    (packed / "MANIFEST.sha256").write_text("".join(lines))


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("systems/box.toml", None, "row 2, column system_file: there is no file systems/box.toml"),
        ("tests.csv", b"test,source\nx,y\n", "does not have the columns"),
        ("tests.csv", b"\xff\xfe", "not a CSV file"),
        ("benchmark.toml", b"format = 'labdaq-benchmark/2'", "has format 'labdaq-benchmark/2'"),
        ("benchmark.toml", b"format", "not valid TOML"),
        ("cases/box/case.toml", b"format = 'x'", "case.toml: format"),
        ("cases/box/simulated/T18-sun.ies", b"TILT=NONE\n1 2", "T18-sun.ies"),
        ("sessions/a-T18/readings.csv", b"a,b\n", "readings.csv: does not have the columns"),
        ("sessions/a-T18/session.toml", b"[[", "session.toml: "),
        ("sessions/a-T18/derived/sky.hdr", b"#?RADIANCE\n", "sky.hdr"),
        ("LICENCE.txt", None, "LICENCE.txt: is missing"),
    ],
)
def test_files_that_cannot_be_read_are_found_behind_right_check_sums(
    packed: Path, name: str, data: bytes | None, words: str
) -> None:
    _resealed(packed, name, data)
    with pytest.raises(DataError) as caught:
        check_benchmark(packed)
    assert words in caught.value.message


def test_bad_input_is_told_at_once_and_nothing_is_written(inputs: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "case.toml").write_text("format = 1")
    twice = inputs / "cases"
    with pytest.raises(DataError) as caught:
        export_benchmark([tmp_path / "empty", tmp_path / "case", twice, twice], tmp_path / "pack", licence=Licence())
    found = caught.value.message
    assert "empty: is neither a case (case.toml) nor a session" in found
    assert "case.toml: format" in found
    assert "box: is given twice" in found
    assert not (tmp_path / "pack").exists()
    with pytest.raises(DataError, match="nothing to pack"):
        export_benchmark([], tmp_path / "pack", licence=Licence())
    with pytest.raises(ConfigError, match="is not a licence"):
        Licence("all rights reserved")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("x")
    with pytest.raises(StorageError, match="not empty"):
        export_benchmark([twice], tmp_path / "full", licence=Licence())


def test_a_case_that_names_files_outside_is_not_packed(inputs: Path, tmp_path: Path) -> None:
    shutil.copytree(inputs / "more" / "box", tmp_path / "case")
    shutil.copyfile(inputs / "s.ies", tmp_path / "secret.ies")
    text = (tmp_path / "case" / "case.toml").read_text()
    (tmp_path / "case" / "case.toml").write_text(text.replace("simulated/T1-total.ies", "../secret.ies"))
    with pytest.raises(DataError, match=r"\.\./secret\.ies lies outside the case"):
        export_benchmark([tmp_path / "case"], tmp_path / "pack", licence=Licence())
