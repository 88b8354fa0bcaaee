"""The camera's protocol from its own side: datasets, sessions, PTP/IP packets, capture and events."""

import asyncio
import io
import struct
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace

import pytest
import rawpy
from emulator_helpers import UniformWorld, in_virtual_time
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from labdaq.clock import VirtualClock
from labdaq.pipe import PipeEnd
from simulators.camera import Camera, CameraOptions, PtpIpFront, datasets
from simulators.camera.profiles import PROFILES, STRING, UINT8, UINT16, UINT32, Property
from simulators.line import MemoryPort

OK = 0x2001


@dataclass
class Client:
    """PTP/IP by hand, from the reference."""

    port: MemoryPort
    command: PipeEnd = field(init=False)
    event: PipeEnd = field(init=False)
    transaction: int = -1

    async def connect(self) -> None:
        self.command = self.port.dial()
        name = "lab".encode("utf-16-le") + b"\0\0"
        self.command.write(bytes.fromhex("24000000 01000000") + bytes(range(16)) + name + bytes.fromhex("00000100"))
        kind, payload = await packet(self.command)
        assert kind == 2
        connection = payload[:4]
        assert payload[-4:] == bytes.fromhex("00000100")
        self.event = self.port.dial()
        self.event.write(bytes.fromhex("0c000000 03000000") + connection)
        assert await packet(self.event) == (4, b"")

    async def do(self, operation: int, *parameters: int, send: bytes | None = None) -> tuple[int, bytes, list[int]]:
        """Response code, data, response parameters."""
        self.transaction += 1
        number = struct.pack("<I", self.transaction)
        body = struct.pack("<IHI", 1 if send is None else 2, operation, self.transaction)
        body += struct.pack(f"<{len(parameters)}I", *parameters)
        self.command.write(struct.pack("<II", len(body) + 8, 6) + body)
        if send is not None:
            self.command.write(struct.pack("<II", 20, 9) + number + struct.pack("<Q", len(send)))
            self.command.write(struct.pack("<II", 12 + len(send), 12) + number + send)
        kind, payload = await packet(self.command)
        data = b""
        if kind == 9:
            (total,) = struct.unpack("<Q", payload[4:])
            while kind != 12:
                kind, payload = await packet(self.command)
                assert payload[:4] == number
                data += payload[4:]
            assert len(data) == total
            kind, payload = await packet(self.command)
        assert kind == 7
        code, tid = struct.unpack("<HI", payload[:6])
        assert tid == self.transaction
        return code, data, [p for (p,) in struct.iter_unpack("<I", payload[6:])]

    async def next_event(self) -> tuple[int, int]:
        kind, payload = await packet(self.event)
        assert kind == 8
        code, _, parameter = struct.unpack("<HII", payload)
        return code, parameter


async def packet(end: PipeEnd) -> tuple[int, bytes]:
    length, kind = struct.unpack("<II", await end.reader.readexactly(8))
    return kind, await end.reader.readexactly(length - 8)


Talk = Callable[[Client, VirtualClock, Camera], Awaitable[None]]


def talking(talk: Talk, options: CameraOptions | None = None, *, session: bool = True) -> None:
    async def main(clock: VirtualClock) -> None:
        camera = Camera(UniformWorld(beam=60_000.0), clock, options or CameraOptions(), seed=1)
        port = MemoryPort(PtpIpFront(camera, clock).serve)
        client = Client(port)
        try:
            await client.connect()
            if session:
                assert await client.do(0x1002, 1) == (OK, b"", [])
            await talk(client, clock, camera)
        finally:
            await port.aclose()

    in_virtual_time(main)


# --- datasets ---


def test_strings_and_arrays_of_the_reference() -> None:
    assert datasets.text("E5400") == bytes.fromhex("06 4500 3500 3400 3000 3000 0000")
    assert datasets.text("") == b"\0"
    assert datasets.codes([0x1001, 0x1002]) == bytes.fromhex("02000000 0110 0210")


def test_the_references_property_description() -> None:
    item = Property(0x500D, UINT32, 333, (10_000, 333, 5))
    data = bytes.fromhex("0d50 0600 01 4d010000 4d010000 02 0300 10270000 4d010000 05000000")
    assert datasets.property_description(item, 333) == data


@given(st.text(st.characters(min_codepoint=1, max_codepoint=0xD7FF), max_size=80))
def test_strings_round_trip(text: str) -> None:
    assert datasets.parse_value(STRING, datasets.text(text)) == text.rstrip("\0")


@given(st.sampled_from([UINT8, UINT16, UINT32, STRING, 3]), st.binary(max_size=12))
def test_bad_values_are_refused_not_raised(kind: int, data: bytes) -> None:
    try:
        value = datasets.parse_value(kind, data)
    except ValueError:
        return
    assert kind == STRING or datasets.value(kind, value) == data


# --- connections ---


def test_the_references_first_packets() -> None:
    async def main(clock: VirtualClock) -> None:
        camera = Camera(UniformWorld(), clock)
        port = MemoryPort(PtpIpFront(camera, clock).serve)
        end = port.dial()
        end.write(bytes.fromhex("24000000 01000000") + bytes(16) + bytes.fromhex("6c0061006200 0000 00000100"))
        kind, payload = await packet(end)
        assert (kind, payload[:4]) == (2, bytes.fromhex("01000000"))
        other = port.dial()
        other.write(bytes.fromhex("0c000000 03000000 01000000"))
        assert await other.reader.readexactly(8) == bytes.fromhex("08000000 04000000")
        end.write(bytes.fromhex("16000000 06000000 01000000 0210 00000000 01000000"))
        assert await end.reader.readexactly(14) == bytes.fromhex("0e000000 07000000 0120 00000000")
        end.write(bytes.fromhex("16000000 06000000 02000000 1610 06000000 0d500000"))
        end.write(bytes.fromhex("14000000 09000000 06000000 0400000000000000"))
        end.write(bytes.fromhex("10000000 0c000000 06000000 a7000000"))
        assert await end.reader.readexactly(14) == bytes.fromhex("0e000000 07000000 0120 06000000")
        assert camera.value(0x500D) == 167
        await port.aclose()

    in_virtual_time(main)


def test_probes_strangers_and_second_clients() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        client.port.dial().close()
        garbage = client.port.dial()
        garbage.write(b"GET / HTTP/1.0\r\n\r\n")
        assert await garbage.reader.read() == b""
        second = client.port.dial()
        second.write(bytes.fromhex("24000000 01000000") + bytes(16) + bytes.fromhex("6c0061006200 0000 00000100"))
        assert await packet(second) == (5, struct.pack("<I", 2))  # busy
        stranger = client.port.dial()
        stranger.write(bytes.fromhex("0c000000 03000000 63000000"))
        assert (await packet(stranger))[0] == 5
        client.command.write(struct.pack("<II", 8, 13))
        assert await packet(client.command) == (14, b"")
        client.event.write(struct.pack("<II", 8, 13))
        assert await packet(client.event) == (14, b"")
        assert (await client.do(0x1001))[0] == OK

    talking(talk)


def test_a_client_that_left_can_come_back() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        client.command.close()
        assert await client.event.reader.read() == b""  # both connections end together
        await clock.sleep(0.1)
        again = Client(client.port)
        await again.connect()
        assert (await again.do(0x1004))[0] == 0x2003  # the old session went with the connection
        assert (await again.do(0x1002, 5))[0] == OK

    talking(talk)


# --- sessions, objects, properties ---


def test_session_rules() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert (await client.do(0x1001))[0] == OK  # DeviceInfo needs no session
        assert (await client.do(0x1004))[0] == 0x2003
        assert (await client.do(0x1002, 0))[0] == 0x201D
        assert (await client.do(0x1002, 7))[0] == OK
        assert await client.do(0x1002, 8) == (0x201E, b"", [7])
        assert (await client.do(0x9999))[0] == 0x2005
        assert (await client.do(0x1003))[0] == OK
        assert (await client.do(0x1003))[0] == 0x2003

    talking(talk, session=False)


def test_storage_folders_and_objects() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert await client.do(0x1004) == (OK, struct.pack("<II", 1, 0x10001), [])
        info = (await client.do(0x1005, 0x10001))[1]
        assert struct.unpack("<HHHQQI", info[:26])[:4] == (4, 3, 0, 512 * 2**20)
        assert info[26:] == b"\0\0"
        assert (await client.do(0x1005, 0x20001))[0] == 0x2008
        assert (await client.do(0x1007, 0xFFFFFFFF, 0, 0xFFFFFFFF))[1] == struct.pack("<II", 1, 1)
        assert (await client.do(0x1007, 0x10001, 0, 1))[1] == struct.pack("<II", 1, 2)
        assert (await client.do(0x1007, 0x10001, 0, 99))[0] == 0x2009
        assert await client.do(0x1006, 0xFFFFFFFF) == (OK, b"", [2])
        assert (await client.do(0x100A, 1))[0] == 0x2010
        assert (await client.do(0x1009, 1))[0] == 0x2009
        assert (await client.do(0x1008, 77))[0] == 0x2009
        folder = (await client.do(0x1008, 2))[1]
        assert len(folder) > 52
        assert struct.unpack_from("<H", folder, 4) == (0x3001,)
        assert struct.unpack_from("<IH", folder, 38) == (1, 1)  # in DCIM, a folder
        assert datasets.text("100NIKON") in folder

    talking(talk)


def test_a_coolpix_5400_cannot_be_told_an_exposure() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        info = (await client.do(0x1001))[1]
        assert datasets.text("E5400v1.4") in info
        assert struct.pack("<H", 0x400D) not in info[: info.index(datasets.text("Nikon Corporation"))]
        for code in (0x500D, 0x5007, 0x500F, 0x500E, 0xD001):
            assert (await client.do(0x1014, code))[0] == 0x200A
            assert (await client.do(0x1016, code, send=b"\1\0\0\0"))[0] == 0x200A
        assert (await client.do(0x1016, 0x5001, send=b"\x32"))[0] == 0x200F  # the battery cannot be set
        assert (await client.do(0x1015, 0x5001)) == (OK, b"\x64", [])

    talking(talk, CameraOptions(profile="coolpix5400", picture="jpeg"))


def test_a_coolpix_5700_describes_properties_without_saying_that_it_can() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        info = (await client.do(0x1001))[1]
        (count,) = struct.unpack_from("<I", info, 8 + len(datasets.text("Nikon PTP Extensions")) + 2)
        listed = struct.unpack_from(f"<{count}H", info, 8 + len(datasets.text("Nikon PTP Extensions")) + 6)
        assert 0x1014 not in listed
        assert 0x1016 in listed
        code, data, _ = await client.do(0x1014, 0x500D)
        assert code == OK
        assert struct.unpack_from("<HHB", data) == (0x500D, 6, 1)
        (shutters,) = struct.unpack_from("<H", data, 14)
        assert struct.unpack_from(f"<{shutters}I", data, 16) == (
            80_000, 40_000, 20_000, 10_000, 5000, 2500, 1250, 662, 333, 167, 80, 40, 20, 10, 5, 2,
        )  # fmt: skip
        assert (await client.do(0x1016, 0x500D, send=struct.pack("<I", 666)))[0] == 0x201C
        assert (await client.do(0x1016, 0x500D, send=b"\1\2"))[0] == 0x201B
        assert (await client.do(0x1016, 0x500D, send=struct.pack("<I", 662)))[0] == OK
        assert (await client.do(0x1015, 0x500D))[1] == struct.pack("<I", 662)

    talking(talk)


def test_the_mode_dial_gates_exposure_properties() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        for program, shutter, aperture in ((1, 1, 1), (2, 0, 0), (3, 0, 1), (4, 1, 0)):
            assert (await client.do(0x1016, 0x500E, send=struct.pack("<H", program)))[0] == OK
            assert (await client.do(0x1014, 0x500D))[1][4] == shutter
            assert (await client.do(0x1014, 0x5007))[1][4] == aperture
            expected = OK if shutter else 0x200F
            assert (await client.do(0x1016, 0x500D, send=struct.pack("<I", 40)))[0] == expected

    talking(talk, CameraOptions(profile="generic"))


def test_nikons_exact_ratio_and_the_truncated_tenths_go_together() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert (await client.do(0x1016, 0xD100, send=struct.pack("<I", 1 << 16 | 4000)))[0] == OK
        assert (await client.do(0x1015, 0x500D))[1] == struct.pack("<I", 2)
        assert (await client.do(0x1016, 0x500D, send=struct.pack("<I", 125)))[0] == OK
        assert (await client.do(0x1015, 0xD100))[1] == struct.pack("<I", 1 << 16 | 80)

    talking(talk, CameraOptions(profile="generic"))


def test_the_cameras_own_clock() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert (await client.do(0x1015, 0x5011))[1] == datasets.text("20100722T131130")
        assert (await client.do(0x1016, 0x5011, send=datasets.text("20200101T000000")))[0] == OK
        await clock.sleep(61)
        assert (await client.do(0x1015, 0x5011))[1] == datasets.text("20200101T000101")
        assert (await client.do(0x1016, 0x5011, send=datasets.text("yesterday")))[0] == 0x201C

    talking(talk, CameraOptions(profile="generic", clock_offset_s=-30.0))


# --- capture ---


async def take(client: Client) -> int:
    """Capture and return the handle of the only picture."""
    assert (await client.do(0x100E, 0, 0))[0] == OK
    handle = 0
    while True:
        code, parameter = await client.next_event()
        if code == 0x4002:
            handle = parameter
        else:
            assert (code, parameter) == (0x400D, client.transaction)
            return handle


def test_capture_answers_at_once_and_exposes_afterwards() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        await client.do(0x1016, 0x500D, send=struct.pack("<I", 80_000))
        begun = clock.mono_ns()
        assert (await client.do(0x100E))[0] == OK  # trailing zeros may be left out
        assert clock.mono_ns() - begun < 0.1e9
        assert (await client.do(0x100E, 0, 0))[0] == 0x2019  # busy
        assert (await client.do(0x1016, 0x500D, send=struct.pack("<I", 2)))[0] == 0x2019
        assert (await client.do(0x1006, 0xFFFFFFFF))[2] == [2]
        assert (await client.next_event())[0] == 0x4002
        assert (clock.mono_ns() - begun) / 1e9 == pytest.approx(8.65, abs=0.05)
        assert (await client.next_event())[0] == 0x400D
        assert (await client.do(0x1006, 0xFFFFFFFF))[2] == [3]

    talking(talk)


def test_an_object_can_be_fetched_whole_in_parts_and_deleted() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        handle = await take(client)
        code, info, _ = await client.do(0x1008, handle)
        fields = struct.unpack("<IHHIHIIIIIIIHII", info[:52])
        assert (fields[0], fields[1], fields[8:10], fields[11]) == (0x10001, 0x3811, (640, 480), 2)
        assert datasets.text("DSCN0001.DNG") in info
        assert datasets.text("20100722T131200") in info
        code, data, _ = await client.do(0x1009, handle)
        assert (code, len(data)) == (OK, fields[3])
        assert data == camera.card.objects[handle].file.data  # type: ignore[union-attr]
        parts = b""
        while len(parts) < len(data):
            code, part, count = await client.do(0x101B, handle, len(parts), 100_000)
            assert count == [len(part)]
            parts += part
        assert parts == data
        assert len((await client.do(0x100A, handle))[1]) == fields[5]
        assert (await client.do(0x100B, 2))[0] == 0x200F
        assert (await client.do(0x100B, handle))[0] == OK
        assert (await client.do(0x1009, handle))[0] == 0x2009
        second = await take(client)
        assert second == handle + 1
        assert (await client.do(0x100B, 0xFFFFFFFF))[0] == OK
        assert (await client.do(0x1006, 0xFFFFFFFF))[2] == [2]

    talking(talk)


@pytest.mark.parametrize(
    ("order", "codes"),
    [
        ("added-first", [0x4002, 0x4002, 0x400D]),
        ("complete-first", [0x400D, 0x4002, 0x4002]),
        ("complete-between", [0x4002, 0x400D, 0x4002]),
    ],
)
def test_raw_and_jpeg_come_in_the_order_that_was_asked_for(order: str, codes: list[int]) -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert (await client.do(0x100E, 0, 0))[0] == OK
        events = [await client.next_event() for _ in codes]
        assert [code for code, _ in events] == codes
        await clock.sleep(1.0)
        assert not camera.busy
        names = [camera.card.objects[p].name for code, p in events if code == 0x4002]
        assert names == ["DSCN0001.JPG", "DSCN0001.DNG"]

    talking(talk, CameraOptions(profile="generic", picture="raw+jpeg", event_order=order))  # type: ignore[arg-type]


def test_over_the_network_even_a_5400_says_when_it_is_done() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        handle = await take(client)
        assert camera.card.objects[handle].name == "DSCN0001.JPG"
        assert b"Exif\0\0" in (await client.do(0x1009, handle))[1][:40]

    talking(talk, CameraOptions(profile="coolpix5400", picture="jpeg"))


def test_image_size_and_quality_decide_the_file() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        sizes = []
        for quality, suffix in ((6, "JPG"), (25, "JPG"), (100, "TIF"), (127, "DNG")):
            assert (await client.do(0x1016, 0x5004, send=bytes([quality])))[0] == OK
            item = camera.card.objects[await take(client)]
            assert item.name.endswith(suffix)
            assert item.file is not None
            sizes.append(len(item.file.data))
        assert sizes == [*sorted(sizes[:2]), *sizes[2:]]
        assert sizes[2] > 640 * 480 * 3
        assert sizes[3] > 640 * 480 * 2
        assert (await client.do(0x1016, 0x5003, send=datasets.text("1024x768")))[0] == OK
        item = camera.card.objects[await take(client)]
        assert item.file is not None
        assert (item.file.width, item.file.height) == (1024, 768)

    talking(talk)


def test_a_full_card_refuses() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        await take(client)
        assert (await client.do(0x100E, 0, 0))[0] == 0x200C
        assert (await client.do(0x100B, 0xFFFFFFFF))[0] == OK
        await take(client)

    talking(talk, CameraOptions(card_bytes=1_000_000))


def test_wrong_storage_and_format_are_refused() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        assert (await client.do(0x100E, 0x20001, 0))[0] == 0x2008
        assert (await client.do(0x100E, 0, 0x3808))[0] == 0x200B
        assert (await client.do(0x100E, 0x10001, 0x3801))[0] == OK

    talking(talk)


def test_program_mode_chooses_the_exposure_and_says_so() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        handle = await take(client)
        file = camera.card.objects[handle].file
        assert file is not None
        exif = Image.open(io.BytesIO(file.data)).getexif().get_ifd(0x8769)
        assert exif[0x8822] == 2
        # 3000 cd/m² to 18 % of saturation at f/4, ISO 100: 1/880 s
        assert float(exif[0x829A]) == pytest.approx(1 / 1000)

    talking(talk, CameraOptions(profile="coolpix5400", picture="jpeg"))


def test_true_shutter_times_may_lie_on_the_ladder() -> None:
    async def main(clock: VirtualClock) -> list[float]:
        means = []
        for exact in (True, False):
            camera = Camera(UniformWorld(sky=3000.0), clock, CameraOptions(exact_names=exact), seed=1)
            camera.set_value(0x500D, 5)
            camera.set_value(0x500D, 20)  # 1/500, truly 1/512
            camera.capture(1, tell_complete=True)
            await clock.sleep(2.0)
            camera.advance()
            data = camera.card.objects[0x65].file.data  # type: ignore[union-attr]
            with rawpy.imread(io.BytesIO(data)) as raw:
                assert raw.other.shutter_speed == pytest.approx(1 / 500)
                means.append(float(raw.raw_image[200:280, 280:360].mean()) - 64)
        return means

    exact, ladder = in_virtual_time(main)
    assert ladder / exact == pytest.approx(500 / 512, rel=2e-3)  # noise of 6400 pixels: 3e-4


# --- faults ---


def test_faults_of_the_camera() -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        camera.faults.refuse[0x100E] = [0x2019, 0x2002]
        assert [(await client.do(0x100E, 0, 0))[0] for _ in range(2)] == [0x2019, 0x2002]
        camera.faults.lose_events = 1
        assert (await client.do(0x100E, 0, 0))[0] == OK
        assert (await client.next_event())[0] == 0x400D  # and no word of the picture
        camera.faults.hang[0x1004] = 1
        with pytest.raises(TimeoutError):
            async with clock.timeout(10.0):
                await client.do(0x1004)
        assert (await client.do(0x1004))[0] == OK
        camera.faults.break_transfer_after = 1000
        with pytest.raises(asyncio.IncompleteReadError):
            await client.do(0x1009, 0x65)
        again = Client(client.port)
        await again.connect()
        await again.do(0x1002, 1)
        assert (await again.do(0x1009, 0x65))[0] == OK

    talking(talk)


@given(st.lists(st.tuples(st.integers(0, 20), st.binary(max_size=30)), max_size=6))
def test_no_packets_break_the_camera(noise: list[tuple[int, bytes]]) -> None:
    async def talk(client: Client, clock: VirtualClock, camera: Camera) -> None:
        stranger = client.port.dial()
        for kind, payload in noise:
            for end in (stranger, client.event):
                try:
                    end.write(struct.pack("<II", len(payload) + 8, kind) + payload)
                except ConnectionResetError:
                    break
        await clock.sleep(1.0)
        assert (await client.do(0x1001))[0] == OK

    talking(talk)


def test_options_refuse_what_the_profile_cannot() -> None:
    with pytest.raises(ValueError, match="no camera profile 'leica'"):
        CameraOptions(profile="leica")
    with pytest.raises(ValueError, match="cannot store raw"):
        CameraOptions(profile="coolpix5400")
    with pytest.raises(ValueError, match="image size 10x10"):
        CameraOptions(size="10x10")
    assert {p.name for p in PROFILES.values()} == {"coolpix5400", "coolpix5700", "generic"}
    assert replace(CameraOptions(), profile="generic").quality == 4
