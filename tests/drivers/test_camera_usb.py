"""PTP over USB through pyusb, on a backend with a bench model behind it; in real time, whatever its speed."""

import asyncio
import errno
from collections.abc import Coroutine
from dataclasses import replace
from typing import Any, TypeVar

import pytest
import usb.core
from camera_bench import ADDED, COMPLETE, Model, UsbFront

from drivers.camera import Camera, CameraOptions, UsbOptions, UsbPtp
from drivers.camera.containers import UNKNOWN_LENGTH
from labdaq.clock import SystemClock
from labdaq.errors import ConnectError, DeviceTimeout, ProtocolError
from labdaq.reading import Instrument

T = TypeVar("T")
QUICK = CameraOptions(capture_s=5.0, grace_s=0.02, quiet_s=0.3)
CLOCK = SystemClock()


def run(main: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(main)


def camera(front: UsbFront, options: UsbOptions | None = None, settings: CameraOptions = QUICK) -> Camera:
    return Camera("sky-camera", UsbPtp("sky-camera", options, backend=front), CLOCK, settings)


async def one_picture(front: UsbFront) -> tuple[Instrument, bytes]:
    driver = camera(front)
    await driver.connect()
    who = driver.identity()
    (photo,) = await driver.expose(1 / 60)
    await driver.aclose()
    return who, photo.data


def body(model: Model) -> bytes:
    return next(iter(model.objects.values()))[1]


def test_one_exposure() -> None:
    model = Model()
    front = UsbFront(model)
    who, data = run(one_picture(front))
    assert who.model == "Nikon Corporation E5700"
    assert who.port == "usb:*:*"
    assert data == body(model)
    assert model.shutters == [167]
    assert front.claimed == []  # given back
    assert not front.driver_active  # a kernel driver was asked to leave
    assert model.session == 0


def test_endpoints_are_found_by_their_type() -> None:
    model = Model()
    assert run(one_picture(UsbFront(model, ends=(0x85, 0x07, 0x82))))[1] == body(model)


@pytest.mark.parametrize("packet", [64, 512])
def test_every_length_of_a_picture(packet: int) -> None:
    """A transfer of whole packets is followed by an empty one, which may be taken as the beginning of the next."""

    async def main() -> None:
        model = Model()
        front = UsbFront(model, packet=packet)
        driver = camera(front)
        await driver.connect()
        link = driver._session._link
        for size in (1, packet - 12, packet - 11, 4 * packet - 12, 4 * packet - 13):
            model.garbles[0x1009] = bytes(i % 251 for i in range(size))
            async with CLOCK.timeout(30):
                reply = await link.transact(0x1009, 1000 + size, (1,))
            assert reply.data == model.garbles[0x1009]
        await driver.aclose()

    run(main())


def test_what_we_send_in_whole_packets_ends_with_an_empty_one() -> None:
    async def main() -> None:
        model = Model(refuses={0x1016: 0x2005})
        front = UsbFront(model)
        link = UsbPtp("sky-camera", backend=front)
        await link.open()
        async with CLOCK.timeout(30):
            assert (await link.transact(0x1016, 1, (0x500D,), bytes(64 - 12))).code == 0x2005
        await link.aclose()
        assert [len(piece) for piece in front.written] == [16, 64, 0]

    run(main())


def test_header_and_data_in_separate_transfers_and_stale_empty_packets() -> None:
    def shape(transfers: list[bytes]) -> list[bytes]:
        pieces = [b""]
        for transfer in transfers:
            pieces += [transfer[:12], transfer[12:]] if len(transfer) > 12 else [transfer]
        return pieces

    model = Model()
    front = UsbFront(model)
    front.shape = shape
    assert run(one_picture(front))[1] == body(model)


def test_data_and_response_in_one_transfer() -> None:
    model = Model()
    front = UsbFront(model)
    front.shape = lambda transfers: [b"".join(transfers)]
    assert run(one_picture(front))[1] == body(model)


@pytest.mark.parametrize("lost", [0, 1, 12, 13])
def test_pictures_whose_length_the_camera_does_not_know(lost: int) -> None:
    """It announces 0xFFFFFFFF and ends with a short packet; ``lost`` makes some pictures whole packets long."""

    def shape(transfers: list[bytes]) -> list[bytes]:
        return [
            UNKNOWN_LENGTH.to_bytes(4, "little") + transfer[4:] if transfer[4:8] == b"\x02\x00\x09\x10" else transfer
            for transfer in transfers
        ]

    async def main() -> None:
        model = Model()
        front = UsbFront(model)
        front.shape = shape
        link = UsbPtp("sky-camera", backend=front)
        await link.open()
        model.garbles[0x1009] = bytes(range(64)) * 4 + bytes(64 - lost)
        async with CLOCK.timeout(30):
            reply = await link.transact(0x1009, 1, (1,))
        assert reply.data == model.garbles[0x1009]
        await link.aclose()

    run(main())


def test_stalled_endpoints_are_cleared_once() -> None:
    model = Model()
    front = UsbFront(model)
    front.stalls = [0x02, 0x81]
    assert run(one_picture(front))[1] == body(model)
    assert front.cleared == [0x02, 0x81]
    front = UsbFront(Model())
    front.stalls = [0x02, 0x02]
    with pytest.raises(ProtocolError, match="stays stalled"):
        run(one_picture(front))


def test_answers_to_a_transaction_that_was_given_up_are_passed_over() -> None:
    async def main() -> None:
        model = Model()
        front = UsbFront(model)
        driver = camera(front, settings=CameraOptions(timeout_s=0.5))
        await driver.connect()
        front.shape = lambda transfers: []
        with pytest.raises(DeviceTimeout, match=r"no answer within 0\.5 s") as caught:
            await driver.storages()
        assert caught.value.exchange.sent[6:8] == b"\x04\x10"
        front.shape = lambda transfers: [*stale, *transfers]
        stale = [b"\x14\0\0\0\x02\0\x04\x10\x03\0\0\0" + bytes(8), b"\x0c\0\0\0\x03\0\x01\x20\x03\0\0\0"]
        assert [card.free_images for card in (await driver.storages()).values()] == [123]
        await driver.aclose()

    run(main())


def test_a_wait_cut_short_keeps_what_its_last_call_brings() -> None:
    """The blocking call goes on in its thread when the waiting is given up; what it reads must not be lost."""

    async def main() -> None:
        front = UsbFront(Model())
        link = UsbPtp("sky-camera", backend=front)
        await link.open()
        front.slow_reads = 0.2
        front.interrupts.append(b"\x10\0\0\0\x04\0\x02\x40\x07\0\0\0\x65\0\0\0")
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.05):
                await link.next_event()
        assert front.interrupts == []  # the call had begun, and took it
        async with asyncio.timeout(30):
            event = await link.next_event()
        assert (event.code, event.transaction, event.parameters) == (ADDED, 7, (0x65,))
        await link.aclose()

    run(main())


def test_noise_instead_of_containers() -> None:
    async def main() -> None:
        front = UsbFront(Model())
        driver = camera(front)
        front.shape = lambda transfers: [b"\xaa" * 30]
        with pytest.raises(ProtocolError, match="this is no PTP: no container begins with aa aa") as caught:
            await driver.connect()
        assert caught.value.exchange.received == b"\xaa" * 30
        assert caught.value.exchange.sent[6:8] == b"\x02\x10"
        await driver.aclose()

    run(main())


@pytest.mark.parametrize(
    ("call", "number", "says", "tries"),
    [
        ("read", errno.ENODEV, "the camera is gone", "cable"),
        ("write", errno.ENODEV, "the camera is gone", "cable"),
        ("read", errno.EIO, "the camera is gone", "cable"),
        ("claim", errno.EBUSY, "another program holds the camera", "gio mount"),
        ("open", errno.EACCES, "you may not use this USB device", "udev"),
    ],
)
def test_errors_of_usb(call: str, number: int, says: str, tries: str) -> None:
    async def main() -> None:
        front = UsbFront(Model())
        front.fails[call] = [usb.core.USBError("x", -1, number) for _ in range(3)]
        driver = camera(front)
        with pytest.raises(ConnectError, match=says) as caught:
            await driver.connect()
        assert tries in caught.value.hint
        assert str(caught.value.place) == "sky-camera on usb:*:*"
        await driver.aclose()

    run(main())


def test_unplugged_in_a_bracket_and_connected_again() -> None:
    async def main() -> None:
        model = Model()
        front = UsbFront(model)
        driver = camera(front, settings=replace(QUICK, capture_s=0.5))
        await driver.connect()
        await driver.expose(1 / 60)
        front.fails["interrupt"] = [usb.core.USBError("gone", -4, errno.ENODEV)]
        with pytest.raises(ConnectError, match="gone"):
            await driver.expose(1 / 30)
        front.transfers.clear()
        front.interrupts.clear()
        await driver.connect()
        assert len(await driver.expose(1 / 15)) == 1
        await driver.aclose()

    run(main())


def test_a_camera_that_takes_nothing() -> None:
    async def main() -> None:
        front = UsbFront(Model())
        front.fails["write"] = [usb.core.USBTimeoutError("slow", -7, errno.ETIMEDOUT)]
        driver = camera(front)
        with pytest.raises(ConnectError, match="does not answer"):
            await driver.connect()
        await driver.aclose()

    run(main())


def test_which_camera() -> None:
    async def main() -> None:
        front = UsbFront(Model(name="E5000"), Model(name="E5700"))
        with pytest.raises(ConnectError, match=r"2 cameras are there \(04b0:010d, 04b0:010e\)") as caught:
            await camera(front).connect()
        assert "station file" in caught.value.hint
        for options in (UsbOptions(0x04B0, 0x010E), UsbOptions(serial="SN1")):
            driver = camera(front, options)
            await driver.connect()
            assert driver.identity().model == "Nikon Corporation E5700"
            await driver.aclose()
        with pytest.raises(ConnectError, match="no such camera") as caught:
            await camera(front, UsbOptions(0x04B0, 0x0119)).connect()
        assert caught.value.place.port == "usb:04b0:0119"
        with pytest.raises(ConnectError, match="no such camera"):
            await camera(UsbFront()).connect()

    run(main())


def test_a_device_without_all_endpoints() -> None:
    front = UsbFront(Model(), ends=(0x81, 0x02, 0x03))  # an interrupt endpoint that leads out
    with pytest.raises(ConnectError, match="lacks an endpoint"):
        run(camera(front).connect())
    assert front.claimed == []


def test_an_unconfigured_device_is_configured() -> None:
    front = UsbFront(Model())
    front.configured = False
    run(one_picture(front))
    assert front.configured


def test_events_come_through_the_interrupt_endpoint() -> None:
    model = Model(endings=("NEF", "JPG"), says=((0, ADDED, "h0"), (0, COMPLETE, ""), (0, ADDED, "h1")))

    async def main() -> None:
        driver = camera(UsbFront(model))
        await driver.connect()
        assert len(await driver.expose(1.0)) == 2
        await driver.aclose()

    run(main())
