"""The lines themselves: memory, TCP, and serial ports on real pseudo-terminals."""

import asyncio
import os
import socket
import termios
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from drivers import cl200, ls110, serial_port
from drivers.exchange import answer_within, open_within, span
from drivers.serial_port import SerialSettings, SerialTransport, is_pseudo_terminal, possible_settings
from drivers.tcp import TcpTransport
from drivers.transport import PipeTransport, Transport
from labdaq.clock import SystemClock, VirtualClock
from labdaq.errors import ConnectError, DeviceTimeout, ProtocolError
from labdaq.pipe import pipe
from labdaq.virtual_time import run_virtual

CLOCK = SystemClock()


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: the emulator's descriptor, and the path a driver opens."""
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


async def soon(line: Transport, count: int) -> bytes:
    async with CLOCK.timeout(30):  # generous: a busy machine, not the line, decides
        return await line.read_exactly(count)


# Memory


def test_reading_by_end_and_by_count() -> None:
    async def main() -> None:
        near, far = pipe()
        line = PipeTransport("meter", near)
        far.write(b"one\r")
        far.write(b"\ntwo\r\nthree")
        assert await line.read_until(b"\r\n", 64) == b"one\r\n"
        assert await line.read_until(b"\r\n", 64) == b"two\r\n"
        assert await line.read_exactly(3) == b"thr"
        assert line.pending == b"ee"

    run_virtual(main())


def test_an_end_split_at_every_place_is_found() -> None:
    async def main() -> None:
        whole = b"OK00,CcPH 125.3\r\n"
        for cut in range(1, len(whole)):
            near, far = pipe()
            line = PipeTransport("meter", near)
            reading = asyncio.create_task(line.read_until(b"\r\n", 64))
            far.write(whole[:cut])
            await asyncio.sleep(0.1)
            far.write(whole[cut:])
            assert await reading == whole

    run_virtual(main())


def test_a_wait_cut_short_loses_nothing() -> None:
    async def main() -> None:
        near, far = pipe()
        line, clock = PipeTransport("meter", near), VirtualClock(0)
        far.write(b"half")
        with pytest.raises(TimeoutError):
            async with clock.timeout(1.0):
                await line.read_until(b"\r\n", 64)
        far.write(b" whole\r\n")
        assert await line.read_until(b"\r\n", 64) == b"half whole\r\n"

    run_virtual(main())


def test_too_much_without_an_end() -> None:
    async def main() -> None:
        near, far = pipe()
        line = PipeTransport("meter", near, "/dev/ttyS0")
        far.write(b"x" * 65)
        with pytest.raises(ProtocolError, match="meter on /dev/ttyS0: 65 bytes came without"):
            await line.read_until(b"\r\n", 64)
        assert line.pending == b""

    run_virtual(main())


def test_draining_takes_what_came_and_does_not_wait() -> None:
    async def main() -> None:
        near, far = pipe()
        line = PipeTransport("meter", near)
        assert await line.drain_input() == b""
        far.write(b"stale")
        assert await line.drain_input() == b"stale"
        far.write(b"new")
        assert await line.read_exactly(3) == b"new"
        far.write(b"last")
        far.close()
        assert await line.drain_input() == b"last"
        assert await line.drain_input() == b""

    run_virtual(main())


def test_the_far_end_closes() -> None:
    async def main() -> None:
        near, far = pipe()
        line = PipeTransport("meter", near)
        far.write(b"par")
        far.close()
        with pytest.raises(ConnectError, match="closed") as caught:
            await line.read_until(b"\r\n", 64)
        assert caught.value.exchange.received == b"par"
        with pytest.raises(ConnectError):
            await line.write(b"MES\r\n")
        await line.aclose()

    run_virtual(main())


def test_an_error_of_the_line_is_told_with_the_question() -> None:
    async def main() -> None:
        near, far = pipe()
        line, clock = PipeTransport("meter", near), VirtualClock(0)
        far.write(b"par")
        with pytest.raises(DeviceTimeout, match="broke off") as late:
            async with answer_within(2.0, line, clock, b"MES\r\n", "look at it"):
                await line.read_until(b"\r\n", 64)
        assert (late.value.exchange.sent, late.value.exchange.received) == (b"MES\r\n", b"par")
        assert (late.value.exchange.elapsed_s, late.value.hint) == (2.0, "look at it")
        far.close()
        with pytest.raises(ConnectError) as gone:
            async with answer_within(2.0, line, clock, b"DSR\r\n"):
                await line.read_until(b"\r\n", 64)
        assert (gone.value.exchange.sent, gone.value.exchange.received) == (b"DSR\r\n", b"par")

    run_virtual(main())


def test_a_span_has_its_middle_on_both_clocks() -> None:
    async def main() -> None:
        clock = VirtualClock(1_000_000_000)
        await clock.sleep(3.0)
        when = span(clock, 1_000_000_000, 2_000_000_000)
        assert (when.mono_ns, when.utc_ns, when.duration_s) == (1_500_000_000, 2_500_000_000, 1.0)

    run_virtual(main())


# TCP


def test_tcp_there_and_back_and_again() -> None:
    async def main() -> None:
        async def upper(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while data := await reader.read(65_536):
                writer.write(data.upper())
            writer.close()
            await writer.wait_closed()
            served.release()

        served = asyncio.Semaphore(0)
        server = await asyncio.start_server(upper, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        line = TcpTransport("drive", "127.0.0.1", port)
        assert str(line.place) == f"drive on 127.0.0.1:{port}"
        for _ in range(2):
            await open_within(30, line, CLOCK)
            await line.open()  # an open line stays as it is
            await line.write(b"hello")
            assert await soon(line, 5) == b"HELLO"
            big = b"a" * 3_000_000  # more than the socket's buffers: writing has to wait
            writing = asyncio.create_task(line.write(big))
            assert await soon(line, len(big)) == big.upper()
            await writing
            await line.aclose()
            await served.acquire()
        with pytest.raises(ConnectError, match="not open"):
            await line.write(b"x")
        server.close()
        await server.wait_closed()

    asyncio.run(main())


def test_nobody_listens() -> None:
    async def main() -> None:
        with socket.socket() as bound:
            bound.bind(("127.0.0.1", 0))  # bound, never listening: connecting is refused
            line = TcpTransport("drive", "127.0.0.1", bound.getsockname()[1])
            with pytest.raises(ConnectError, match="cannot connect") as caught:
                await open_within(30, line, CLOCK)
        assert "station file" in caught.value.hint

    asyncio.run(main())


def test_a_dropped_connection_can_be_opened_again() -> None:
    async def main() -> None:
        async def rude(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(b"hi")
            await writer.drain()
            writer.close()
            await writer.wait_closed()
            served.release()

        served = asyncio.Semaphore(0)
        server = await asyncio.start_server(rude, "127.0.0.1", 0)
        line = TcpTransport("drive", "127.0.0.1", server.sockets[0].getsockname()[1])
        for _ in range(2):
            await line.open()
            assert await soon(line, 2) == b"hi"
            with pytest.raises(ConnectError, match="closed"):
                await soon(line, 1)
            await served.acquire()
        server.close()
        await server.wait_closed()

    asyncio.run(main())


# Serial


def test_settings_in_words_and_time() -> None:
    assert str(ls110.LINE) == "4800 7E2"
    assert str(cl200.LINE) == "9600 7E1"
    assert cl200.LINE.character_s == 10 / 9600
    assert SerialSettings(9600).character_s == 10 / 9600  # 8N1


class _Asked(Exception):
    """Raised by the stand-in for pyserial, to look at what it was asked for."""


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (ls110.LINE, (4800, serial.SEVENBITS, serial.PARITY_EVEN, serial.STOPBITS_TWO)),
        (cl200.LINE, (9600, serial.SEVENBITS, serial.PARITY_EVEN, serial.STOPBITS_ONE)),
    ],
)
def test_what_a_real_port_is_asked_for(
    monkeypatch: pytest.MonkeyPatch, settings: SerialSettings, expected: tuple[Any, ...]
) -> None:
    """No pseudo-terminal can show a parity mistake: what pyserial is asked for is looked at instead."""
    asked: dict[str, Any] = {}

    def record(**arguments: Any) -> None:
        asked.update(arguments)
        raise _Asked

    monkeypatch.setattr(serial_port.serial, "Serial", record)
    with pytest.raises(_Asked):
        asyncio.run(SerialTransport("meter", "/dev/ttyUSB7", settings).open())
    assert (asked["baudrate"], asked["bytesize"], asked["parity"], asked["stopbits"]) == expected
    assert (asked["port"], asked["exclusive"], asked["timeout"]) == ("/dev/ttyUSB7", True, 0)
    assert not asked.get("rtscts") and not asked.get("xonxoff")


def test_a_pseudo_terminal_gets_what_it_can(terminal: tuple[int, str], tmp_path: Path) -> None:
    _, port = terminal
    link = tmp_path / "ttyLS110"
    link.symlink_to(port)
    assert is_pseudo_terminal(port) and is_pseudo_terminal(str(link))
    assert possible_settings(str(link), ls110.LINE) == SerialSettings(4800, 8, "N", 2)
    assert possible_settings("/dev/ttyUSB0", ls110.LINE) == ls110.LINE


def test_serial_there_and_back_and_reopened(terminal: tuple[int, str]) -> None:
    """Re-opening a pseudo-terminal with 7E settings fails with EINVAL every time; ours must not."""
    master, port = terminal

    async def main() -> None:
        line = SerialTransport("meter", port, ls110.LINE)
        assert line.settings == ls110.LINE
        for _ in range(5):
            await open_within(30, line, CLOCK)
            await line.open()
            await line.write(b"MES\r\n")
            assert os.read(master, 16) == b"MES\r\n"
            os.write(master, b"OK00,CcPH 125.3\r\n")
            async with CLOCK.timeout(30):
                assert await line.read_until(b"\r\n", 64) == b"OK00,CcPH 125.3\r\n"
            await line.aclose()

    asyncio.run(main())


def test_speed_stop_bits_and_parity_check_arrive(terminal: tuple[int, str]) -> None:
    _, port = terminal

    async def main() -> None:
        line = SerialTransport("meter", port, ls110.LINE)
        await line.open()
        probe = os.open(port, os.O_RDWR | os.O_NOCTTY)
        iflag, _, cflag, lflag, ispeed, _, _ = termios.tcgetattr(probe)
        os.close(probe)
        await line.aclose()
        assert ispeed == termios.B4800
        assert cflag & termios.CSTOPB
        assert iflag & termios.INPCK and not iflag & (termios.IGNPAR | termios.PARMRK)
        assert not lflag & (termios.ECHO | termios.ICANON)

    asyncio.run(main())


def test_an_idle_port_is_not_taken_for_a_closed_one(terminal: tuple[int, str]) -> None:
    _, port = terminal

    async def main() -> None:
        line = SerialTransport("meter", port, ls110.LINE)
        await line.open()
        with pytest.raises(BlockingIOError):
            line._read_now()
        await line.aclose()

    asyncio.run(main())


def test_a_port_has_one_owner(terminal: tuple[int, str]) -> None:
    _, port = terminal

    async def main() -> None:
        first = SerialTransport("meter", port, ls110.LINE)
        second = SerialTransport("other", port, ls110.LINE)
        await first.open()
        with pytest.raises(ConnectError, match=r"other on .*: another program holds the port") as caught:
            await second.open()
        assert "fuser" in caught.value.hint
        await first.aclose()
        await second.open()
        await second.aclose()

    asyncio.run(main())


def test_no_such_port() -> None:
    with pytest.raises(ConnectError, match="meter on /dev/ttyNOWHERE: there is no such port") as caught:
        asyncio.run(SerialTransport("meter", "/dev/ttyNOWHERE", ls110.LINE).open())
    assert "/dev/serial/by-id" in caught.value.hint


def test_something_that_is_no_serial_port(tmp_path: Path) -> None:
    plain = tmp_path / "file"
    plain.write_text("")
    with pytest.raises(ConnectError, match="4800 7E2") as caught:
        asyncio.run(SerialTransport("meter", str(plain), ls110.LINE).open())
    assert "serial port" in caught.value.hint


def test_einval_of_the_kernel_is_an_error_with_a_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """``termios.error`` is no ``OSError``; a port that cannot do 7E2 must still be reported as such."""

    def refuse(**_: Any) -> None:
        raise termios.error(22, "Invalid argument")

    monkeypatch.setattr(serial_port.serial, "Serial", refuse)
    with pytest.raises(ConnectError, match="/dev/ttyUSB7: cannot be opened with 4800 7E2"):
        asyncio.run(SerialTransport("meter", "/dev/ttyUSB7", ls110.LINE).open())


def test_draining_a_port(terminal: tuple[int, str]) -> None:
    master, port = terminal

    async def main() -> None:
        line = SerialTransport("meter", port, ls110.LINE)
        await line.open()
        assert await line.drain_input() == b""
        os.write(master, b"stale\r\n")
        got = b""
        for _ in range(1000):
            got += await line.drain_input()
            if len(got) == 7:
                break
            await asyncio.sleep(0.01)
        assert got == b"stale\r\n"
        await line.aclose()

    asyncio.run(main())


def test_a_full_line_makes_writing_wait(terminal: tuple[int, str]) -> None:
    master, port = terminal

    async def main() -> None:
        line = SerialTransport("meter", port, SerialSettings(115_200))
        await line.open()
        big = bytes(range(256)) * 400  # far more than a terminal's buffer
        writing = asyncio.create_task(line.write(big))
        got = b""
        while len(got) < len(big):
            await asyncio.sleep(0)
            got += await asyncio.to_thread(os.read, master, 65_536)
        await writing
        assert got == big
        await line.aclose()

    asyncio.run(main())


def test_the_cable_is_pulled() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    port = os.ttyname(slave)

    async def main() -> None:
        line = SerialTransport("meter", port, ls110.LINE)
        await line.open()
        waiting = asyncio.create_task(line.read_until(b"\r\n", 64))
        await asyncio.sleep(0.05)
        os.write(master, b"OK0")
        await asyncio.sleep(0.05)
        os.close(master)
        with pytest.raises(ConnectError, match="cable") as caught:
            async with CLOCK.timeout(30):
                await waiting
        assert caught.value.exchange.received in {b"OK0", b""}  # the kernel may throw the rest away
        with pytest.raises(ConnectError):
            await line.write(b"MES\r\n")
        await line.aclose()

    asyncio.run(main())
    os.close(slave)
