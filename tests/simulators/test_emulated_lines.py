"""The line itself: pace, faults, pseudo-terminals and ports."""

import asyncio
import os
import termios
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from emulator_helpers import in_virtual_time, on_memory
from hypothesis import given
from hypothesis import strategies as st

from labdaq.clock import SystemClock, VirtualClock
from labdaq.pipe import PipeEnd
from simulators.line import (
    Corrupt,
    Disconnect,
    Drop,
    Echo,
    FaultBox,
    Garbage,
    Late,
    Line,
    LineFault,
    MemoryPort,
    SerialFormat,
    Truncate,
    Wire,
    open_pty,
    open_tcp,
)

STYLE = SerialFormat(9600, 7, "E", 1)


async def parrot(line: Line) -> None:
    """Answer every chunk in square brackets."""
    while data := await line.receive():
        await line.send(b"[" + data + b"]")


def parrot_on(clock: VirtualClock, faults: FaultBox, pacing: bool = True) -> Callable[[Wire], Awaitable[None]]:
    async def serve(wire: Wire) -> None:
        await Line(wire, clock, STYLE, faults, pacing=pacing).converse(parrot)

    return serve


def exchange(fault: LineFault | None, request: bytes = b"hello", pacing: bool = True) -> tuple[bytes, float]:
    """What comes back in two seconds, and when the first byte of it came [s]."""

    async def main(clock: VirtualClock) -> tuple[bytes, float]:
        faults = FaultBox()
        if fault is not None:
            faults.arm(fault)

        async def talk(end: PipeEnd) -> tuple[bytes, float]:
            end.write(request)
            received, first_s = b"", -1.0
            try:
                async with clock.timeout(2.0):
                    while chunk := await end.reader.read(100):
                        first_s = clock.mono_ns() / 1e9 if not received else first_s
                        received += chunk
            except TimeoutError:
                pass
            return received, first_s

        return await on_memory(parrot_on(clock, faults, pacing), talk)

    return in_virtual_time(main)


def test_characters_take_their_time() -> None:
    assert SerialFormat(4800, 7, "E", 2).character_s == pytest.approx(11 / 4800)
    assert STYLE.character_s == pytest.approx(10 / 9600)
    data, first_s = exchange(None, b"x" * 40)
    assert data == b"[" + b"x" * 40 + b"]"
    # 40 characters in, the least delay, and at least one character out
    assert first_s >= 41 * 10 / 9600 + 0.002


def test_an_unpaced_line_still_never_answers_in_zero_time() -> None:
    _, first_s = exchange(None, pacing=False)
    assert 0.002 <= first_s < 0.003


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (Drop(), b""),
        (Truncate(3), b"[he"),
        (Truncate(-1), b"[hello"),
        (Corrupt(1, 0x01), b"[iello"[:2] + b"ello]"),
        (Garbage(b"\x00\x7f"), b"\x00\x7f[hello]"),
        (Echo(), b"hello[hello]"),
        (Disconnect(4), b"[hel"),
        (None, b"[hello]"),
    ],
)
def test_faults_do_what_they_say(fault: LineFault | None, expected: bytes) -> None:
    assert exchange(fault)[0] == expected


def test_a_late_reply_is_late_by_what_was_asked() -> None:
    assert exchange(Late(1.5))[1] == pytest.approx(exchange(None)[1] + 1.5, abs=1e-6)


def test_faults_skip_and_run_out() -> None:
    box = FaultBox()
    box.arm(Drop(), times=2, skip=1)
    assert [box.mangle(b"ab").data for _ in range(4)] == [b"ab", b"", b"", b"ab"]
    box.arm(Truncate(1), times=None)
    assert [box.mangle(b"ab").data for _ in range(3)] == [b"a"] * 3
    box.clear()
    assert box.mangle(b"ab").data == b"ab"


@given(st.binary(min_size=1, max_size=300))
def test_received_bytes_lose_their_parity_bit_and_nothing_else(data: bytes) -> None:
    async def main(clock: VirtualClock) -> bytes:
        async def talk(end: PipeEnd) -> bytes:
            end.write(data)
            return await end.reader.readexactly(len(data) + 2)

        return await on_memory(parrot_on(clock, FaultBox()), talk)

    assert in_virtual_time(main) == b"[" + bytes(b & 0x7F for b in data) + b"]"


def test_a_pty_is_raw_and_survives_closing_and_opening() -> None:
    async def main() -> list[bytes]:
        port = open_pty(parrot_on(SystemClock(), FaultBox()))
        replies = []
        try:
            for _ in range(3):
                client = os.open(port.endpoint, os.O_RDWR | os.O_NOCTTY)
                os.write(client, b"a\r\n\x03b")
                replies.append(await asyncio.to_thread(_read, client, 7))
                os.close(client)
        finally:
            await port.aclose()
        gone.append(port.endpoint)
        return replies

    gone: list[str] = []
    assert asyncio.run(main()) == [b"[a\r\n\x03b]"] * 3
    assert not Path(gone[0]).exists()


def _wait_for_odd_speed(client: int) -> None:
    for _ in range(10_000):
        if termios.tcgetattr(client)[5] == termios.B50:
            return
        time.sleep(0.002)
    raise AssertionError("nobody changed the speed")


def _read(descriptor: int, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += os.read(descriptor, count)
    return data


def test_the_keeper_makes_a_clients_speed_odd_again() -> None:
    async def main() -> None:
        port = open_pty(parrot_on(SystemClock(), FaultBox()))
        client = os.open(port.endpoint, os.O_RDWR | os.O_NOCTTY)
        try:
            settings = termios.tcgetattr(client)
            settings[4] = settings[5] = termios.B9600
            termios.tcsetattr(client, termios.TCSANOW, settings)
            await asyncio.to_thread(_wait_for_odd_speed, client)
        finally:
            os.close(client)
            await port.aclose()

    asyncio.run(main())


def test_a_tcp_port_serves_every_connection_and_bears_a_probe() -> None:
    async def main() -> None:
        port = await open_tcp(parrot_on(SystemClock(), FaultBox(), pacing=False))
        host, number = port.endpoint.split(":")
        try:
            for _ in range(2):
                _, probe = await asyncio.open_connection(host, int(number))
                probe.close()
                await probe.wait_closed()
            reader, writer = await asyncio.open_connection(host, int(number))
            writer.write(b"hi")
            assert await reader.readexactly(4) == b"[hi]"
            writer.close()
            await writer.wait_closed()
        finally:
            await port.aclose()
        with pytest.raises(OSError):
            await asyncio.open_connection(host, int(number))

    asyncio.run(main())


def test_a_port_tells_of_an_emulator_that_broke() -> None:
    async def broken(wire: Wire) -> None:
        await wire.read()
        raise RuntimeError("a bug")

    async def main(clock: VirtualClock) -> None:
        port = MemoryPort(broken)
        port.dial().write(b"x")
        await clock.sleep(0.1)
        await port.aclose()

    with pytest.raises(RuntimeError, match="a bug"):
        in_virtual_time(main)


def test_a_line_that_was_closed_can_be_dialled_again() -> None:
    async def main(clock: VirtualClock) -> bytes:
        port = MemoryPort(parrot_on(clock, FaultBox()))
        first = port.dial()
        first.write(b"lost")
        first.close()
        second = port.dial()
        second.write(b"kept")
        reply = await second.reader.readexactly(6)
        await port.aclose()
        return reply

    assert in_virtual_time(main) == b"[kept]"
