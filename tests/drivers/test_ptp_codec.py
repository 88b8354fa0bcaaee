"""PTP datasets, USB containers and PTP/IP packets against recorded bytes, and against everything else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera import packets
from drivers.camera.codes import Operation, Property, reason
from drivers.camera.containers import Container, ContainerReader, Kind, command
from drivers.camera.datasets import (
    STRING,
    DeviceInfo,
    ObjectInfo,
    PropertyDescription,
    Reader,
    StorageInfo,
    Value,
    decode_handles,
    pack_numbers,
    pack_text,
    pack_value,
)
from drivers.camera.packets import Packet, PacketType
from drivers.exchange import FrameError

# USB containers


def hexes(text: str) -> bytes:
    return bytes.fromhex(text.replace("|", " "))


def test_containers_of_the_reference() -> None:
    assert command(Operation.OPEN_SESSION, 0, (1,)).encode() == hexes("10000000 0100 0210 00000000 01000000")
    assert command(Operation.GET_DEVICE_PROP_DESC, 2, (0x500D,)).encode() == hexes(
        "10000000 0100 1410 02000000 0d500000"
    )
    assert command(Operation.INITIATE_CAPTURE, 4, (0, 0)).encode() == hexes(
        "14000000 0100 0e10 04000000 00000000 00000000"
    )
    put = command(Operation.SET_DEVICE_PROP_VALUE, 3, (0x500D,)).encode()
    assert put == hexes("10000000 0100 1610 03000000 0d500000")
    data = Container(Kind.DATA, Operation.SET_DEVICE_PROP_VALUE, 3, pack_value(167, 6))
    assert data.encode() == hexes("10000000 0200 1610 03000000 a7000000")


def test_what_a_camera_sends() -> None:
    wire = hexes(
        "0c000000 0300 0120 00000000 | 10000000 0400 0240 04000000 65000000 | 10000000 0400 0d40 04000000 04000000"
    )
    ok, added, complete = ContainerReader().feed(wire, short=True)
    assert ok == Container(Kind.RESPONSE, 0x2001, 0)
    assert (added.kind, added.code, added.transaction, added.parameters) == (Kind.EVENT, 0x4002, 4, (0x65,))
    assert (complete.code, complete.parameters) == (0x400D, (4,))


def test_a_description_of_the_reference() -> None:
    wire = hexes("28000000 0200 1410 02000000 0d50 0600 01 4d010000 4d010000 02 0300 10270000 4d010000 05000000")
    (container,) = ContainerReader().feed(wire, short=True)
    expected = PropertyDescription(0x500D, 6, True, 333, 333, choices=(10_000, 333, 5))
    assert PropertyDescription.decode(container.payload) == expected
    assert expected.encode() == container.payload


def test_strings_of_the_reference() -> None:
    assert pack_text("E5400") == hexes("06 4500 3500 3400 3000 3000 0000")
    assert pack_text("") == b"\0"
    assert Reader(pack_text("E5400")).text() == "E5400"
    assert Reader(b"\0").text() == ""
    assert Reader(b"").text() == ""  # a camera left off the last string of a dataset
    with pytest.raises(FrameError, match="cut short"):
        Reader(pack_text("E5400")[:-1]).text()
    with pytest.raises(FrameError, match="too long"):
        pack_text("x" * 255)


containers = st.builds(
    Container,
    st.sampled_from(Kind),
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFF_FFFF),
    st.binary(max_size=200),
)


@given(st.lists(containers, max_size=6), st.data())
def test_containers_survive_any_cutting_of_transfers(sent: list[Container], data: st.DataObject) -> None:
    """Also with empty transfers (zero-length packets) anywhere between the pieces."""
    stream = b"".join(container.encode() for container in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    reader = ContainerReader()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += reader.feed(stream[start:end], short=data.draw(st.booleans()))
    assert found == sent
    assert reader.pending == b""


PACKET = 64


def unmeasured(payload: bytes) -> bytes:
    return b"\xff\xff\xff\xff" + Container(Kind.DATA, 0x1009, 7, payload).encode()[4:]


@pytest.mark.parametrize("size", [0, 10, PACKET - 12, PACKET - 12 + 1, 3 * PACKET - 12, 1000])
def test_data_of_unknown_length_end_with_a_short_packet(size: int) -> None:
    payload = bytes(i % 251 for i in range(size))
    wire, end = unmeasured(payload), Container(Kind.RESPONSE, 0x2001, 7)
    reader = ContainerReader()
    found = []
    for i in range(0, len(wire), PACKET):
        piece = wire[i : i + PACKET]
        found += reader.feed(piece, short=len(piece) < PACKET)
    if len(wire) % PACKET == 0:
        assert found == []  # nobody can tell yet
        found += reader.feed(b"", short=True)
    assert found == [Container(Kind.DATA, 0x1009, 7, payload)]
    assert reader.feed(end.encode(), short=True) == [end]


def test_data_of_unknown_length_whose_empty_packet_went_with_the_transfer() -> None:
    payload = bytes(2 * PACKET - 12)
    end = Container(Kind.RESPONSE, 0x2001, 7)
    reader = ContainerReader()
    assert reader.feed(unmeasured(payload), short=False) == []
    assert reader.feed(end.encode(), short=True) == [Container(Kind.DATA, 0x1009, 7, payload), end]


@pytest.mark.parametrize(
    "wire",
    [
        "0b000000 0300 0120 00000000",
        "00000000 0300 0120 00000000",
        "0c000000 0900 0120 00000000",
        "ffffffff 0300 0120 00000000",
    ],
)
def test_headers_that_make_no_sense(wire: str) -> None:
    reader = ContainerReader()
    with pytest.raises(FrameError, match="no container begins with"):
        reader.feed(hexes(wire), short=True)
    ok = Container(Kind.RESPONSE, 0x2001, 1)
    assert reader.feed(ok.encode(), short=True) == [ok]  # it starts afresh


# PTP/IP


def test_packets_of_the_reference() -> None:
    guid = bytes(range(16))
    assert packets.init_command(guid, "lab").encode() == (
        hexes("24000000 01000000") + guid + hexes("6c0061006200 0000 00000100")
    )
    assert packets.init_event(1).encode() == hexes("0c000000 03000000 01000000")
    opening = packets.command_request(Operation.OPEN_SESSION, 0, (1,), sends_data=False)
    assert opening.encode() == hexes("16000000 06000000 01000000 0210 00000000 01000000")
    putting = packets.command_request(Operation.SET_DEVICE_PROP_VALUE, 6, (0x500D,), sends_data=True)
    assert putting.encode() == hexes("16000000 06000000 02000000 1610 06000000 0d500000")
    start, end = packets.data_packets(6, pack_value(167, 6))
    assert start.encode() == hexes("14000000 09000000 06000000 0400000000000000")
    assert end.encode() == hexes("10000000 0c000000 06000000 a7000000")


def test_packets_from_a_camera() -> None:
    ack = packets.decode_packet(hexes("28000000 02000000 01000000") + bytes(16) + hexes("65006d007500 0000 00000100"))
    assert ack.type is PacketType.INIT_COMMAND_ACK and packets.connection_number(ack) == 1
    ok = packets.decode_packet(hexes("0e000000 07000000 0120 00000000"))
    assert packets.code_and_parameters(ok) == (0x2001, 0, ())
    added = packets.decode_packet(hexes("12000000 08000000 0240 05000000 65000000"))
    assert packets.code_and_parameters(added) == (0x4002, 5, (0x65,))
    refused = packets.decode_packet(hexes("0c000000 05000000 01000000"))
    assert refused.type is PacketType.INIT_FAIL


@given(st.sampled_from(PacketType), st.binary(max_size=100))
def test_packets_survive_the_wire(kind: PacketType, payload: bytes) -> None:
    raw = Packet(kind, payload).encode()
    assert packets.packet_length(raw[:8]) == len(raw)
    assert packets.decode_packet(raw) == Packet(kind, payload)


@given(st.integers(0, 0xFFFF_FFFF), st.binary(max_size=300), st.integers(1, 64))
def test_data_survive_being_cut(number: int, data: bytes, chunk: int) -> None:
    start, *rest = packets.data_packets(number, data, chunk)
    assert (start.type, start.payload[4:]) == (PacketType.START_DATA, len(data).to_bytes(8, "little"))
    assert [packet.type for packet in rest] == [PacketType.DATA] * (len(rest) - 1) + [PacketType.END_DATA]
    assert b"".join(packet.payload[4:] for packet in rest) == data
    assert {packets.transaction_of(packet) for packet in (start, *rest)} == {number}


@given(st.binary(max_size=60))
def test_noise_is_no_packet(noise: bytes) -> None:
    try:
        packet = packets.decode_packet(noise)
    except FrameError:
        return
    assert packet.encode() == noise


@pytest.mark.parametrize("read", [packets.connection_number, packets.transaction_of, packets.code_and_parameters])
def test_packets_cut_short(read: object) -> None:
    with pytest.raises(FrameError, match="of 3 bytes"):
        read(Packet(PacketType.COMMAND_RESPONSE, b"\1\2\3"))  # type: ignore[operator]
    with pytest.raises(FrameError, match="16 bytes"):
        packets.init_command(b"short", "lab")


# Datasets

texts = st.text(st.characters(codec="utf-16-le", exclude_characters="\0", max_codepoint=0xFFFF), max_size=60)
u16s = st.lists(st.integers(0, 0xFFFF), max_size=20).map(tuple)
u16, u32, u64 = (st.integers(0, (1 << bits) - 1) for bits in (16, 32, 64))


@given(st.builds(DeviceInfo, u16, u32, u16, texts, u16, u16s, u16s, u16s, u16s, u16s, texts, texts, texts, texts))
def test_device_info(value: DeviceInfo) -> None:
    assert DeviceInfo.decode(value.encode()) == value


@given(st.builds(StorageInfo, u16, u16, u16, u64, u64, u32, texts, texts))
def test_storage_info(value: StorageInfo) -> None:
    assert StorageInfo.decode(value.encode()) == value


objects = st.builds(
    ObjectInfo,
    *(u32, u16, u16, u32, u16, u32, u32, u32, u32, u32, u32, u32, u16, u32, u32),
    *(texts, texts, texts, texts),
)


@given(objects)
def test_object_info(value: ObjectInfo) -> None:
    raw = value.encode()
    assert ObjectInfo.decode(raw) == value
    assert raw[52:].startswith(pack_text(value.name))  # the fixed part has 52 bytes


@st.composite
def descriptions(draw: st.DrawFn) -> PropertyDescription:
    kind = draw(st.sampled_from([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0x4002, 0x4003, 0x4006, STRING]))
    bits = {1: 8, 2: 8, 3: 16, 4: 16, 5: 32, 6: 32, 7: 64, 8: 64, 9: 128, 10: 128}.get(kind & 0x3FFF, 8)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind & 1 else (0, (1 << bits) - 1)
    number = st.integers(low, high)
    value: st.SearchStrategy[Value] = number
    if kind == STRING:
        value = texts
    elif kind & 0x4000:
        value = st.lists(number, max_size=5).map(tuple)
    form = draw(st.sampled_from(["none", "range", "enum"]))
    return PropertyDescription(
        draw(u16),
        kind,
        draw(st.booleans()),
        draw(value),
        draw(value),
        tuple(draw(st.lists(value, min_size=1, max_size=6))) if form == "enum" else (),
        (draw(value), draw(value), draw(value)) if form == "range" else (),
    )


@given(descriptions())
def test_descriptions(value: PropertyDescription) -> None:
    assert PropertyDescription.decode(value.encode()) == value


@given(st.one_of(descriptions().map(lambda d: d.encode()), objects.map(lambda o: o.encode())), st.data())
def test_datasets_cut_short_never_crash(raw: bytes, data: st.DataObject) -> None:
    cut = raw[: data.draw(st.integers(0, len(raw)))]
    for decode in (
        PropertyDescription.decode,
        ObjectInfo.decode,
        DeviceInfo.decode,
        StorageInfo.decode,
        decode_handles,
    ):
        try:
            decode(cut)
        except FrameError:
            continue


@given(st.binary(max_size=120))
def test_noise_never_crashes(noise: bytes) -> None:
    for decode in (
        PropertyDescription.decode,
        ObjectInfo.decode,
        DeviceInfo.decode,
        StorageInfo.decode,
        decode_handles,
    ):
        try:
            decode(noise)
        except FrameError:
            continue


def test_an_array_longer_than_what_is_there() -> None:
    with pytest.raises(FrameError, match="does not fit"):
        decode_handles(b"\xff\xff\xff\x7f" + bytes(8))
    assert decode_handles(pack_numbers((1, 0xFFFF_FFFF), 4)) == (1, 0xFFFF_FFFF)


@pytest.mark.parametrize(("value", "kind"), [(256, 2), (-1, 4), ("x", 4), (1, STRING), ((1,), 4), (1, 0x4004), (1, 99)])
def test_values_that_do_not_fit_their_type(value: Value, kind: int) -> None:
    with pytest.raises(FrameError, match="cannot be sent"):
        pack_value(value, kind)


def test_a_type_that_does_not_exist() -> None:
    with pytest.raises(FrameError, match="type code 0x0063"):
        PropertyDescription.decode(hexes("0150 6300 00 00 00 00"))


def test_reasons() -> None:
    assert reason(0x200F) == ("0x200F (access denied): the setting is read-only now", "turn the mode dial to M")
    assert reason(0xA002)[0].startswith("0xA002 (vendor's own)")
    assert Property.EXPOSURE_TIME == 0x500D
