"""Station files and scripts: what is refused, in which words, all at once; and that the documentation is right."""

import hashlib
import re
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given

from labdaq.config import check, parse
from labdaq.errors import ConfigError
from labdaq.headers import certificates, expired
from labdaq.ports import PortKind, port_kind
from labdaq.script import SIXTEEN_EXPOSURES_S, Script
from labdaq.station import Arm, Station

HOME = Path(__file__).parents[2]
EXAMPLES = HOME / "labdaq" / "examples"

STATION = """
name = "s"
[site]
latitude_deg = 1
longitude_deg = 2
[[instrument]]
kind = "ls110"
name = "m"
port = "/dev/ttyUSB0"
"""


def mistakes(text: str, model: type[Station] | type[Script]) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        parse(text, model, "x.toml")
    assert caught.value.exit_code == 78
    lines = caught.value.message.splitlines()
    assert all(line.startswith("x.toml: ") for line in lines)
    return lines


def test_the_shipped_examples_are_good() -> None:
    for file in EXAMPLES.glob("*.toml"):
        station = file.name.startswith("station")
        (Station if station else Script).load(file)
    assert Station.built_in().emulated
    assert len(Script.load(EXAMPLES / "greenwood-test.toml").exposures.times_s) == 16
    assert Script.load(EXAMPLES / "greenwood-test.toml").planned_s == 148.0


def test_the_documentation_s_examples_are_good() -> None:
    """Every TOML block of docs/formats.md parses; station and script are put together from their sections."""
    text = (HOME / "docs" / "formats.md").read_text()
    station_part, script_part = text.split("## The test script")
    blocks = re.compile(r"```toml\n(.*?)```", re.DOTALL)
    station = "\n".join(blocks.findall(station_part))
    meter = '[[instrument]]\nkind = "ls110"\nname = "roof-luminance"\nport = "emulated"\ncalibration = "LS-2026-03"\n'
    assert parse(station + meter, Station, "docs").calibration[0].coverage_factor == 2.0
    (script,) = blocks.findall(script_part)
    written = parse(script, Script, "docs")
    plain = Script(test="T18", system="box")
    assert written.clock.max_error_s == Station.built_in().clock.max_error_s  # what the default means
    differ = {"exposures", "scan", "clock"}  # lists are shortened in the example
    assert written.model_dump(exclude=differ) == plain.model_dump(exclude=differ)
    for table, shortened in (("exposures", "times_s"), ("scan", "c_planes_deg")):
        assert written.model_dump()[table] | {shortened: 0} == plain.model_dump()[table] | {shortened: 0}


def test_three_mistakes_in_a_script_are_three_lines() -> None:
    found = mistakes(
        'test = "T/1"\nsystem = "box"\n[exposures]\ntimes_s = ["1/0"]\n[scan]\nc_plane_deg = [0, 90]\n', Script
    )
    assert found == [
        "x.toml: test: may hold letters, digits, '.', '_' and '-' only, not 'T/1'",
        "x.toml: exposures.times_s[1]: must be seconds, or a fraction such as '1/60', not '1/0'",
        "x.toml: scan.c_plane_deg: unknown key; did you mean 'c_planes_deg'?",
    ]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[exposures]\ntimes_s = [1, 0.5, 1]", "exposures.times_s: 1 s is given twice"),
        ("[exposures]\ntimes_s = [8]\nperiod_s = 5", "exposures.period_s: 5 s is too short for an exposure of 8 s"),
        ("[scan]\nc_planes_deg = [0, 360]", "scan.c_planes_deg[2]: must be less than 360, not 360"),
        ("[scan]\nc_planes_deg = [0, 90, 0]", "scan.c_planes_deg: the plane C = 0 is given twice"),
        ("[scan]\nperiod_s = 60", "limits: test_s = 300 is less than the 960 s"),
        ("[illuminance]\nperiod_s = 0.1", "illuminance.period_s: must be greater than or equal to 0.5"),
        ("[limits]\nstep_s = nan", "limits.step_s: must be"),
        ("[limits]\ntest_s = inf", "limits.test_s: must be a finite number"),
        ("[clock]\nrequire = 'suspend'", "clock.require: must be 'refuse' or 'flag', not 'suspend'"),
        ("repeats = 1.5", "repeats: must be a whole number, not 1.5"),
        ("sky = 3", "sky: must be 'clear', 'partly-cloudy', 'overcast' or 'unknown', not 3"),
        ("exposures = 3", "exposures: must be a table"),
        ("zzzz = 3", "zzzz: unknown key; known are "),
    ],
)
def test_a_script_s_mistakes_name_their_field(text: str, told: str) -> None:
    head = "" if text.startswith("[") else text + "\n"
    found = mistakes(f'{head}test = "a"\nsystem = "b"\n{"" if head else text}', Script)
    assert len(found) == 1
    assert told in found[0]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("/dev/ttyUSB0", "COM3", "instrument[m].port: 'COM3' is not a port; write /dev/tty..., tcp://host:port"),
        ("/dev/ttyUSB0", "usb:04b0:0119", "instrument: 'm': a ls110 cannot be reached on 'usb:04b0:0119'"),
        ("/dev/ttyUSB0", "emulated", "some instruments are emulated, but there is no [emulation] table"),
        ("ls110", "ls120", "instrument[m]: kind must be one of 'ls110', 'cl200', 'camera', 'goniophotometer', not "),
        ('kind = "ls110"', "", "instrument[m]: has no 'kind'"),
        ("port =", "prot =", "instrument[m].prot: unknown key; did you mean 'port'?"),
        ("latitude_deg = 1", "latitude_deg = 91", "site.latitude_deg: must be less than or equal to 90, not 91"),
        ("[site]", "[site]\nlongitud_deg = 3", "site.longitud_deg: unknown key; did you mean 'longitude_deg'?"),
        ('name = "m"', 'name = "m"\ncalibration = "C1"', "'m': there is no [[calibration]] with id 'C1'"),
        ("[site]", "[goniometer]\ngammas_deg = [5, 0]\n[site]", "goniometer.gammas_deg: the angles must increase"),
        ("[site]", "[goniometer]\ndark_v = [1, 2]\n[site]", "goniometer.dark_v: there are 10 heads, but 2 values"),
        ("[site]", "[emulation]\nstart = 2010-07-22T13:12:00\n[site]", "emulation.start: has no time zone; write UTC"),
        ("[site]", "[room]\nsize_m = [1, 2]\n[site]", "room.size_m[3]: is missing"),
    ],
)  # fmt: skip
def test_a_station_s_mistakes_name_their_field(old: str, new: str, told: str) -> None:
    assert old in STATION
    found = mistakes(STATION.replace(old, new, 1), Station)
    assert any(told in line for line in found), found


def test_instruments_that_collide_are_all_told() -> None:
    twice = (
        STATION + STATION[STATION.index("[[") :] + '[[calibration]]\nid = "C"\ninstrument = "n"\ndate = 2026-01-01\n'
    )
    found = mistakes(twice, Station)
    assert found == [
        "x.toml: instrument: instrument name 'm' is given twice",
        "x.toml: instrument: port '/dev/ttyUSB0' is given twice",
        "x.toml: instrument: channel 'sky.zenith' is given twice",
        "x.toml: instrument: certificate 'C' is for 'n', which is not an instrument here",
    ]


def test_files_that_cannot_be_read_say_why(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        Script.load(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="not UTF-8"):
        Script.load(tmp_path / "bytes.toml")
    (tmp_path / "bad.toml").write_text("a = 1\nb = = 2\n")
    with pytest.raises(ConfigError, match="line 2"):
        Script.load(tmp_path / "bad.toml")


@given(st.text(max_size=200))
def test_any_text_is_a_configuration_or_a_config_error(text: str) -> None:
    for model in (Script, Station):
        with pytest.raises(ConfigError):  # no text of this length is a whole file by chance
            parse(text, model, "x")


@given(
    st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5), st.lists, max_leaves=5)
)
def test_any_value_in_any_place_is_told_not_crashed(value: object) -> None:
    for key in ("exposures", "scan", "limits", "test", "clock"):
        data = {"test": "a", "system": "b"} | {key: value}
        try:
            check(data, Script, "x")
        except ConfigError as error:
            assert f"x: {key}" in error.message
    for entry in (value, {"kind": value}, {"kind": "cl200", "name": "n", "port": value, "heads": value}):
        data = {"name": "s", "site": {"latitude_deg": 1, "longitude_deg": 1}, "instrument": [entry]}
        with pytest.raises(ConfigError, match=r"x: instrument"):
            check(data, Station, "x")


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (PortKind.SERIAL, ["/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI"], ["ttyUSB0", "COM3", "/dev/my port"]),
        (
            PortKind.TCP,
            ["tcp://10.0.0.7:502", "tcp://[::1]:1", "tcp://lab:65535"],
            ["tcp://lab", "tcp://lab:0", "tcp://:5"],
        ),
        (PortKind.USB, ["usb", "usb:04B0:010d", "usb:*:*:4007219"], ["usb:4b0:119", "usb:", "usb:04b0"]),
        (PortKind.PTP_IP, ["ptpip://10.0.0.6", "ptpip://camera:15741"], ["ptpip://", "ptpip://a:99999", "ptpip:a"]),
        (PortKind.EMULATED, ["emulated"], ["emulate", "", " emulated"]),
    ],
)
def test_ports(kind: PortKind, good: list[str], bad: list[str]) -> None:
    assert [port_kind(text) for text in good] == [kind] * len(good)
    for text in bad:
        with pytest.raises(ValueError, match="is not a port"):
            port_kind(text)


def test_defaults_are_the_report_s() -> None:
    script = Script(test="a", system="b")
    assert script.exposures.times_s == SIXTEEN_EXPOSURES_S
    assert len(SIXTEEN_EXPOSURES_S) == 16
    assert script.scan.c_planes_deg == tuple(22.5 * k for k in range(16))
    arm = Station.built_in().goniometer
    assert arm.channels == tuple(f"gonio.g{g}" for g in (0, 5, 15, 25, 35, 45, 55, 65, 75, 85))
    assert len(arm.sensitivities_v_per_lx) == 10
    assert Arm().sensitivities_v_per_lx == (0.0003,) * 10


def test_certificates_are_hashed_and_expire(tmp_path: Path) -> None:
    text = (
        STATION
        + '[[calibration]]\nid = "C"\ninstrument = "m"\ndate = 2026-01-01\nexpires = 2026-06-30\nfile = "c.pdf"\n'
    )
    station = parse(text, Station, "x")
    with pytest.raises(ConfigError, match=r"calibration\[C\]\.file.*No such file"):
        certificates(station, tmp_path / "station.toml")
    (tmp_path / "c.pdf").write_bytes(b"certificate")
    (found,) = certificates(station, tmp_path / "station.toml")
    assert found.sha256 == hashlib.sha256(b"certificate").hexdigest()
    day_ns = 86_400 * 10**9
    assert expired(station, 20_634 * day_ns) == []  # 2026-06-30
    assert expired(station, 20_635 * day_ns) == ["C"]
