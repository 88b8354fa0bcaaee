"""The report's 32 tests on the emulated station: the plan, and (slow) the whole pack read by a stranger's means."""

import csv
import hashlib
import os
import subprocess
import sys
import tomllib
from collections import Counter
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from labdaq.cli import cli
from labdaq.errors import StorageError
from simulators.world.campaign import SITE
from simulators.world.greenwood import greenwood_tests
from simulators.world.sunpath import SunPath


def test_the_plan_is_the_reports() -> None:
    """Table 3: tests 1 to 13 on 21 July 2010, the others on the 22nd; 12 tunnels, 10 boxes, 10 tops."""
    plan = greenwood_tests()
    assert [test.name for test in plan] == [f"T{k:02d}" for k in range(1, 33)]
    assert Counter(test.system for test in plan) == {"tube": 12, "box": 10, "top": 10}
    assert Counter(test.start.day for test in plan) == {21: 13, 22: 19}
    assert [test.name for test in plan if test.sky == "partly-cloudy"] == [f"T{k:02d}" for k in range(6, 14)]
    days = [[test.start for test in plan if test.start.day == day] for day in (21, 22)]
    assert days == [sorted(day) for day in days]
    assert len({test.seed for test in plan}) == 32


def test_the_suns_are_those_of_the_place() -> None:
    """Eastern Daylight Time is four hours behind. Test 31 is an hour before noon there: sin h = sin 34.2 sin 20.2 +
    cos 34.2 cos 20.2 cos 15.2.
    """
    path, plan = SunPath(SITE), greenwood_tests()
    low, high = (path.angles(round(plan[k].start.timestamp()) * 10**9) for k in (17, 30))
    assert low[0] == pytest.approx(31.2, abs=0.5) and low[1] == pytest.approx(85.6, abs=1.0)
    assert high[0] == pytest.approx(70.6, abs=0.3)


def test_a_folder_that_holds_something_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("a year's work")
    done = CliRunner().invoke(cli, ["benchmark", "greenwood", "--out", str(tmp_path)], standalone_mode=False)
    assert isinstance(done.exception, StorageError)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.slow
@pytest.mark.timeout(5400)
def test_all_32_tests_are_packed_and_read_without_labdaq(tmp_path: Path) -> None:
    """With nothing of labdaq but the command: check sums, licence, units, and that numbers agree across files."""
    home = tmp_path / "home"
    home.mkdir()
    command = [sys.executable, "-m", "labdaq", "benchmark", "greenwood", "--out", "pack", "--processes", "1"]
    command += ["--holder", "us", "--raw"]
    subprocess.run(command, cwd=tmp_path, env={**os.environ, "HOME": str(home)}, check=True)
    pack = tmp_path / "pack"
    _sums_hold(pack)
    _columns_have_units(pack)
    about = tomllib.loads((pack / "benchmark.toml").read_text())
    assert (about["licence"], about["holder"], about["cases"], about["sessions"]) == ("CC-BY-4.0", "us", 1, 32)
    assert "creativecommons.org/licenses/by/4.0" in (pack / "LICENCE.txt").read_text()
    assert "creativecommons.org/licenses/by/4.0" in (pack / "README.txt").read_text()
    tests = pd.read_csv(pack / "tests.csv")
    names = [f"T{k:02d}" for k in range(1, 33)]
    of_case, of_sessions = tests[tests.source.str.startswith("cases/")], tests[tests.source.str.startswith("sessions/")]
    assert sorted(of_case.test) == sorted(of_sessions.test) == names
    files = ["system_file", "measured_ies", "simulated_sun_ies", "simulated_sky_ies"]
    assert of_case[files].map(lambda name: (pack / name).is_file()).all(axis=None)
    assert of_sessions.sky_hdr.map(lambda name: (pack / name).is_file()).all()
    records = pd.read_csv(pack / "cases" / "greenwood" / "records.csv")
    arm = records[records.gamma_deg.notna() & records.channel.str.startswith("gonio")]
    assert set(arm.test) == set(names)
    assert (arm.groupby("test").size() == 160).all()  # ten heads in sixteen planes
    np.testing.assert_allclose(arm.simulated, arm.simulated_sun + arm.simulated_sky, rtol=2e-3, atol=1e-3)
    for row in of_sessions.itertuples():
        _session_is_whole(pack / str(row.source))


def _sums_hold(pack: Path) -> None:
    lines = (pack / "MANIFEST.sha256").read_text().splitlines()
    told = {line.split("  ", 1)[1]: line.split("  ", 1)[0] for line in lines}
    here = {p.relative_to(pack).as_posix(): p for p in pack.rglob("*") if p.is_file() and p.name != "MANIFEST.sha256"}
    assert set(told) == set(here)
    assert all(hashlib.sha256(path.read_bytes()).hexdigest() == told[name] for name, path in here.items())


def _columns_have_units(pack: Path) -> None:
    with (pack / "columns.csv").open(newline="") as file:
        told = [(row["file"], row["column"]) for row in csv.DictReader(file) if row["unit"]]
    for path in pack.rglob("*.csv"):
        name = path.relative_to(pack).as_posix()
        columns = [column for pattern, column in told if fnmatch(name, pattern)]
        assert columns == list(pd.read_csv(path, nrows=1).columns), name


def _session_is_whole(folder: Path) -> None:
    """Pictures are as large as told, and every reading has a unit."""
    readings, exposures = pd.read_csv(folder / "readings.csv"), pd.read_csv(folder / "exposures.csv")
    assert readings.unit.notna().all() and (readings.usable == "yes").any()
    assert len(exposures) == 16
    for row in exposures.itertuples():
        data = (folder / "original" / str(row.file)).read_bytes()
        assert (len(data), hashlib.sha256(data).hexdigest()) == (row.size, row.sha256)
