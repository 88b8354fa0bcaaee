"""The Modbus line: late answers, damaged answers, writes that must not be repeated; in virtual time."""

import asyncio

import pytest
from bench import crc
from far_end import Step, far_end, now, on

from drivers.goniophotometer import Line, LineOptions
from drivers.goniophotometer.codec import Framing, Function
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.errors import ConfigError, ConnectError, DeviceTimeout, ProtocolError, RefusedError
from labdaq.pipe import PipeEnd
from labdaq.virtual_time import run_virtual


def frame(text: str) -> bytes:
    body = bytes.fromhex(text)
    return body + crc(body)


def read(address: int, unit: int = 1) -> bytes:
    return frame(f"{unit:02x} 03 {address:04x} 0001")


def value(word: int, unit: int = 1) -> bytes:
    return frame(f"{unit:02x} 03 02 {word:04x}")


WRITE = frame("01 06 6002 0040")


def line(end: PipeEnd, options: LineOptions | None = None) -> Line:
    return Line("gonio", PipeTransport("gonio", end, "/dev/ttyUSB3"), VirtualClock(0), options)


def tcp(transaction: int, text: str) -> bytes:
    body = bytes.fromhex(text)
    return transaction.to_bytes(2, "big") + b"\0\0" + len(body).to_bytes(2, "big") + body


def test_a_late_answer_is_never_taken_for_the_next_one() -> None:
    """The trap of RTU: the answer to register 100 comes while register 200 is asked for."""

    async def main() -> None:
        late = Step(read(100), [(1.5, value(0xBAD))])
        async with far_end(late, on(read(200), value(200))) as (end, player):
            master = line(end, LineOptions(read_retries=0))
            with pytest.raises(DeviceTimeout) as caught:
                await master.read_words(1, 100, 1)
            assert now() == pytest.approx(1.0)
            assert caught.value.exchange.sent == read(100)
            assert "gonio on /dev/ttyUSB3 unit 1" in str(caught.value)
            assert await master.read_words(1, 200, 1) == (200,)
        first, second = (when for when, _ in player.heard)
        assert second - first > 2.0  # quiet for longer than the slowest device needs

    run_virtual(main())


def test_a_late_answer_that_dribbles_in_at_the_last_moment() -> None:
    async def main() -> None:
        slow = value(0xBAD)
        late = Step(read(100), [(1.99, slow[:1]), *((0.03, slow[i : i + 1]) for i in range(1, 7))])
        async with far_end(late, on(read(200), value(200))) as (end, _):
            master = line(end, LineOptions(read_retries=0))
            with pytest.raises(DeviceTimeout):
                await master.read_words(1, 100, 1)
            assert await master.read_words(1, 200, 1) == (200,)

    run_virtual(main())


def test_an_answer_later_than_any_should_be_is_told_by_its_length() -> None:
    """Nothing in RTU protects from it but that questions of different purpose have answers of different length."""

    async def main() -> None:
        position = frame("01 03 1014 0002")
        late = Step(read(0x1003), [(4.0, value(0x32))])
        true = on(position, frame("01 03 04 ffff fd8f"))
        async with far_end(late, true, true) as (end, _):
            master = line(end, LineOptions(read_retries=0))
            with pytest.raises(DeviceTimeout):
                await master.read_words(1, 0x1003, 1)
            await asyncio.sleep(2.9)  # the late answer comes while the position is asked for
            with pytest.raises(ProtocolError, match="in a frame for 6"):
                await master.read_words(1, 0x1014, 2)
            assert await master.read_words(1, 0x1014, 2) == (0xFFFF, 0xFD8F)

    run_virtual(main())


def test_a_line_that_fell_out_of_step_finds_back() -> None:
    """The first answer comes when the question has been asked again: its second one must not become the next one."""

    async def main() -> None:
        steps = [
            Step(read(1), [(3.0, value(1))]),
            Step(read(1), [(1.0, value(1))]),
            on(read(2), value(2)),
            on(read(3), value(3)),
        ]
        async with far_end(*steps) as (end, _):
            master = line(end)
            assert [await master.read_words(1, n, 1) for n in (1, 2, 3)] == [(1,), (2,), (3,)]

    run_virtual(main())


def test_unasked_bytes_are_thrown_away_with_what_follows_them() -> None:
    async def main() -> None:
        async with far_end(on(read(1), value(1)), on(read(2), value(2))) as (end, player):
            master = line(end)
            await master.read_words(1, 1, 1)
            player.end.write(value(0xBAD)[:3])
            asyncio.get_running_loop().call_later(1.5, player.end.write, value(0xBAD)[3:] + value(0xBAD))
            assert await master.read_words(1, 2, 1) == (2,)

    run_virtual(main())


def test_a_question_given_up_leaves_the_line_quiet() -> None:
    async def main() -> None:
        late = Step(read(100), [(0.7, value(0xBAD))])
        async with far_end(late, on(read(200), value(200))) as (end, _):
            master = line(end)
            asking = asyncio.create_task(master.read_words(1, 100, 1))
            await asyncio.sleep(0.3)
            asking.cancel()
            assert await master.read_words(1, 200, 1) == (200,)

    run_virtual(main())


def test_a_read_is_asked_again_after_silence() -> None:
    async def main() -> None:
        async with far_end(Step(read(100)), on(read(100), value(7))) as (end, _):
            master = line(end)
            assert await master.read_words(1, 100, 1) == (7,)
            assert master.retries == 1

    run_virtual(main())


def test_a_write_is_sent_once_whatever_happens() -> None:
    faults: list[list[tuple[float, bytes]]] = [
        [],  # silence
        [(0.01, frame("01 86 08"))],  # the drive says that the write came damaged
        [(0.01, WRITE[:-1] + b"\0")],  # a damaged acknowledgement
        [(0.01, frame("01 06 6002 0041"))],  # an acknowledgement of something else
        [(0.01, WRITE[:5])],  # a truncated one
    ]
    for says in faults:

        async def main(says: list[tuple[float, bytes]]) -> None:
            async with far_end(Step(WRITE, says)) as (end, player):
                with pytest.raises((DeviceTimeout, ProtocolError, RefusedError)) as caught:
                    await line(end).write_word(1, 0x6002, 0x40)
                await asyncio.sleep(10.0)
                assert len(player.heard) == 1
            if not isinstance(caught.value, RefusedError):
                assert "nobody knows whether the device obeyed" in caught.value.hint
            assert caught.value.exchange.sent == WRITE

        run_virtual(main(says))


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (1, "function"),
        (2, "no such address"),
        (3, "does not accept this value"),
        (4, "failed"),
        (6, "busy"),
        (0x55, "outside the Modbus specification"),
    ],
)
def test_exceptions_say_what_they_mean(code: int, says: str) -> None:
    async def main() -> None:
        answer = frame(f"01 83 {code:02x}")
        async with far_end(on(read(0x1003), answer)) as (end, _):
            with pytest.raises(RefusedError, match=says) as caught:
                await line(end).read_words(1, 0x1003, 1)
        assert f"exception {code:02d} to function 03 at 0x1003" in caught.value.what
        assert (caught.value.exchange.sent, caught.value.exchange.received) == (read(0x1003), answer)
        assert caught.value.hint

    run_virtual(main())


def test_exception_08_means_read_again() -> None:
    async def main() -> None:
        damaged = bytes.fromhex("01 83 08 40 F6")
        async with far_end(on(read(100), damaged), on(read(100), value(5))) as (end, _):
            assert await line(end).read_words(1, 100, 1) == (5,)
        async with far_end(on(read(100), damaged), on(read(100), damaged)) as (end, _):
            with pytest.raises(RefusedError, match="damaged request") as caught:
                await line(end).read_words(1, 100, 1)
            assert "termination" in caught.value.hint

    run_virtual(main())


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (value(7)[:-1] + b"\0", "check sum"),
        (frame("02 03 02 0007"), "unit 2"),
        (frame("01 04 02 0007"), "function 4"),
        (read(100), "gives back what is sent"),
        (b"\xff\xff\xff\xff\xff\xff\xff", "unit 255"),
    ],
)
def test_a_void_answer_is_asked_for_again_then_reported(answer: bytes, says: str) -> None:
    async def main() -> None:
        async with far_end(on(read(100), answer), on(read(100), value(7))) as (end, _):
            assert await line(end).read_words(1, 100, 1) == (7,)
        async with far_end(on(read(100), answer), on(read(100), answer)) as (end, _):
            with pytest.raises(ProtocolError, match=says) as caught:
                await line(end).read_words(1, 100, 1)
        assert answer.startswith(caught.value.exchange.received) and caught.value.exchange.received
        assert str(caught.value.place) == "gonio on /dev/ttyUSB3 unit 1"

    run_virtual(main())


def test_an_echo_before_the_answer() -> None:
    async def main() -> None:
        for count, answer in ((1, frame("01 03 02 0007")), (2, frame("01 03 04 0007 0008"))):
            asked = frame(f"01 03 0064 {count:04x}")
            async with far_end(on(asked, asked + answer), on(asked, asked + answer)) as (end, _):
                with pytest.raises(ProtocolError, match="gives back what is sent"):
                    await line(end).read_words(1, 100, count)
            async with far_end(on(asked, asked, answer), on(WRITE, WRITE, WRITE)) as (end, _):
                master = line(end, LineOptions(echo=True))
                assert (await master.read_words(1, 100, count))[0] == 7
                await master.write_word(1, 0x6002, 0x40)

    run_virtual(main())


def test_a_truncated_answer_shows_what_came() -> None:
    async def main() -> None:
        async with far_end(on(read(100), value(7)[:4])) as (end, _):
            with pytest.raises(DeviceTimeout, match="broke off") as caught:
                await line(end, LineOptions(read_retries=0)).read_words(1, 100, 1)
            assert caught.value.exchange.received == value(7)[:4]
            assert caught.value.exchange.elapsed_s == pytest.approx(1.0)

    run_virtual(main())


def test_a_line_that_is_never_silent() -> None:
    async def main() -> None:
        async with far_end() as (end, player):
            master = line(end)

            async def babble() -> None:
                while True:
                    player.end.write(b"\x55")
                    await asyncio.sleep(1.0)

            babbling = asyncio.create_task(babble())
            await asyncio.sleep(0.01)
            with pytest.raises(ProtocolError, match="does not become silent") as caught:
                await master.read_words(1, 100, 1)
            babbling.cancel()
            assert "second master" in caught.value.hint

    run_virtual(main())


def test_frames_keep_their_distance() -> None:
    async def main() -> None:
        async with far_end(on(read(1), value(1)), on(read(2), value(2))) as (end, player):
            master = line(end)
            await master.read_words(1, 1, 1)
            answered = now()
            await master.read_words(1, 2, 1)
        assert player.heard[1][0] - answered >= 3.5 * 10 / 9600 - 1e-9  # 3.5 characters of 8N1 at 9600, to the ns

    run_virtual(main())


def test_two_askers_wait_for_each_other() -> None:
    async def main() -> None:
        async with far_end(on(read(1), value(1)), on(read(2, 2), value(2, 2))) as (end, _):
            master = line(end)
            answers = await asyncio.gather(master.read_words(1, 1, 1), master.read_words(2, 2, 1))
            assert answers == [(1,), (2,)]

    run_virtual(main())


def test_the_line_breaks() -> None:
    async def main() -> None:
        async with far_end(Step(read(100), hang_up=True)) as (end, _):
            with pytest.raises(ConnectError, match="closed") as caught:
                await line(end).read_words(1, 100, 1)
            assert caught.value.exchange.sent == read(100)
            assert "unit 1" in str(caught.value.place)

    run_virtual(main())


def test_bits() -> None:
    async def main() -> None:
        coils, inputs = frame("02 01 0110 0001"), frame("02 02 0080 000a")
        async with far_end(on(coils, frame("02 01 01 01")), on(inputs, frame("02 02 02 05 02"))) as (end, _):
            master = line(end)
            assert await master.read_bits(2, 0x110, 1) == (1,)
            assert await master.read_bits(2, 0x80, 10, Function.READ_INPUTS) == (1, 0, 1, 0, 0, 0, 0, 0, 0, 1)

    run_virtual(main())


# Modbus TCP

TCP = LineOptions(framing=Framing.TCP)


def test_tcp_passes_over_late_answers_by_their_number() -> None:
    async def main() -> None:
        steps = [
            Step(tcp(1, "01 03 0064 0001")),
            Step(tcp(2, "01 03 00c8 0001"), [(0.1, tcp(1, "01 03 02 0bad")), (0.1, tcp(2, "01 03 02 00c8"))]),
        ]
        async with far_end(*steps) as (end, player):
            master = line(end, LineOptions(framing=Framing.TCP, read_retries=0))
            with pytest.raises(DeviceTimeout):
                await master.read_words(1, 100, 1)
            assert await master.read_words(1, 200, 1) == (200,)
        assert player.heard[1][0] == pytest.approx(1.0, abs=0.01)  # no silence is due

    run_virtual(main())


def test_tcp_reads_retry_and_writes_do_not() -> None:
    async def main() -> None:
        read_again = [Step(tcp(1, "01 03 0064 0001")), on(tcp(2, "01 03 0064 0001"), tcp(2, "01 03 02 0007"))]
        async with far_end(*read_again, Step(tcp(3, "01 06 6002 0040"))) as (end, _):
            master = line(end, TCP)
            assert await master.read_words(1, 100, 1) == (7,)
            with pytest.raises(DeviceTimeout):
                await master.write_word(1, 0x6002, 0x40)

    run_virtual(main())


def test_tcp_exceptions_and_foreign_answers() -> None:
    async def main() -> None:
        steps = [
            on(tcp(1, "09 03 0064 0001"), tcp(1, "09 83 0b")),
            on(tcp(2, "01 03 0064 0001"), tcp(2, "02 03 02 0007")),
        ]
        async with far_end(*steps) as (end, _):
            master = line(end, LineOptions(framing=Framing.TCP, read_retries=0))
            with pytest.raises(RefusedError, match="behind the gateway"):
                await master.read_words(9, 100, 1)
            with pytest.raises(ProtocolError, match="unit 2"):
                await master.read_words(1, 100, 1)

    run_virtual(main())


def test_something_else_listens_on_the_port() -> None:
    async def main() -> None:
        async with far_end(on(tcp(1, "01 03 0064 0001"), b"HTTP/1.1 400 Bad Request\r\n\r\n")) as (end, _):
            with pytest.raises(ProtocolError, match="not a Modbus TCP frame") as caught:
                await line(end, LineOptions(framing=Framing.TCP, read_retries=0)).read_words(1, 100, 1)
            assert caught.value.exchange.received.startswith(b"HTTP")

    run_virtual(main())


def test_options_that_would_let_late_answers_in() -> None:
    with pytest.raises(ConfigError, match="worst_reply_s"):
        LineOptions(timeout_s=3.0, worst_reply_s=1.0)
