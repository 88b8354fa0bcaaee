"""`labdaq emulate --station`: a station file's own emulators on real ports."""

import json
import signal
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from click.testing import CliRunner

from labdaq.cli import cli
from labdaq.errors import ConfigError


@pytest.fixture
def station_file(tmp_path: Path) -> Path:
    text = files("labdaq").joinpath("examples/station.toml").read_text("utf-8")
    path = tmp_path / "mine.toml"
    # by night nothing needs to be traced but the sky
    path.write_text(text.replace("2010-07-22T13:12:00Z", "2010-07-22T05:00:00Z").replace("roof-global", "my-meter"))
    return path


def test_its_instruments_answer_where_it_says(station_file: Path) -> None:
    import serial

    words = [sys.executable, "-m", "labdaq", "emulate", "--station", str(station_file), "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = json.loads(process.stdout.readline())
        try:
            assert said["ready"] is True
            names = {"roof-luminance", "my-meter", "roof-diffuse", "roof-camera", "goniophotometer"}
            assert set(said["endpoints"]) == names
            assert said["endpoints"]["roof-camera"].startswith("ptpip://127.0.0.1:")
            with serial.Serial(said["endpoints"]["roof-luminance"], 4800, timeout=20) as port:
                port.write(b"MES\r\n")
                assert port.readline().startswith(b"OK")
        finally:
            process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--camera", "generic"], "--camera cannot go with --station"),
        (["--serial", "tcp", "--fault", "ls110:drop"], "--serial, --fault cannot go with --station"),
    ],
)
def test_what_the_file_decides_is_not_for_the_command_line(
    station_file: Path, words: list[str], complaint: str
) -> None:
    result = CliRunner().invoke(cli, ["emulate", "--station", str(station_file), *words])
    assert isinstance(result.exception, ConfigError)
    assert complaint in str(result.exception)


def test_a_station_of_real_instruments_has_nothing_to_emulate(tmp_path: Path) -> None:
    path = tmp_path / "real.toml"
    path.write_text(files("labdaq").joinpath("examples/station-greenwood.toml").read_text("utf-8"))
    result = CliRunner().invoke(cli, ["emulate", "--station", str(path)])
    assert isinstance(result.exception, ConfigError)
    assert "no instrument is emulated" in str(result.exception)
