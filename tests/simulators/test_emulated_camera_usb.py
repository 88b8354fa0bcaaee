"""The camera on a pyusb backend, talked to through the real pyusb."""

import errno
import struct
import threading
from array import array
from collections.abc import Iterator

import pytest
import usb.core
import usb.util
from emulator_helpers import UniformWorld
from hypothesis import given
from hypothesis import strategies as st

from labdaq.clock import ScaledClock
from simulators.camera import Camera, CameraOptions
from simulators.camera.usb_backend import EmulatedUsb
from simulators.camera.usb_pipes import Pipes, UsbFaults

RATE = 50.0  # the camera's seconds a real one


def plugged_in(profile: str = "coolpix5700", picture: str = "raw") -> EmulatedUsb:
    clock = ScaledClock(1_279_804_320_000_000_000, RATE)
    options = CameraOptions(profile=profile, picture=picture)  # type: ignore[arg-type]
    return EmulatedUsb(Camera(UniformWorld(beam=60_000.0), clock, options, seed=1))


class Host:
    """PTP over USB by hand, from the reference."""

    def __init__(self, backend: EmulatedUsb) -> None:
        device = usb.core.find(backend=backend, idVendor=0x04B0)
        assert device is not None
        self.device = device
        interface = device.get_active_configuration()[(0, 0)]
        assert (interface.bInterfaceClass, interface.bInterfaceSubClass, interface.bInterfaceProtocol) == (6, 1, 1)
        self.out, self.into, self.events = (
            usb.util.find_descriptor(
                interface,
                custom_match=lambda e, way=way, kind=kind: (
                    usb.util.endpoint_direction(e.bEndpointAddress) == way
                    and usb.util.endpoint_type(e.bmAttributes) == kind
                ),
            )
            for way, kind in ((0x00, 2), (0x80, 2), (0x80, 3))
        )
        usb.util.claim_interface(device, 0)
        self.transaction = 0

    def close(self) -> None:
        usb.util.dispose_resources(self.device)

    def send(self, kind: int, code: int, payload: bytes) -> None:
        data = struct.pack("<IHHI", 12 + len(payload), kind, code, self.transaction) + payload
        self.out.write(data, timeout=1000)
        if len(data) % self.out.wMaxPacketSize == 0:
            self.out.write(b"", timeout=1000)

    def receive(self) -> tuple[int, int, bytes]:
        """One container, taking reads until it is whole; an empty packet before or after it is passed over."""
        data = b""
        while len(data) < 12:
            data += bytes(self.into.read(16_384, timeout=2000))
        length, kind, code, tid = struct.unpack("<IHHI", data[:12])
        assert tid == self.transaction
        while len(data) < length:
            data += bytes(self.into.read(16_384, timeout=2000))
        assert len(data) == length
        return kind, code, data[12:]

    def do(self, operation: int, *parameters: int, send: bytes | None = None) -> tuple[int, bytes]:
        self.send(1, operation, struct.pack(f"<{len(parameters)}I", *parameters))
        if send is not None:
            self.send(2, operation, send)
        kind, code, payload = self.receive()
        data = b""
        if kind == 2:
            assert code == operation
            data = payload
            kind, code, payload = self.receive()
        assert kind == 3
        self.transaction += 1
        return code, data

    def event(self, timeout: int = 5000) -> tuple[int, int]:
        length, kind, code, _, parameter = struct.unpack("<IHHII", bytes(self.events.read(64, timeout=timeout)))
        assert (length, kind) == (16, 4)
        return code, parameter


@pytest.fixture
def backend() -> EmulatedUsb:
    return plugged_in()


@pytest.fixture
def host(backend: EmulatedUsb) -> Iterator[Host]:
    host = Host(backend)
    yield host
    host.close()


def test_it_is_found_as_lsusb_would_find_it() -> None:
    for profile, picture, product, packet in (
        ("coolpix5400", "jpeg", 0x0119, 64),
        ("coolpix5700", "raw", 0x010D, 64),
        ("generic", "raw", 0x0400, 512),
    ):
        backend = plugged_in(profile, picture)
        device = usb.core.find(backend=backend, idVendor=0x04B0, idProduct=product)
        assert device is not None
        assert usb.util.get_string(device, device.iManufacturer) == "Nikon Corporation"
        assert device.serial_number == "000003004711"
        assert device.get_active_configuration().bConfigurationValue == 1  # configured before programs see it
        assert not device.is_kernel_driver_active(0)
        sizes = {e.bEndpointAddress: e.wMaxPacketSize for e in device[0][(0, 0)]}
        assert sizes == {0x81: packet, 0x02: packet, 0x83: 32}
        device.set_configuration()
        assert "Image" in str(device[0])
        usb.util.dispose_resources(device)
        still = usb.core.find(backend=backend, custom_match=lambda d: any(i.bInterfaceClass == 6 for c in d for i in c))
        assert still is not None
        backend.faults.unplugged = True
        assert usb.core.find(backend=backend, idVendor=0x04B0) is None


def test_the_references_bytes(backend: EmulatedUsb) -> None:
    def say(*hexadecimal: str) -> bytes:
        for text in hexadecimal:
            data = array("B", bytes.fromhex(text))
            assert backend.bulk_write(None, 0x02, 0, data, 1000) == len(data)
        received = b""
        while True:
            buffer = array("B", bytes(4096))
            try:
                count = backend.bulk_read(None, 0x81, 0, buffer, 1)
            except usb.core.USBTimeoutError:
                return received
            received += bytes(buffer[:count])

    assert say("10000000 0100 0210 00000000 01000000") == bytes.fromhex("0c000000 0300 0120 00000000")
    described = say("10000000 0100 1410 02000000 0d500000")
    assert described[4:14] == bytes.fromhex("0200 1410 02000000 0d50")
    assert described[-12:] == bytes.fromhex("0c000000 0300 0120 02000000")
    ok = bytes.fromhex("0c000000 0300 0120 03000000")
    assert say("10000000 0100 1610 03000000 0d500000", "10000000 0200 1610 03000000 a7000000") == ok
    assert say("14000000 0100 0e10 04000000 00000000 00000000") == bytes.fromhex("0c000000 0300 0120 04000000")
    buffer = array("B", bytes(64))
    assert backend.intr_read(None, 0x83, 0, buffer, 5000) == 16
    assert bytes(buffer[:16]) == bytes.fromhex("10000000 0400 0240 04000000 65000000")
    assert backend.intr_read(None, 0x83, 0, buffer, 5000) == 16
    assert bytes(buffer[:16]) == bytes.fromhex("10000000 0400 0d40 04000000 04000000")


def test_a_bracket_over_usb(host: Host) -> None:
    assert host.do(0x1002, 1)[0] == 0x2001
    sizes = []
    for code in (80, 40):
        assert host.do(0x1016, 0x500D, send=struct.pack("<I", code))[0] == 0x2001
        assert host.do(0x100E, 0, 0)[0] == 0x2001
        added = host.event()
        assert added[0] == 0x4002
        assert host.event()[0] == 0x400D
        response, data = host.do(0x1009, added[1])
        assert response == 0x2001
        assert data[:4] == b"II*\0"
        sizes.append(len(data))
        assert host.do(0x100B, added[1])[0] == 0x2001
    assert sizes[0] == sizes[1] > 640 * 480 * 2
    assert host.do(0x1003)[0] == 0x2001


def test_a_5400_does_not_say_when_it_is_done() -> None:
    host = Host(plugged_in("coolpix5400", "jpeg"))
    host.do(0x1002, 1)
    assert host.do(0x100E, 0, 0)[0] == 0x2001
    assert host.event()[0] == 0x4002
    with pytest.raises(usb.core.USBTimeoutError):
        host.event(timeout=100)
    host.close()


@given(st.integers(0, 300), st.sampled_from([64, 512]))
def test_transfers_end_with_a_short_packet(size: int, packet: int) -> None:
    class Fixed(Pipes):
        def __init__(self) -> None:
            super().__init__(Camera(UniformWorld(), ScaledClock(0)), UsbFaults())
            self._packet = packet

        def queue(self, transfer: bytes) -> None:
            self._queue(transfer)

    pipes = Fixed()
    pipes.queue(bytes(size))
    pipes.queue(b"next")
    received = []
    while not received or len(received[-1]) == packet:
        received.append(pipes.give(packet))  # reading packet by packet shows each
    assert sum(map(len, received)) == size
    assert all(len(p) == packet for p in received[:-1])
    assert len(received[-1]) < packet  # of no bytes, if need be
    assert pipes.give(4096) == b"next"
    pipes.queue(bytes(size))
    assert len(pipes.give(2**20)) == size
    assert not pipes.has_data


def test_a_buffer_too_small_for_a_packet_overflows(host: Host) -> None:
    host.do(0x1002, 1)
    host.send(1, 0x1001, b"")
    with pytest.raises(usb.core.USBError) as caught:
        host.into.read(10, timeout=100)
    assert caught.value.errno == errno.EOVERFLOW


def test_a_read_with_nothing_to_read_times_out(host: Host) -> None:
    with pytest.raises(usb.core.USBTimeoutError):
        host.into.read(64, timeout=20)
    with pytest.raises(usb.core.USBTimeoutError):
        host.event(timeout=20)


def test_in_virtual_time_reads_do_not_block() -> None:
    backend = plugged_in()
    patient = EmulatedUsb(backend.camera, blocking=False)
    with pytest.raises(usb.core.USBTimeoutError):
        patient.intr_read(None, 0x83, 0, array("B", bytes(64)), 3_600_000)


def test_stalls_need_a_clear_halt(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    backend.faults.stall_out = 1
    with pytest.raises(usb.core.USBError) as caught:
        host.send(1, 0x1001, b"")
    assert caught.value.errno == errno.EPIPE
    with pytest.raises(usb.core.USBError):
        host.send(1, 0x1001, b"")
    host.device.clear_halt(host.out)
    assert host.do(0x1001)[0] == 0x2001
    host.send(1, 0x1001, b"")
    backend.faults.stall_in = 1
    with pytest.raises(usb.core.USBError):
        host.receive()
    host.device.clear_halt(host.into)
    assert host.receive()[0] == 2


def test_stale_empty_packets_and_split_headers(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    backend.faults.stale_empty_packet = True
    assert bytes(host_read(host, 0x1004)) == b""
    assert host.receive()[0] == 2
    assert host.receive()[0] == 3
    host.transaction += 1
    backend.faults.split_header = True
    assert len(host_read(host, 0x1004)) == 12
    assert bytes(host.into.read(512, timeout=100)) == struct.pack("<II", 1, 0x10001)


def host_read(host: Host, operation: int) -> array:  # type: ignore[type-arg]
    host.send(1, operation, b"")
    data: array = host.into.read(512, timeout=100)  # type: ignore[type-arg]
    return data


def test_a_transfer_that_breaks_off(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    host.do(0x100E, 0, 0)
    _, handle = host.event()
    backend.camera.faults.break_transfer_after = 1000
    host.send(1, 0x1009, struct.pack("<I", handle))
    with pytest.raises(usb.core.USBError) as caught:
        host.receive()
    assert caught.value.errno == errno.EPIPE
    host.device.clear_halt(host.into)
    host.transaction += 1
    assert host.do(0x1009, handle)[0] == 0x2001


def test_unplugging(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    backend.faults.unplugged = True
    for act in (lambda: host.do(0x1001), host.event, lambda: host.into.read(64, timeout=50)):
        with pytest.raises(usb.core.USBError) as caught:
            act()
        assert caught.value.errno == errno.ENODEV


def test_class_requests(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    assert bytes(host.device.ctrl_transfer(0xA1, 0x67, 0, 0, 20)) == struct.pack("<HH", 4, 0x2001)
    host.do(0x100E, 0, 0)
    assert bytes(host.device.ctrl_transfer(0xA1, 0x67, 0, 0, 20)) == struct.pack("<HH", 4, 0x2019)
    host.event()
    host.send(1, 0x1001, b"")
    host.device.ctrl_transfer(0x21, 0x64, 0, 0, struct.pack("<HI", 0x4001, host.transaction))
    with pytest.raises(usb.core.USBTimeoutError):
        host.into.read(64, timeout=20)  # what was on its way is gone
    host.device.ctrl_transfer(0x21, 0x66, 0, 0, b"")
    assert host.do(0x1004)[0] == 0x2003
    with pytest.raises(usb.core.USBError):
        host.device.ctrl_transfer(0xA1, 0x65, 0, 0, 20)
    host.device.reset()


def test_a_hanging_operation_and_a_lying_container(host: Host, backend: EmulatedUsb) -> None:
    host.do(0x1002, 1)
    backend.camera.faults.hang[0x1004] = 1
    with pytest.raises(usb.core.USBTimeoutError):
        host.send(1, 0x1004, b"")
        host.into.read(64, timeout=50)
    assert host.do(0x1004)[0] == 0x2001
    host.out.write(struct.pack("<IHHI", 4, 1, 0x1004, 9))
    with pytest.raises(usb.core.USBError):
        host.into.read(64, timeout=50)


def test_events_may_be_awaited_in_another_thread(host: Host) -> None:
    host.do(0x1002, 1)
    seen: list[tuple[int, int]] = []
    waiting = threading.Thread(target=lambda: seen.append(host.event()))
    waiting.start()
    assert host.do(0x100E, 0, 0)[0] == 0x2001
    for _ in range(5):
        assert host.do(0x1001)[0] == 0x2001
    waiting.join(30)
    assert seen == [(0x4002, 0x65)]
