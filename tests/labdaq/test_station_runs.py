"""Whole tests on the emulated station: real drivers, real wire protocols, one world; in virtual and in real time."""

import asyncio
import json
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from labdaq.acquisition import acquire
from labdaq.bench import Bench
from labdaq.build import bench_on, mount
from labdaq.cli import cli
from labdaq.clock import VirtualClock, utc_ns_of
from labdaq.config import parse
from labdaq.emulation import Emulators, emulators
from labdaq.equipment import AnyInstrument
from labdaq.errors import ConfigError, DeviceError, LabdaqError, RefusedError
from labdaq.headers import Order
from labdaq.reading import Flag
from labdaq.runs import choose_clock, run
from labdaq.script import Script
from labdaq.seal import verify
from labdaq.session import Session, list_sessions
from labdaq.station import Station
from labdaq.stopping import Stop
from labdaq.virtual_time import run_virtual
from labdaq.worlds import world_of
from simulators.goniophotometer import BentArm

HOME = Path(__file__).parents[2]
GREENWOOD = HOME / "labdaq" / "examples" / "greenwood-test.toml"
SHORT = """
test = "short"
system = "box"
[exposures]
times_s = ["1/4", "1/1000"]
period_s = 9
[scan]
c_planes_deg = [0, 22.5, 45]
period_s = 5
"""


def short(folder: Path, more: str = "") -> Order:
    return Order(Station.built_in(), parse(more + SHORT, Script, "short"), folder)


def uneven() -> Station:
    """The built-in station, with heads that differ in sensitivity and dark voltage."""
    data = Station.built_in().model_dump(mode="json")
    data["goniometer"]["sensitivity_v_per_lx"] = [0.0003 * (1 + 0.02 * (k % 3 - 1)) for k in range(10)]
    data["goniometer"]["dark_v"] = [0.002 * k for k in range(10)]
    return Station.model_validate(data)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The report's test, in virtual time."""
    order = Order(uneven(), Script.load(GREENWOOD), tmp_path_factory.mktemp("sessions"), None, GREENWOOD)
    (path,) = run(order, mount, virtual=True)
    return Session.open(path)


def test_a_whole_test_crosses_every_wire(whole: Session) -> None:
    assert whole.outcome == "finished"
    assert verify(whole.path).problems == ()
    photos = whole.photos()
    assert len(photos) == 16
    assert all((whole.path / p.file).read_bytes().startswith(b"\xff\xd8\xff") for p in photos)
    assert [p.nominal_exposure_s for p in photos] == sorted((p.nominal_exposure_s for p in photos), reverse=True)
    assert len(whole.readings("sky.zenith")) == 16
    for gamma in (0, 5, 15, 25, 35, 45, 55, 65, 75, 85):
        readings = whole.readings(f"gonio.g{gamma}")
        assert list(readings.at("c_deg")) == [22.5 * k for k in range(16)]
        assert set(readings.at("gamma_deg")) == {gamma}
    wrong = {Flag.MOVED, Flag.LATE, Flag.OVER_RANGE, Flag.SATURATED, Flag.MISSING}
    assert not any(wrong.intersection(r.flags) for r in whole.readings())
    assert len(whole.readings("sky.global")) == len(whole.readings("sky.diffuse")) > 70
    assert {i.name for i in whole.header.instruments} == {e.name for e in whole.station.instrument}


def test_what_was_read_is_what_the_world_shows(whole: Session) -> None:
    """Within the instruments' own standard uncertainty: three of it, since noise is drawn anew for each reading."""
    world = world_of(whole.station)
    up = np.array([0.0, 0.0, 1.0])
    true = {
        "sky.zenith": lambda t, r: float(world.sky_luminance(up, t)),
        "sky.global": lambda t, r: world.roof_illuminance(up, t),
        "sky.diffuse": lambda t, r: world.roof_illuminance(up, t, 5.0),
    } | {
        f"gonio.g{g}": lambda t, r: float(world.room_illuminance(np.array([r.at["gamma_deg"]]), r.at["c_deg"], t)[0])
        for g in (0, 5, 15, 25, 35, 45, 55, 65, 75, 85)
    }
    for channel, truth in true.items():
        for reading in whole.readings(channel):
            assert reading.value is not None
            assert reading.uncertainty is not None
            off = abs(reading.value - truth(reading.utc_ns, reading))
            assert off < 3 * reading.uncertainty, (channel, reading.value, off)


def test_virtual_time_is_reproducible(tmp_path: Path) -> None:
    values = []
    for trial in ("a", "b"):
        (path,) = run(short(tmp_path / trial), mount, virtual=True)
        session = Session.open(path)
        values.append([(r.channel, r.utc_ns, r.value, r.raw) for r in session.readings()])
        values.append([p.sha256 for p in session.photos()])
    assert values[:2] == values[2:]


def test_raw_pictures_are_asked_for_and_missed(tmp_path: Path) -> None:
    raw = "[exposures]\ntimes_s = [0.25]\nphoto_format = 'raw'\n"
    order = Order(Station.built_in(), parse(f"test = 'r'\nsystem = 'box'\n{raw}", Script, "raw"), tmp_path)
    with pytest.raises(RefusedError, match=r"asks for RAW pictures, the camera gave .*\.JPG"):
        run(order, mount, virtual=True)
    (path,) = run(order, lambda *given: mount(*given, raw=True), virtual=True)
    assert [Path(p.file).suffix for p in Session.open(path).photos()] != [".jpg"]


def test_something_may_be_concealed_in_an_instrument(tmp_path: Path) -> None:
    def crooked(entry: AnyInstrument, options: Any) -> Any:
        if entry.kind == "goniophotometer":
            return replace(options, arm=BentArm(c_offset_deg=30.0))
        return options

    values = []
    for name, alter in (("true", None), ("crooked", crooked)):
        (path,) = run(short(tmp_path / name), partial(mount, alter=alter), virtual=True)
        values.append(Session.open(path).readings("gonio.g65").value)
    assert np.max(np.abs(values[1] / values[0] - 1)) > 0.05


def spoilt(folder: Path, when_s: float, spoil: Callable[[Emulators], None]) -> tuple[LabdaqError, Emulators]:
    """Run the short test, break something at a time, and return the error it ends with."""
    order = short(folder)
    kept: list[Emulators] = []

    async def main() -> LabdaqError:
        clock = VirtualClock(utc_ns_of(order.station.emulation.start))  # type: ignore[union-attr, arg-type]

        @asynccontextmanager
        async def mounted() -> AsyncIterator[Bench]:
            async with emulators(order.station, world_of(order.station), clock, memory=True) as running:
                kept.append(running)
                asyncio.get_running_loop().call_later(when_s, spoil, running)
                yield bench_on(order.station, clock, running)

        with pytest.raises(LabdaqError) as caught:
            await acquire(order, mounted, clock, Stop(), lambda body: None, inline=True)
        return caught.value

    return run_virtual(main()), kept[0]


def arm_c_deg(running: Emulators, clock_ns: int) -> float:
    return float(running.parts["goniophotometer"].arm.c_deg(clock_ns)) % 360.0


def test_a_meter_that_falls_silent_is_named_and_the_arm_is_parked(tmp_path: Path) -> None:
    def switch_off(running: Emulators) -> None:
        running.parts["roof-luminance"].remote_mode = False

    error, running = spoilt(tmp_path, 15.0, switch_off)
    assert isinstance(error, DeviceError)
    assert "roof-luminance on memory:roof-luminance" in str(error)
    assert "in step zenith-0" in str(error)
    assert "NOT parked" not in str(error)
    assert arm_c_deg(running, 10**15) == pytest.approx(0.0, abs=0.1)
    (found,) = list_sessions(tmp_path)
    assert found.outcome == "failed"
    assert verify(found.path).problems == ()
    assert found.events("session.end")[0].body["arm"] == "parked"


def test_a_blocked_arm_is_told_as_not_parked(tmp_path: Path) -> None:
    def block(running: Emulators) -> None:
        running.parts["goniophotometer"].axis.raise_alarm(0x180)

    error, _ = spoilt(tmp_path, 20.0, block)
    assert "goniophotometer" in str(error)
    assert "alarm 0x180" in str(error).lower()
    assert "the arm is NOT parked" in str(error)
    assert list_sessions(tmp_path)[0].sealed


def test_real_instruments_have_no_virtual_time() -> None:
    data = Station.built_in().model_dump(mode="json")
    data["instrument"][0]["port"] = "/dev/ttyUSB0"
    station = Station.model_validate(data)
    for given in ({"virtual": True, "rate": None}, {"virtual": False, "rate": 10.0}):
        with pytest.raises(ConfigError, match="'roof-luminance' on /dev/ttyUSB0 is real"):
            choose_clock(station, **given)  # type: ignore[arg-type]


def test_a_station_without_what_a_test_needs_is_refused(tmp_path: Path) -> None:
    data = Station.built_in().model_dump(mode="json")
    data["instrument"] = data["instrument"][:1]
    with pytest.raises(ConfigError) as caught:
        mount(Station.model_validate(data), VirtualClock(0), True)
    assert len(caught.value.message.splitlines()) == 3


# The commands


def invoke(*arguments: str) -> Result:
    return CliRunner().invoke(cli, arguments, catch_exceptions=True)


def lines(output: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in output.splitlines()]


KEYS = {
    "session": {"event", "test", "system", "sky", "started", "session"},
    "reading": {"event", "step", "utc", "channel", "value", "unit", "uncertainty", "flags", "at"},
    "photo": {"event", "step", "utc", "file", "sha256", "size", "exposure_s", "nominal_exposure_s"},
    "step": {"event", "step", "instrument", "lateness_s", "took_s"},
    "clock": {"event", "source", "synchronised", "max_error_s", "good", "stepped_s"},
    "fault": {"event", "instrument", "step", "error", "message"},
    "end": {"event", "outcome", "reason", "arm"},
    "result": {"event", "exit_code", "sessions", "error"},
}


def test_run_json_prints_documented_lines_and_nothing_else(tmp_path: Path) -> None:
    script = tmp_path / "script.toml"
    script.write_text(SHORT)
    result = invoke("run", str(script), "--time", "virtual", "--json", "--sessions", str(tmp_path / "s"))
    assert result.exit_code == 0
    events = lines(result.stdout)
    assert all(set(e) == KEYS[e["event"]] for e in events)
    (path,) = events[-1]["sessions"]
    session = Session.open(path)
    assert sum(e["event"] == "reading" for e in events) == len(session.readings())
    assert session.header.script_file["name"] == "script.toml"
    assert {e["event"] for e in events} == set(KEYS) - {"fault"}

    listed = lines(invoke("session", "ls", str(tmp_path / "s"), "--json").stdout)
    assert [line["outcome"] for line in listed] == ["finished"]
    (shown,) = lines(invoke("session", "show", path, "--json").stdout)
    assert shown["channels"]["gonio.g45"]["readings"] == 3
    assert "late by" in invoke("session", "show", path).output
    (verified,) = lines(invoke("session", "verify", path, "--json").stdout)
    assert verified["ok"]


def test_damage_is_exit_code_65(tmp_path: Path) -> None:
    (path,) = run(short(tmp_path), mount, virtual=True)
    photo = path / Session.open(path).photos()[0].file
    photo.chmod(0o644)
    photo.write_bytes(b"something else")
    result = invoke("session", "verify", str(path))
    assert isinstance(result.exception, LabdaqError)
    assert result.exception.exit_code == 65
    assert "DAMAGED" in result.output
    assert "is not what was recorded" in result.output

    run(short(tmp_path), mount, virtual=True)
    (path / "session.json").chmod(0o644)
    (path / "session.json").write_text("{}")
    listed = invoke("session", "ls", str(tmp_path))
    assert len(listed.output.splitlines()) == 1  # the good one is listed, the other told
    assert path.name in str(listed.exception)


def test_a_script_and_a_station_with_mistakes_are_refused_together_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "script.toml").write_text('test = "a"\nsystem = "b"\nrepeat = 2\n')
    (tmp_path / "station.toml").write_text('name = "s"\n[site]\nlatitude_deg = 1\nlongitude_deg = 200\n')
    result = invoke("run", str(tmp_path / "script.toml"), "--station", str(tmp_path / "station.toml"), "--json")
    assert isinstance(result.exception, ConfigError)
    assert result.stdout == ""
    text = result.exception.message
    assert all(part in text for part in ("did you mean 'repeats'", "site.longitude_deg", "instrument: is missing"))
    assert {f.name for f in tmp_path.iterdir()} == {"script.toml", "station.toml"}
    assert "examples are greenwood-test, short-test" in str(invoke("run", "nonsense").exception)


def test_doctor_finds_what_is_missing(tmp_path: Path) -> None:
    text = (HOME / "labdaq" / "examples" / "station.toml").read_text()
    station = tmp_path / "station.toml"
    station.write_text(text.replace('port = "emulated"', 'port = "/dev/nothing"', 1).replace("rate = 1.0", "rate = 20"))
    result = invoke("doctor", "--station", str(station), "--json")
    assert result.exit_code == 69
    found = {line["name"]: line for line in lines(result.stdout)}
    assert not found["roof-luminance"]["ok"]
    assert "/dev/nothing" in found["roof-luminance"]["what"]
    assert found["roof-luminance"]["try"]
    assert [found[n]["ok"] for n in ("roof-global", "roof-diffuse", "roof-camera", "goniophotometer")] == [True] * 4
    assert "sky.global" in found["roof-global"]["readings"]
    assert len(found["goniophotometer"]["readings"]) == 10


def test_doctor_is_content_with_the_emulated_station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = invoke("doctor")
    assert result.exit_code == 0
    assert result.output.count("ok  ") == 7
    assert list(tmp_path.iterdir()) == []


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, labdaq.cli\n"
        "from click.testing import CliRunner\n"
        "assert 'doctor' in CliRunner().invoke(labdaq.cli.cli, ['--help']).output\n"
        "print([m for m in ('numpy', 'pandas', 'pydantic', 'rich', 'asyncio', 'drivers.ls110') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment())
    assert done.stdout.strip() == "[]"


# Real time, real ports, real signals


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(HOME)}


def start(script: Path, sessions: Path) -> "subprocess.Popen[str]":
    """Start a run as fast as the clock on the wall: faster, and a busy machine has less than a meter's five seconds."""
    script.write_text(SHORT)
    command = [sys.executable, "-m", "labdaq", "run", str(script), "--json", "--rate", "1", "--sessions", str(sessions)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())


def read_until(program: "subprocess.Popen[str]", enough: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
    assert program.stdout
    seen = []
    for line in program.stdout:
        seen.append(json.loads(line))
        if enough(seen[-1]):
            return seen
    _, err = program.communicate(timeout=60)  # or the next test is blamed for what is left open
    raise AssertionError(f"the run ended early: {err}")


def test_sigterm_parks_and_seals_over_real_ports(tmp_path: Path) -> None:
    program = start(tmp_path / "script.toml", tmp_path / "s")
    seen = read_until(program, lambda e: e["event"] == "step" and e["step"] == "plane-00")
    program.send_signal(signal.SIGTERM)
    out, err = program.communicate(timeout=60)
    seen += lines(out)
    assert program.returncode == 1
    assert "stopped by SIGTERM" in err
    assert "Traceback" not in err
    assert seen[-1]["exit_code"] == 1
    assert seen[-2] == {"event": "end", "outcome": "interrupted", "reason": seen[-1]["error"], "arm": "parked"}
    (path,) = seen[-1]["sessions"]
    result = verify(Path(path))
    assert (result.sealed, result.problems) == (True, ())


def test_kill_9_of_a_run_loses_nothing_it_told(tmp_path: Path) -> None:
    program = start(tmp_path / "script.toml", tmp_path / "s")
    seen = read_until(program, lambda e: e["event"] == "reading" and e["channel"].startswith("gonio"))
    killer = threading.Timer(random.uniform(0.0, 1.0), program.kill)
    killer.start()
    out, _ = program.communicate()
    killer.join()
    assert program.returncode == -signal.SIGKILL
    seen += lines("\n".join(out.splitlines()[:-1] if not out.endswith("\n") else out.splitlines()))
    session = Session.open(next(e["session"] for e in seen if e["event"] == "session"))
    told = [(e["channel"], e["value"]) for e in seen if e["event"] == "reading"]
    kept = [(r.channel, r.value) for r in session.readings()]
    assert told
    assert all(reading in kept for reading in told)
    files = {p.file for p in session.photos()}
    assert {e["file"] for e in seen if e["event"] == "photo"} <= files
    assert session.outcome == "open"
    assert invoke("session", "seal", str(session.path)).exit_code == 0
    assert verify(session.path).problems == ()
    assert Session.open(session.path).outcome == "crashed"


@pytest.mark.parametrize(("sky", "system"), [("clear", "tube"), ("partly-cloudy", "box"), ("overcast", "top")])
def test_the_emulation_table_shapes_the_world(sky: str, system: str) -> None:
    data = Station.built_in().model_dump(mode="json")
    data["emulation"] |= {"sky": sky, "system": system}
    world = world_of(Station.model_validate(data))
    noon_ns = utc_ns_of(datetime(2010, 7, 22, 17, 30, tzinfo=UTC))
    beam = world.sun(noon_ns).normal_illuminance_lx
    assert {"clear": beam > 8e4, "partly-cloudy": 6e4 < beam < 8e4, "overcast": beam < 1.0}[sky]
    assert world.options.system == system
    data["emulation"]["cloud_cover"] = 0.5
    cloudy = world_of(Station.model_validate(data))
    moments = [noon_ns + k * 20 * 10**9 for k in range(60)]
    beams = [cloudy.sun(t).normal_illuminance_lx for t in moments]
    assert max(beams) <= max(world.sun(t).normal_illuminance_lx for t in moments)
    assert sky == "overcast" or np.ptp(beams) > 0.1 * max(beams)
    del data["emulation"]
    for entry in data["instrument"]:
        entry["port"] = "usb" if entry["kind"] == "camera" else f"/dev/{entry['name']}"
    with pytest.raises(ConfigError, match="need an \\[emulation\\] table"):
        world_of(Station.model_validate(data))
