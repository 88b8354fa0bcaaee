"""Other people's programs talk to `labdaq emulate`: what we misread of a protocol, they did not."""

import json
import os
import shutil
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest
import serial

T = TypeVar("T")
HOME = Path(__file__).parents[2]
RATE = 5.0


def start(*options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "labdaq", "emulate", "--json", "--start", "2010-07-22T15:12:00Z", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=HOME,
        env=os.environ | {"PYTHONPATH": str(HOME)},
    )


def ready(process: subprocess.Popen[str]) -> dict[str, str]:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise AssertionError(process.communicate()[1])
    said = json.loads(line)
    assert said["ready"] is True
    assert list(said["endpoints"]) == [
        "ls110", "cl200_global", "cl200_diffuse", "camera_ptpip", "goniophotometer_rtu", "goniophotometer_tcp",
    ]  # fmt: skip
    endpoints: dict[str, str] = said["endpoints"]
    return endpoints


@pytest.fixture(scope="module")
def station() -> Iterator[dict[str, str]]:
    yield from running("--rate", str(RATE), "--camera", "generic", "--picture", "jpeg")


@pytest.fixture(scope="module")
def unhurried() -> Iterator[dict[str, str]]:
    """At the instruments' own pace."""
    yield from running()


def running(*options: str) -> Iterator[dict[str, str]]:
    process = start(*options)
    try:
        yield ready(process)
    finally:
        process.send_signal(signal.SIGTERM)
        rest, errors = process.communicate(timeout=60)
    assert (process.returncode, rest, errors) == (0, "", "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_well_when_told_to(number: signal.Signals) -> None:
    process = start()
    endpoints = ready(process)
    assert Path(endpoints["ls110"]).exists()
    process.send_signal(number)
    rest, errors = process.communicate(timeout=60)
    assert (process.returncode, rest, errors) == (0, "", "")


def test_a_taken_port_and_wrong_options_are_one_clear_error(station: dict[str, str]) -> None:
    taken = station["goniophotometer_tcp"].split(":")[1]
    for options, code, words in (
        (["--modbus-port", taken], 78, "cannot listen on 127.0.0.1"),
        (["--camera", "coolpix5400", "--picture", "raw", "--fault", "ls110:melt"], 78, "no fault 'melt'"),
        (["--fault", "camera_ptpip:drop"], 78, "has no serial line"),
        (["--rate", "0"], 64, "--rate"),
    ):
        process = start(*options)
        out, errors = process.communicate(timeout=60)
        assert process.returncode == code
        assert words in errors
        assert "Traceback" not in errors
        assert out == ""


# --- serial lines, with pyserial as users do ---


def opened(port: str, baud: int, stop_bits: int, timeout: float = 10) -> serial.Serial:
    """Open with 7 data bits and even parity. On a pty the kernel drops both, and glibc may then refuse with EINVAL."""
    for _ in range(50):
        try:
            return serial.Serial(port, baud, serial.SEVENBITS, serial.PARITY_EVEN, stop_bits, timeout=timeout)
        except termios.error:
            time.sleep(0.02)
    raise AssertionError("the pty refused its settings fifty times")


def test_ls110_as_psychopy_reads_it(station: dict[str, str]) -> None:
    for _ in range(3):  # programs open, measure and close
        with opened(station["ls110"], 4800, serial.STOPBITS_TWO) as port:
            port.write(b"MDS,04\r\n")
            assert port.readline() == b"OK00\r\n"
            port.write(b"MES\r\n")
            reply = port.readline()
        assert reply.startswith(b"OK00,CcPH ")
        value = float(reply.split()[-1])  # as clients do; right below 100 000 cd/m²
        assert 1000 < value < 20_000


def frame(body: str) -> bytes:
    inner = body.encode() + b"\x03"
    code = 0
    for byte in inner:
        code ^= byte
    return b"\x02" + inner + b"%02X\r\n" % code


def test_cl200_as_lux_clients_read_it(unhurried: dict[str, str]) -> None:
    """They clear the input right after writing, and read half a second after the trigger.

    A reply that comes at once is lost to them: at the line's pace they have 25 ms to clear the input. On a busy
    computer either side may be late all the same, so the sequence is begun again, as the maker's note says.
    """
    readings = {name: _lux(unhurried[name]) for name in ("cl200_global", "cl200_diffuse")}
    assert readings["cl200_global"] > 4 * readings["cl200_diffuse"] > 30_000


def _lux(device: str) -> float:
    with opened(device, 9600, serial.STOPBITS_ONE, timeout=3) as port:

        def ask(body: str) -> bytes:
            port.write(frame(body))
            port.reset_input_buffer()
            return bytes(port.read_until(b"\r\n"))

        for _ in range(10):
            connected = ask("00541   ")
            time.sleep(0.5)
            port.write(frame("99551  0"))
            time.sleep(0.5)
            external = ask("004010  ")
            time.sleep(0.5)
            port.write(frame("994021  "))
            time.sleep(0.5)
            reply = ask("00021200")
            well = (connected, external) == (frame("0054    "), frame("0040    "))
            if well and reply[6:9] in (b" 40", b" 30"):
                assert reply == frame(reply[1:-5].decode())
                return int(reply[10:14]) * 10.0 ** (int(reply[14:15]) - 4)
    raise AssertionError(f"ten sequences, and the last gave {connected!r}, {external!r}, {reply!r}")


def test_the_same_pty_opened_many_times(station: dict[str, str]) -> None:
    for _ in range(20):
        with serial.Serial(station["ls110"], 4800, timeout=10) as port:
            port.write(b"CCR\r\n")
            assert port.readline() == b"OK00,1.000\r\n"


# --- Modbus ---


def test_minimalmodbus_moves_the_arm_and_reads_heads(station: dict[str, str]) -> None:
    import minimalmodbus

    drive = minimalmodbus.Instrument(station["goniophotometer_rtu"], 1)
    drive.serial.baudrate = 115_200
    drive.serial.timeout = 1.0
    try:
        drive.write_register(0x6002, 0x20, functioncode=6)
        _until(lambda: drive.read_register(0x1003) & 0x44 == 0x40)
        drive.write_registers(0x6200, [1, 0, 1250, 6, 100, 100, 0, 0x10])
        _until(lambda: drive.read_long(0x1014, signed=True) == 1250)
        sensors = minimalmodbus.Instrument(station["goniophotometer_rtu"], 2)
        codes = [c - 0x10000 if c & 0x8000 else c for c in sensors.read_registers(0, 8, functioncode=4)]
        assert codes[0] > codes[-1] > 10
        assert sensors.read_bit(0x0110, functioncode=1) in (0, 1)
        with pytest.raises(minimalmodbus.IllegalRequestError):
            drive.read_register(0x5000)
        stranger = minimalmodbus.Instrument(station["goniophotometer_rtu"], 9)
        stranger.serial.timeout = 0.3
        with pytest.raises(minimalmodbus.NoResponseError):
            stranger.read_register(0)
    finally:
        drive.serial.close()


def test_pymodbustcp_reads_the_same_units(station: dict[str, str]) -> None:
    from pyModbusTCP.client import ModbusClient

    host, port = station["goniophotometer_tcp"].split(":")
    drive = ModbusClient(host, int(port), unit_id=1, timeout=10, auto_open=True)
    assert drive.write_single_register(0x600F, 9)
    assert drive.read_holding_registers(0x600F, 2) == [9, 1]
    assert drive.read_holding_registers(0x5000, 1) is None
    assert drive.last_except == 2
    sensors = ModbusClient(host, int(port), unit_id=3, timeout=10, auto_open=True)
    assert len(sensors.read_input_registers(0, 8)) == 8
    assert sensors.write_single_register(0x0101, 0x0A)
    assert sensors.read_holding_registers(0x0100, 2) == [0x08, 0x0A]
    assert sensors.write_single_coil(0x0104, True)
    assert sensors.read_coils(0x0104, 1) == [True]
    assert sensors.read_discrete_inputs(0x80, 8) == [False] * 8
    drive.close()
    sensors.close()


def test_mbpoll_reads_over_both_lines(station: dict[str, str]) -> None:
    mbpoll = shutil.which("mbpoll") or pytest.skip("mbpoll (Debian) is not installed")
    host, port = station["goniophotometer_tcp"].split(":")
    for where in (
        ["-m", "tcp", "-p", port, host],
        ["-m", "rtu", "-b", "115200", "-P", "none", station["goniophotometer_rtu"]],
    ):
        done = subprocess.run(
            [mbpoll, "-1", "-q", "-0", "-a", "1", "-t", "4:hex", "-r", str(0x0001), *where],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        assert "0x2710" in done.stdout
        done = subprocess.run(
            [mbpoll, "-1", "-q", "-0", "-a", "1", "-t", "4", "-r", str(0x5000), *where],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert "Illegal data address" in done.stdout + done.stderr


# --- camera ---


@pytest.fixture
def standard_input() -> Iterator[None]:
    """Open again afterwards: libgphoto2 closes descriptor 0 where it leaves a camera on the network."""
    kept = os.dup(0)
    yield
    os.dup2(kept, 0)
    os.close(kept)


@pytest.mark.usefixtures("standard_input")
def test_python_gphoto2_takes_a_picture(station: dict[str, str]) -> None:
    gp = pytest.importorskip("gphoto2")
    host, port = station["camera_ptpip"].split(":")
    ports, models = gp.PortInfoList(), gp.CameraAbilitiesList()
    ports.load()
    models.load()
    camera = gp.Camera()
    camera.set_port_info(ports[ports.lookup_path(f"ptpip:{host}:{port}:{port}")])
    camera.set_abilities(models[models.lookup_model("PTP/IP Camera")])
    camera.init()
    try:
        assert "Emulated DSLR" in camera.get_summary().text
        shutter = camera.get_single_config("shutterspeed")
        assert shutter.count_choices() == 52
        shutter.set_value("0.0005s")
        camera.set_single_config("shutterspeed", shutter)
        assert camera.get_single_config("shutterspeed").get_value() == "0.0005s"
        taken = camera.capture(gp.GP_CAPTURE_IMAGE)
        assert (taken.folder, taken.name) == ("/store_00010001/DCIM/100NIKON", "DSCN0001.JPG")
        file = camera.file_get(taken.folder, taken.name, gp.GP_FILE_TYPE_NORMAL)
        picture = bytes(file.get_data_and_size())  # a view of the file's memory: the file must outlive it
        assert picture[:4] == b"\xff\xd8\xff\xe1"
        assert picture[-2:] == b"\xff\xd9"
        camera.file_delete(taken.folder, taken.name)
        assert camera.folder_list_files(taken.folder).count() == 0
    finally:
        camera.exit()


def test_gphoto2_downloads_a_picture(station: dict[str, str], tmp_path: Path) -> None:
    gphoto2 = shutil.which("gphoto2") or pytest.skip("gphoto2 (Debian) is not installed")
    host, port = station["camera_ptpip"].split(":")
    done = subprocess.run(
        [gphoto2, "--port", f"ptpip:{host}:{port}:{port}", "--capture-image-and-download", "--filename", "sky.%C"],
        capture_output=True, text=True, timeout=60, cwd=tmp_path, check=False, env=os.environ | {"HOME": str(tmp_path)},
    )  # fmt: skip
    assert (tmp_path / "sky.JPG").is_file(), done.stdout + done.stderr  # its exit code is 0 even when it failed
    assert (tmp_path / "sky.JPG").read_bytes()[:4] == b"\xff\xd8\xff\xe1"


def _until(condition: Callable[[], bool]) -> None:
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("it never became true")
