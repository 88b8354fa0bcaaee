"""A fault at every step of a whole measurement: the outcome is right, or an error that tells. Never a wrong value."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

import pytest
from bench import Answer, Bench, Module, bench, crc
from camera_bench import IpFront, Model, on_ip

from drivers.camera import CameraOptions
from drivers.cl200 import ChromaMeter, ChromaMeterOptions, Head
from drivers.cl200.codec import check_sum
from drivers.ls110 import LuminanceMeter
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.errors import DeviceError
from labdaq.pipe import PipeEnd, pipe
from labdaq.virtual_time import run_virtual

Fault = Callable[[bytes, bytes], Answer | None]
"""Makes of a question and its answer what really comes: pieces with delays [s], or ``None`` for a closed line."""

FAULTS: dict[str, Fault] = {
    "silence": lambda asked, answer: [],
    "truncated": lambda asked, answer: [(0.01, answer[: len(answer) // 2])],
    "first byte lost": lambda asked, answer: [(0.01, answer[1:])],
    "a bit flipped": lambda asked, answer: [(0.01, answer[:-3] + bytes([answer[-3] ^ 0x04]) + answer[-2:])],
    "noise": lambda asked, answer: [(0.01, b"\xff\x00\x55" * 3)],
    "noise before": lambda asked, answer: [(0.01, b"\xff\x00\x55" + answer)],
    "echo": lambda asked, answer: [(0.005, asked), (0.01, answer)],
    "twice": lambda asked, answer: [(0.01, answer), (0.001, answer)],
    "late": lambda asked, answer: [(1.7, answer)],
    "closed": lambda asked, answer: None,
    "closed in the middle": lambda asked, answer: None if not answer else [(0.01, answer[:3]), (-1.0, b"")],
}


@contextmanager
def a_telling_error() -> Iterator[None]:
    """Let a `DeviceError` pass if it says where, what and what to try."""
    try:
        yield
    except DeviceError as error:
        assert error.place.instrument == "device"
        assert error.hint, str(error)
        assert error.exchange.sent or "closed" in error.what or "given back" in error.what, str(error)
        assert str(error.place) in str(error) and error.what in str(error)


async def say(end: PipeEnd, pieces: Answer | None) -> None:
    for delay, piece in [(-1.0, b"")] if pieces is None else pieces:
        if delay < 0:
            end.close()
            return
        await asyncio.sleep(delay)
        end.write(piece)


async def serve_lines(
    end: PipeEnd, answer: Callable[[bytes], bytes], at: int, fault: Fault, asked: list[bytes]
) -> None:
    """Answer each line; the ``at``-th answer suffers ``fault``."""
    try:
        while True:
            line = await end.reader.readuntil(b"\r\n")
            asked.append(line)
            reply = answer(line)
            if len(asked) - 1 == at:
                await say(end, fault(line, reply))
            elif reply:
                await say(end, [(0.01, reply)])
    except (asyncio.IncompleteReadError, ConnectionResetError):
        return


def steps(count: int) -> list[tuple[int, str]]:
    return [(at, name) for at in range(count) for name in FAULTS]


async def on_lines(
    answer: Callable[[bytes], bytes],
    at: int,
    fault: Fault,
    use: Callable[[PipeTransport, list[bytes]], Awaitable[None]],
) -> int:
    """Run ``use`` on a line with a fault; return how many questions were asked."""
    near, far = pipe()
    asked: list[bytes] = []
    serving = asyncio.create_task(serve_lines(far, answer, at, fault, asked))
    with a_telling_error():
        await use(PipeTransport("device", near), asked)
    near.close()
    serving.cancel()
    await asyncio.gather(serving, return_exceptions=True)
    return len(asked)


# LS-110


def luminance_meter(line: bytes) -> bytes:
    return b"OK00,CcPH 125.3\r\n" if line == b"MES\r\n" else b"OK00\r\n"


async def read_luminance_twice(line: PipeTransport, asked: list[bytes]) -> None:
    driver = LuminanceMeter("device", line, VirtualClock(0))
    await driver.connect()
    for _ in range(2):
        with a_telling_error():
            assert (await driver.read()).value == 125.3


# A flipped bit in the number cannot be seen: this meter has no check sum.
@pytest.mark.parametrize(("at", "name"), [(at, name) for at, name in steps(5) if name != "a bit flipped" or at < 3])
def test_luminance_meter(at: int, name: str) -> None:
    run_virtual(on_lines(luminance_meter, at, FAULTS[name], read_luminance_twice))


# CL-200


def framed(body: str) -> bytes:
    inner = body.encode() + b"\x03"
    return b"\x02" + inner + check_sum(inner) + b"\r\n"


def chroma_meter(line: bytes) -> bytes:
    head, command = line[1:3].decode(), line[3:5].decode()
    if head == "99":
        return b""
    if command == "02":
        return framed(f"{head}021 20+{head}123+38560+40400")  # head 03 reads 31.2 lx, head 07 reads 71.2 lx
    return framed(f"{head}{command}    ")


async def measure_twice(line: PipeTransport, asked: list[bytes]) -> None:
    options = ChromaMeterOptions(heads=(Head(3, "three"), Head(7, "seven")))
    driver = ChromaMeter("device", line, VirtualClock(0), options)
    await driver.connect()
    for _ in range(2):
        with a_telling_error():
            triggers = sum(b"994021" in question for question in asked)
            readings = await driver.measure()
            assert (readings[0].value, readings[3].value) == (31.2, 71.2)
            assert sum(b"994021" in question for question in asked) == triggers + 1  # never triggered again blindly


@pytest.mark.parametrize(("at", "name"), steps(10))
def test_chroma_meter(at: int, name: str) -> None:
    run_virtual(on_lines(chroma_meter, at, FAULTS[name], measure_twice))


# Goniophotometer


async def scan(at: int, name: str) -> None:
    table = Bench(modules={2: Module(codes=list(range(100, 900, 100))), 3: Module(codes=list(range(900, 1700, 100)))})
    count = 0

    def bend(request: bytes, answer: bytes) -> Answer | None:
        nonlocal count
        count += 1
        if count - 1 != at:
            return None
        pieces = FAULTS[name](request, answer)
        return [] if pieces is None else [piece for piece in pieces if piece[0] >= 0]

    table.bend = bend
    async with bench(table) as gonio:
        with a_telling_error_of("gonio"):
            await gonio.connect()
            for k in (1, 2):
                with a_telling_error_of("gonio"):
                    assert await gonio.move_to(22.5 * k) == 22.5 * k
                with a_telling_error_of("gonio"):
                    codes = [int(reading.raw, 16) for reading in await gonio.read()]
                    assert codes == list(range(100, 1100, 100))
    assert table.drive.moves in ([625, 1250], [625], [1250], []), "a move was sent twice"


@contextmanager
def a_telling_error_of(instrument: str) -> Iterator[None]:
    try:
        yield
    except DeviceError as error:
        assert error.place.instrument == instrument and "unit" in error.place.port
        assert error.hint, str(error)


@pytest.mark.parametrize("name", [name for name in FAULTS if "closed" not in name])
def test_goniophotometer(name: str) -> None:
    for at in range(60):
        run_virtual(scan(at, name))


def test_goniophotometer_whose_drive_says_that_a_question_came_damaged() -> None:
    FAULTS["exception 08"] = lambda asked, answer: [
        (0.01, asked[:1] + bytes([asked[1] | 0x80, 8]) + crc(asked[:1] + bytes([asked[1] | 0x80, 8])))
    ]
    try:
        for at in range(60):
            run_virtual(scan(at, "exception 08"))
    finally:
        del FAULTS["exception 08"]


# Camera


async def expose_twice(at: int, name: str) -> None:
    model = Model(endings=("NEF", "JPG"))
    front = IpFront(model)
    count = 0
    async with on_ip(model, CameraOptions(timeout_s=1.0, transfer_s=1.0, capture_s=3.0), front) as (
        camera,
        _,
        (far, _),
    ):

        def bend(code: int, answer: bytes) -> Answer | None:
            nonlocal count
            count += 1
            if count - 1 != at:
                return None
            pieces = FAULTS[name](b"\x0c\0\0\0\x06\0\0\0" + bytes(4), answer)
            if pieces is None or any(delay < 0 for delay, _ in pieces):
                far.close()
                return []
            return pieces

        front.bend = bend
        with a_telling_error_of_a_camera():
            await camera.connect()
            for exposure_s in (1 / 60, 1 / 4000):
                with a_telling_error_of_a_camera():
                    photos = await camera.expose(exposure_s)
                    released = model.released
                    assert {photo.name for photo in photos} == {f"DSCN{released:04d}.NEF", f"DSCN{released:04d}.JPG"}
                    bodies = {info.name: body for info, body in model.objects.values()}
                    assert all(photo.data == bodies[photo.name] for photo in photos)
                    assert model.shutters[-1] == round(exposure_s * 1e4 - 0.01)
        assert model.released <= 2, "a release was sent twice"


@contextmanager
def a_telling_error_of_a_camera() -> Iterator[None]:
    try:
        yield
    except DeviceError as error:
        assert str(error.place) == "sky-camera on host:15740"
        assert error.hint, str(error)


@pytest.mark.parametrize("name", [name for name in FAULTS if name not in {"a bit flipped", "twice"}])
def test_camera(name: str) -> None:
    for at in range(45):
        run_virtual(expose_twice(at, name))
