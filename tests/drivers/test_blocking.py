"""The instruments without asyncio, over pseudo-terminals, TCP and a pyusb backend, with scripts in threads behind."""

import asyncio
import os
import signal
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
from bench import Bench, Drive, Module
from camera_bench import Model, UsbFront

from drivers import blocking, cl200, ls110, ports
from drivers.camera import CameraOptions, PtpIp, UsbPtp
from drivers.cl200.codec import check_sum
from drivers.goniophotometer import ArmOptions, Framing, GoniophotometerOptions, LineOptions
from drivers.serial_port import SerialTransport
from drivers.tcp import TcpTransport
from labdaq.errors import ConfigError, ConnectError
from labdaq.reading import Flag

PATIENT = GoniophotometerOptions(
    line=LineOptions(framing=Framing.TCP, timeout_s=20.0, worst_reply_s=20.0), arm=ArmOptions(start_s=20.0)
)


@contextmanager
def on_terminal(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """A pseudo-terminal on which a thread answers each line that ends with CR LF; yields its path."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def serve() -> None:
        received = b""
        while True:
            try:
                received += os.read(master, 256)
            except OSError:
                return
            while b"\r\n" in received:
                line, _, received = received.partition(b"\r\n")
                if line == b"END":
                    return
                os.write(master, answer(line + b"\r\n"))

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.write(slave, b"END\r\n")
        serving.join()
        os.close(slave)
        os.close(master)


@contextmanager
def on_tcp(table: Bench) -> Iterator[int]:
    """The bench model behind Modbus TCP, in a thread with its own loop; yields the port."""
    loop = asyncio.new_event_loop()
    ready: list[int] = []
    begun, over = threading.Event(), asyncio.Event()

    async def converse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while header := await reader.read(6):
            request = header + await reader.readexactly(header[5])
            table.asked.append((loop.time(), request))
            body = table.obey(request[6:])
            writer.write(request[:4] + len(body).to_bytes(2, "big") + body)
        writer.close()
        await writer.wait_closed()
        over.set()

    async def serve() -> None:
        server = await asyncio.start_server(converse, "127.0.0.1", 0)
        ready.append(server.sockets[0].getsockname()[1])
        begun.set()
        await over.wait()
        server.close()
        await server.wait_closed()

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()))
    thread.start()
    begun.wait()
    yield ready[0]
    thread.join()
    loop.close()


def test_a_luminance_meter_on_a_terminal() -> None:
    asked: list[bytes] = []

    def answer(command: bytes) -> bytes:
        asked.append(command)
        return b"OK00,CcPH 125.3\r\n" if command in {b"MES\r\n", b"DSR\r\n"} else b"OK00\r\n"

    with on_terminal(answer) as port:
        for _ in range(2):  # opening a terminal again is where 7E fails
            with blocking.LuminanceMeter(port, ls110.LuminanceMeterOptions(channel="sky.zenith")) as meter:
                reading = meter.read()
                assert (reading.channel, reading.value, reading.flags) == ("sky.zenith", 125.3, ())
                assert reading.clock.source == "system"
                assert meter.held().flags == (Flag.STALE,)
                assert meter.identity().port == port
    assert asked[:4] == [b"MDS,04\r\n", b"MDS,09\r\n", b"MDS,00\r\n", b"MES\r\n"]


def test_a_chroma_meter_on_a_terminal() -> None:
    def framed(body: bytes) -> bytes:
        return b"\x02" + body + b"\x03" + check_sum(body + b"\x03") + b"\r\n"

    replies = {
        b"54": framed(b"0054    "),
        b"40": framed(b"0040    "),
        b"02": framed(b"00021 20+32543+38560+40400"),
    }

    def answer(command: bytes) -> bytes:
        return b"" if command[1:3] == b"99" else replies[command[3:5]]

    with on_terminal(answer) as port, blocking.ChromaMeter(port, cl200.ChromaMeterOptions(timeout_s=20.0)) as meter:
        assert [reading.value for reading in meter.measure()] == [325.4, 0.3856, 0.404]


def test_a_port_that_is_not_there() -> None:
    with pytest.raises(ConnectError, match="no such port"), blocking.LuminanceMeter("/dev/ttyNOWHERE"):
        pytest.fail("there is nothing to enter")


def test_a_goniophotometer_on_modbus_tcp() -> None:
    table = Bench(Drive(lag_s=0.0), {2: Module(codes=[0x4000] * 8), 3: Module()}, tcp=True)
    with on_tcp(table) as port:
        options = replace(PATIENT, arm=ArmOptions(speed_rpm=60, settle_s=0.0, poll_s=0.01, start_s=20.0))
        with blocking.Goniophotometer(f"tcp://127.0.0.1:{port}", options) as gonio:
            gonio.home()
            assert gonio.move_to(22.5) == 22.5
            assert gonio.read()[0].value == pytest.approx(0x4000 / 32767 * 10 * 100 / 3)


@pytest.fixture
def heeds_interrupts() -> Iterator[None]:
    """A shell's background jobs ignore interrupts, and so do the tests that one runs."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_stops_the_arm_before_it_is_raised() -> None:
    table = Bench(Drive(lag_s=0.0), tcp=True)
    with on_tcp(table) as port:
        gonio = blocking.Goniophotometer(f"tcp://127.0.0.1:{port}", PATIENT)
        with gonio:
            begun = threading.Event()

            def interrupt() -> None:
                begun.wait()
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

            go = table.drive.go

            def watched(block: list[int]) -> None:
                go(block)
                threading.Timer(0.1, begun.set).start()

            table.drive.go = watched  # type: ignore[method-assign]
            threading.Thread(target=interrupt).start()
            with pytest.raises(KeyboardInterrupt):
                gonio.move_to(350.0)  # half a minute away
            assert table.drive.stopped == 1  # by the time the interrupt is seen


def test_framing_follows_the_port() -> None:
    assert blocking.Goniophotometer("tcp://10.0.0.5:502")._driver.options.line.framing is Framing.TCP
    assert blocking.Goniophotometer("/dev/ttyUSB0")._driver.options.line.framing is Framing.RTU


def test_a_camera_on_usb() -> None:
    model = Model()
    link = UsbPtp("camera", backend=UsbFront(model))
    with blocking.Camera(link, CameraOptions(grace_s=0.02)) as camera:
        assert len(camera.exposures_s) == 16
        assert [photo.exposure_s for photo in camera.bracket([1.0, 0.5])] == [1.0, 0.5]
        assert len(camera.expose()) == 1
    assert model.released == 3


def test_a_blocking_call_inside_the_loop_is_refused() -> None:
    async def inside() -> None:
        async def nothing() -> None: ...

        blocking._BACKGROUND.run(nothing())

    with pytest.raises(RuntimeError, match="wait for itself"):
        blocking._BACKGROUND.run(inside())


# Ports in words


def test_lines() -> None:
    serial_line = ports.line("meter", "/dev/ttyUSB0", ls110.LINE)
    assert isinstance(serial_line, SerialTransport) and serial_line.settings == ls110.LINE
    tcp_line = ports.line("gonio", "tcp://10.0.0.5:502", ls110.LINE)
    assert isinstance(tcp_line, TcpTransport) and str(tcp_line.place) == "gonio on 10.0.0.5:502"
    six = ports.line("gonio", "tcp://[::1]:502", ls110.LINE)
    assert six.place.port == "::1:502"


@pytest.mark.parametrize("port", ["COM3", "", "tcp://", "tcp://host", "tcp://host:x", "tcp://:502", "ttyUSB0", "usb"])
def test_what_is_no_line(port: str) -> None:
    with pytest.raises(ConfigError, match="meter: "):
        ports.line("meter", port, ls110.LINE)


@pytest.mark.parametrize(
    ("port", "place"),
    [
        ("usb", "usb:*:*"),
        ("usb:04b0:010d", "usb:04b0:010d"),
        ("usb:*:*:4007219", "usb:*:*:4007219"),
        ("usb:04B0:*", "usb:04b0:*"),
        ("ptpip://10.0.0.6", "10.0.0.6:15740"),
        ("ptpip://10.0.0.6:15741", "10.0.0.6:15741"),
    ],
)
def test_camera_links(port: str, place: str) -> None:
    link = ports.camera_link("camera", port)
    assert link.place.port == place
    assert isinstance(link, PtpIp if port.startswith("ptpip") else UsbPtp)


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "usb:04b0", "usb:wxyz:0000", "ptpip://", "usb:1:2:3:4"])
def test_what_is_no_camera(port: str) -> None:
    with pytest.raises(ConfigError, match="camera: "):
        ports.camera_link("camera", port)
