"""The camera's driver over PTP/IP on memory lines, against a bench model with faults; in virtual time."""

import asyncio
import struct

import pytest
from camera_bench import ADDED, COMPLETE, SHUTTER, STANDARD, START, IpFront, Model, coolpix_5400, on_ip

from drivers.camera import Camera, CameraOptions
from drivers.camera.datasets import PropertyDescription
from labdaq.errors import ConfigError, ConnectError, DeviceTimeout, ProtocolError, RefusedError
from labdaq.virtual_time import run_virtual

RELEASE = 0x100E


def asked(model: Model, code: int) -> list[tuple[int, ...]]:
    return [parameters for operation, parameters, _ in model.asked if operation == code]


# Connecting


def test_connecting_finds_out_who_and_what() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            who = camera.identity()
            assert (who.model, who.firmware, who.port) == ("Nikon Corporation E5700", "E5700v1.1", "host:15740")
            assert camera.exposures_s[0] == 8.0 and camera.exposures_s[-1] == 1 / 4000
            assert len(camera.exposures_s) == 16
            assert await camera.battery_percent() == 80
            assert [card.free_images for card in (await camera.storages()).values()] == [
                123
            ]  # the empty slot is left out
            assert camera.abilities.announces_completion
        assert model.session == 0  # closed again
        assert model.settings[0x500E].current == 1  # program M, without which there is no shutter control
        assert model.settings[0x500C].current == 2  # no flash
        assert model.asked[0][:2] == (0x1002, (1,))

    run_virtual(main())


def test_transactions_count_from_zero() -> None:
    async def main() -> None:
        model = Model()
        numbers = []
        front = IpFront(model)
        front.bend = lambda code, raw: numbers.append(struct.unpack_from("<I", raw[-4:])[0])  # type: ignore[func-returns-value]
        async with on_ip(model, front=front) as (camera, _, _):
            await camera.connect()
        assert numbers == list(range(len(numbers)))

    run_virtual(main())


def test_settings_of_the_station_file_are_set_and_read_back() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model, CameraOptions(f_number=5.6, iso=100)) as (camera, _, _):
            await camera.connect()
            assert (camera.abilities.f_number, camera.abilities.iso) == (5.6, 100)
        assert (model.settings[0x5007].current, model.settings[0x500F].current) == (560, 100)

    run_virtual(main())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (CameraOptions(f_number=3.5), "F_NUMBER cannot be set to 350"),
        (CameraOptions(iso=125), "EXPOSURE_INDEX cannot be set to 125"),
        (CameraOptions(manual=False, f_number=5.6), "F_NUMBER cannot be set to 560: .* lets it be read only"),
    ],
)
def test_settings_that_it_does_not_have(options: CameraOptions, says: str) -> None:
    async def main() -> None:
        async with on_ip(Model(), options) as (camera, _, _):
            with pytest.raises(RefusedError, match=says) as caught:
                await camera.connect()
            assert caught.value.hint

    run_virtual(main())


def test_a_session_left_open_is_closed_first() -> None:
    async def main() -> None:
        model = Model(session=1)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            assert [code for code, _, _ in model.asked[:3]] == [0x1002, 0x1003, 0x1002]

    run_virtual(main())


def test_a_camera_that_takes_no_pictures() -> None:
    async def main() -> None:
        async with on_ip(Model(operations=tuple(set(STANDARD) - {RELEASE}))) as (camera, _, _):
            with pytest.raises(RefusedError, match="takes no pictures") as caught:
                await camera.connect()
            assert "USB mode to PTP" in caught.value.hint

    run_virtual(main())


def test_before_connecting() -> None:
    async def main() -> None:
        async with on_ip(Model()) as (camera, _, _):
            with pytest.raises(ConnectError, match="not connected"):
                await camera.expose()
            assert camera.identity().model == ""

    run_virtual(main())


# Exposures


def test_one_exposure() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model, CameraOptions(serial="4007219", calibration="lens-2010")) as (camera, _, _):
            await camera.connect()
            (photo,) = await camera.expose(1 / 4000)
        assert photo.exposure_s == 1 / 4000  # though the camera calls it 0.0002 s
        assert model.shutters == [2]
        assert (photo.name, photo.suffix, photo.format) == ("DSCN0001.JPG", ".jpg", 0x3801)
        assert photo.data == next(iter(model.objects.values()))[1]
        assert photo.captured == "20100722T131200"
        assert (photo.f_number, photo.iso) == (4.0, None)
        assert photo.instrument.serial == "4007219" and photo.instrument.calibration == "lens-2010"
        assert photo.ended_mono_ns - photo.began_mono_ns == pytest.approx(0.401e9, abs=1e6)
        assert photo.began_utc_ns == START + photo.began_mono_ns
        assert photo.clock.source == "virtual"
        assert asked(model, RELEASE) == [(0, 0)]  # both parameters, though zeros could be left off

    run_virtual(main())


def test_a_bracket_of_all_sixteen_steps() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            photos = await camera.bracket()
        assert model.shutters == list(SHUTTER)
        dial = (8, 4, 2, 1, 1 / 2, 1 / 4, 1 / 8, 1 / 15, 1 / 30, 1 / 60, 1 / 125, 1 / 250, 1 / 500, 1 / 1000, 1 / 2000)
        assert [photo.exposure_s for photo in photos] == [*dial, 1 / 4000]
        assert len({photo.data for photo in photos}) == 16

    run_virtual(main())


def test_a_bracket_with_a_time_that_does_not_exist_takes_no_picture() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            with pytest.raises(ConfigError, match=r"no exposure time of 0\.3 s"):
                await camera.bracket([1.0, 0.3])
        assert model.released == 0

    run_virtual(main())


def test_a_camera_without_shutter_control_says_so() -> None:
    """The Coolpix 5400: no property 500D, a vendor property that it lists and does not describe, no CaptureComplete."""

    async def main() -> None:
        says = ((0.4, ADDED, "h0"),)
        model = Model(settings=coolpix_5400(), listed=(0xD001, 0xD100), name="E5400", says=says)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            assert camera.exposures_s == ()
            with pytest.raises(RefusedError, match="E5400 has no shutter control over PTP") as caught:
                await camera.bracket()
            assert "500D" in caught.value.what and "own exposure" in caught.value.hint
            (photo,) = await camera.expose()
            assert (photo.exposure_s, photo.name) == (None, "DSCN0001.JPG")
        assert model.released == 1

    run_virtual(main())


def test_a_mode_dial_that_forbids_it() -> None:
    async def main() -> None:
        model = Model()
        del model.settings[0x500E]
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            with pytest.raises(RefusedError, match="read-only") as caught:
                await camera.expose(1.0)
            assert "mode dial to M" in caught.value.hint

    run_virtual(main())


def test_nikons_exact_ratio_is_preferred() -> None:
    async def main() -> None:
        model = Model()
        ratios = (1 << 16 | 4000, 1 << 16 | 30, 10 << 16 | 13, 0xFFFFFFFF)
        model.settings[0xD100] = PropertyDescription(0xD100, 6, True, ratios[0], ratios[0], ratios)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            assert camera.exposures_s == (10 / 13, 1 / 30, 1 / 4000)
            await camera.expose(1 / 30)
        assert model.settings[0xD100].current == ratios[1]
        assert model.settings[0x500D].current == 80

    run_virtual(main())


def test_a_shutter_that_becomes_another_is_refused() -> None:
    async def main() -> None:
        model = Model(rounds_to=40)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            with pytest.raises(RefusedError, match="setting 0x500D became 40 when it was given 333"):
                await camera.expose(1 / 30)
        assert model.released == 0

    run_virtual(main())


# Every file that came of it, in any order

PAIR = ("NEF", "JPG")


@pytest.mark.parametrize(
    "says",
    [
        ((0.4, ADDED, "h0"), (0.2, ADDED, "h1"), (0.1, COMPLETE, "")),
        ((0.4, ADDED, "h0"), (0.2, COMPLETE, ""), (0.3, ADDED, "h1")),
        ((0.4, COMPLETE, ""), (0.3, ADDED, "h0"), (0.3, ADDED, "h1")),
        ((0.4, ADDED, "h0"), (1.9, ADDED, "h1")),  # never complete
        ((0.4, ADDED, "h0"), (0.1, COMPLETE, "0"), (0.1, ADDED, "h1")),  # completion of no transaction
        ((0.4, ADDED, "h1"), (0.1, COMPLETE, "")),  # the raw file is never announced
        ((0.1, COMPLETE, ""),),  # neither is
        (
            (0.4, ADDED, "h0"),
            (0.1, 0x4006, "20493"),
            (0.1, ADDED, "h1"),
            (0.1, ADDED, "h1"),
        ),  # other words, and one twice
    ],
)
def test_raw_and_jpeg_however_announced(says: tuple[tuple[float, int, str], ...]) -> None:
    async def main() -> None:
        model = Model(endings=PAIR, says=says)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            for released in (1, 2):
                photos = await camera.expose(1 / 60)
                names = {f"DSCN{released:04d}.NEF", f"DSCN{released:04d}.JPG"}
                assert {photo.name for photo in photos} == names
                assert len(photos) == 2
                assert {photo.exposure_s for photo in photos} == {1 / 60}

    run_virtual(main())


def test_a_new_folder_is_no_picture() -> None:
    async def main() -> None:
        says = ((0.1, ADDED, "h0"), (0.3, ADDED, "h1"), (0.1, COMPLETE, ""))
        async with on_ip(Model(endings=("FOLDER", "JPG"), says=says)) as (camera, _, _):
            await camera.connect()
            assert [photo.name for photo in await camera.expose(1.0)] == ["DSCN0001.JPG"]

    run_virtual(main())


def test_late_words_of_an_earlier_capture_are_not_believed() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, _, (_, events)):
            await camera.connect()
            (first,) = await camera.expose(1 / 60)
            old = next(iter(model.objects))
            events.write(struct.pack("<IIHII", 18, 8, ADDED, 9, old) + struct.pack("<IIHII", 18, 8, COMPLETE, 9, 9))
            model.says = ((5.0, ADDED, "h0"), (0.1, COMPLETE, ""))
            (second,) = await camera.expose(4.0)
        assert (first.name, second.name) == ("DSCN0001.JPG", "DSCN0002.JPG")
        assert second.ended_mono_ns - second.began_mono_ns == pytest.approx(5.0e9, rel=0.01)

    run_virtual(main())


def test_a_long_exposure_is_waited_for() -> None:
    async def main() -> None:
        model = Model(says=((37.0, ADDED, "h0"), (0.1, COMPLETE, "")))
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            (photo,) = await camera.expose(8.0)
        assert photo.ended_mono_ns - photo.began_mono_ns == pytest.approx(37.0e9, rel=1e-3)

    run_virtual(main())


def test_pictures_are_deleted_when_asked() -> None:
    async def main() -> None:
        model = Model(endings=PAIR)
        async with on_ip(model, CameraOptions(delete_after=True)) as (camera, _, _):
            await camera.connect()
            photos = await camera.bracket([1.0, 0.5])
        assert len(photos) == 4 and model.objects == {}

    run_virtual(main())


# What goes wrong


def test_a_busy_camera_is_asked_again_and_released_once() -> None:
    async def main() -> None:
        model = Model(busy=7)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            assert len(await camera.expose(1 / 60)) == 1
            assert model.released == 1
            model.busy = 10_000
            with pytest.raises(RefusedError, match="busy") as caught:
                await camera.expose(1 / 60)
            assert "written its pictures" in caught.value.hint

    run_virtual(main())


def test_no_picture_comes() -> None:
    async def main() -> None:
        async with on_ip(Model(exposes=False, says=())) as (camera, _, _):
            await camera.connect()
            with pytest.raises(DeviceTimeout, match=r"no picture came within 31\.0 s") as caught:
                await camera.expose(1.0)
            assert "focus" in caught.value.hint

    run_virtual(main())


def test_a_full_card() -> None:
    async def main() -> None:
        model = Model(full=True)
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            with pytest.raises(RefusedError, match="card is full") as caught:
                await camera.expose(1.0)
            assert "delete" in caught.value.hint
            model.full, model.refuses = False, {RELEASE: 0x200C}
            with pytest.raises(RefusedError, match="store full"):
                await camera.expose(1.0)

    run_virtual(main())


def test_a_picture_cut_short() -> None:
    async def main() -> None:
        async with on_ip(Model(loses=100)) as (camera, _, _):
            await camera.connect()
            with pytest.raises(ProtocolError, match=r"picture DSCN0001\.JPG has \d+ bytes, \d+ came") as caught:
                await camera.expose(1.0)
            assert "still in the camera (object 0x65)" in caught.value.hint

    run_virtual(main())


@pytest.mark.parametrize(
    ("code", "says"), [(0x2013, "no card"), (0x2002, "general error"), (0xA002, "vendor's own"), (0x200F, "read-only")]
)
def test_refusals_name_operation_and_reason(code: int, says: str) -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            model.refuses[RELEASE] = code
            with pytest.raises(RefusedError, match=says) as caught:
                await camera.expose(1.0)
            assert f"INITIATE_CAPTURE(0x0, 0x0) was refused with 0x{code:04X}" in caught.value.what
            assert str(caught.value.place) == "sky-camera on host:15740"
            assert caught.value.exchange.sent[6:8] == b"\x0e\x10"
            assert caught.value.hint

    run_virtual(main())


@pytest.mark.parametrize("code", [0x1001, 0x1007, 0x1008])
def test_datasets_that_make_no_sense(code: int) -> None:
    async def main() -> None:
        model = Model(garbles={code: b"\xff\xff\xff\xff\x7f"})
        async with on_ip(model) as (camera, _, _):
            with pytest.raises(ProtocolError, match=r"cut short|does not fit|of 5 bytes") as caught:
                await camera.connect()
                await camera.expose(1.0)
            assert caught.value.exchange.received == b"\xff\xff\xff\xff\x7f"

    run_virtual(main())


def test_a_camera_that_falls_silent() -> None:
    async def main() -> None:
        model = Model()
        front = IpFront(model)
        async with on_ip(model, front=front) as (camera, _, _):
            await camera.connect()
            front.bend = lambda code, raw: [] if code == RELEASE else None
            with pytest.raises(DeviceTimeout, match="no answer within 10 s") as caught:
                await camera.expose(1.0)
            assert caught.value.exchange.sent[6:8] == b"\x0e\x10"
            assert "asleep" in caught.value.hint

    run_virtual(main())


def test_pictures_of_a_release_that_seemed_lost_are_not_taken_for_the_next_ones() -> None:
    """The camera exposed, only its word about it came too late: those files have another exposure time."""

    async def main() -> None:
        model = Model(endings=("NEF", "JPG"), says=((6.0, ADDED, "h0"), (1.0, ADDED, "h1"), (0.1, COMPLETE, "")))
        front = IpFront(model)
        async with on_ip(model, CameraOptions(timeout_s=1.0), front=front) as (camera, _, _):
            await camera.connect()
            front.bend = lambda code, raw: [(1.5, raw)] if code == RELEASE else None
            with pytest.raises(DeviceTimeout):
                await camera.expose(4.0)
            front.bend = lambda code, raw: None
            photos = await camera.expose(1 / 60)
            assert {photo.name for photo in photos} == {"DSCN0002.NEF", "DSCN0002.JPG"}
            assert {photo.exposure_s for photo in photos} == {1 / 60}
        assert model.shutters == [40_000, 167]

    run_virtual(main())


def test_the_late_end_of_a_transaction_is_passed_over() -> None:
    async def main() -> None:
        model = Model()
        front = IpFront(model)
        async with on_ip(model, CameraOptions(transfer_s=2.0), front=front) as (camera, _, _):
            await camera.connect()
            front.bend = lambda code, raw: [(0.1, raw[:5000]), (3.0, raw[5000:])] if code == 0x1009 else None
            with pytest.raises(DeviceTimeout, match="broke off"):
                await camera.expose(1.0)
            front.bend = lambda code, raw: None
            (photo,) = await camera.expose(0.5)
            assert photo.name == "DSCN0002.JPG"

    run_virtual(main())


def test_nobody_answers() -> None:
    async def main() -> None:
        front = IpFront(Model())
        front.bend = lambda code, raw: []
        async with on_ip(front.model, front=front) as (camera, _, _):
            with pytest.raises(ConnectError, match="does not answer") as caught:
                await camera.connect()
            assert caught.value.exchange.sent[6:8] == b"\x02\x10"

    run_virtual(main())


def test_a_camera_that_refuses_the_connection() -> None:
    async def main() -> None:
        front = IpFront(Model(), greeting=struct.pack("<III", 12, 5, 1))
        async with on_ip(front.model, front=front) as (camera, _, _):
            with pytest.raises(ConnectError, match=r"refuses the connection \(reason 1\)") as caught:
                await camera.connect()
            assert "pair it" in caught.value.hint

    run_virtual(main())


def test_something_else_listens_on_the_port() -> None:
    async def main() -> None:
        front = IpFront(Model(), greeting=b"HTTP/1.1 400 Bad Request\r\n\r\n")
        async with on_ip(front.model, front=front) as (camera, _, _):
            with pytest.raises(ProtocolError, match="this is no PTP/IP") as caught:
                await camera.connect()
            assert caught.value.exchange.received.startswith(b"HTTP")
            assert "15740" in caught.value.hint

    run_virtual(main())


def test_pings_are_answered() -> None:
    async def main() -> None:
        model = Model()
        async with on_ip(model) as (camera, front, (_, events)):
            await camera.connect()
            events.write(struct.pack("<II", 8, 13))
            await camera.expose(1.0)
        assert front.pongs == 1

    run_virtual(main())


def test_the_connection_breaks_in_a_bracket() -> None:
    async def main() -> None:
        model = Model()
        front = IpFront(model)
        async with on_ip(model, front=front) as (camera, _, (commands, _)):
            await camera.connect()

            def bend(code: int, raw: bytes) -> list[tuple[float, bytes]] | None:
                if code == 0x1009 and model.released == 3:
                    commands.write(raw[:100])
                    commands.close()
                    return []
                return None

            front.bend = bend
            with pytest.raises(ConnectError, match="closed the line") as caught:
                await camera.bracket()
            assert caught.value.exchange.sent[6:8] == b"\x09\x10"
            assert model.released == 3

    run_virtual(main())


def test_closing_a_camera_that_is_gone_is_quiet() -> None:
    async def main() -> None:
        async with on_ip(Model()) as (camera, _, (commands, events)):
            await camera.connect()
            commands.close()
            events.close()
            await camera.aclose()

    run_virtual(main())


def test_exposing_takes_the_time_it_takes() -> None:
    """With a camera that tells the end of a capture, an exposure costs its own time and the grace time."""

    async def main() -> tuple[float, Camera]:
        model = Model()
        async with on_ip(model) as (camera, _, _):
            await camera.connect()
            began = asyncio.get_running_loop().time()
            await camera.expose(1 / 60)
            return asyncio.get_running_loop().time() - began, camera

    took, camera = run_virtual(main())
    assert took == pytest.approx(0.5 + camera.options.grace_s, abs=0.05)  # the model's own 0.5 s; 0.05 s for the talk
