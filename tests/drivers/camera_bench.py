"""A bench model of a camera for driver tests: one responder behind PTP/IP on memory lines, or behind a pyusb backend.

It does what the dumps of real cameras in the references show, and misbehaves where a test asks for it.
"""

import array
import asyncio
import errno
import struct
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core

from drivers.camera import Camera, CameraOptions, PtpIp
from drivers.camera.datasets import DeviceInfo, ObjectInfo, PropertyDescription, StorageInfo, pack_numbers
from drivers.transport import PipeTransport
from labdaq.clock import VirtualClock
from labdaq.pipe import PipeEnd, pipe

START = 1_279_804_320_000_000_000
OK, ADDED, COMPLETE, STORE_FULL = 0x2001, 0x4002, 0x400D, 0x400A
STANDARD = (0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1007, 0x1008, 0x1009, 0x100B, 0x100E, 0x1016)
SHUTTER = (80000, 40000, 20000, 10000, 5000, 2500, 1250, 662, 333, 167, 80, 40, 20, 10, 5, 2)


def coolpix_5700() -> dict[int, PropertyDescription]:
    """Settings of a Coolpix 5700 v1.1 as dumped; it starts in program P."""
    return {
        0x5001: PropertyDescription(0x5001, 2, False, 100, 80, (2, 5, 25, 50, 65, 80, 100)),
        0x5007: PropertyDescription(0x5007, 4, False, 280, 400, (280, 400, 560, 800)),
        0x500C: PropertyDescription(0x500C, 4, True, 1, 1, (1, 2, 3, 4)),
        0x500D: PropertyDescription(0x500D, 6, False, 80, 80, SHUTTER),
        0x500E: PropertyDescription(0x500E, 4, True, 2, 2, (1, 2, 3, 4)),
        0x500F: PropertyDescription(0x500F, 4, True, 0xFFFF, 0xFFFF, (0xFFFF, 100, 200, 400, 800)),
    }


def coolpix_5400() -> dict[int, PropertyDescription]:
    """Settings of a Coolpix 5400 v1.4 as dumped: no exposure control at all."""
    return {
        0x5001: PropertyDescription(0x5001, 2, False, 100, 80, (2, 5, 25, 50, 65, 80, 100)),
        0x500C: PropertyDescription(0x500C, 4, True, 1, 1, (1, 2, 3, 4)),
    }


@dataclass
class Model:
    """A camera with settings and objects; after a release it says: delay [s], event code, "h0" for its first object."""

    settings: dict[int, PropertyDescription] = field(default_factory=coolpix_5700)
    listed: tuple[int, ...] = ()  # further properties it lists but does not describe
    name: str = "E5700"
    operations: tuple[int, ...] = STANDARD
    endings: tuple[str, ...] = ("JPG",)
    says: tuple[tuple[float, int, str], ...] = ((0.4, ADDED, "h0"), (0.1, COMPLETE, ""))
    rounds_to: int | None = None  # the shutter it takes, whatever it is given
    busy: int = 0  # so many answers of "busy" before each release
    loses: int = 0  # so many bytes lost at the end of each picture
    full: bool = False
    exposes: bool = True  # whether a release makes pictures
    session: int = 0
    objects: dict[int, tuple[ObjectInfo, bytes]] = field(default_factory=dict)
    asked: list[tuple[int, tuple[int, ...], bytes]] = field(default_factory=list)
    shutters: list[int] = field(default_factory=list)
    released: int = 0
    events: list[tuple[float, int, tuple[int, ...]]] = field(default_factory=list)
    unwritten: set[int] = field(default_factory=set)  # objects that are listed only once they are announced
    counter: int = 0x64
    refuses: dict[int, int] = field(default_factory=dict)  # operation to response code
    garbles: dict[int, bytes] = field(default_factory=dict)  # operation to data instead of the true ones

    def answer(self, code: int, transaction: int, parameters: tuple[int, ...], data: bytes) -> tuple[int, bytes]:
        """Response code and data of one operation."""
        self.asked.append((code, parameters, data))
        if code in self.refuses:
            return self.refuses[code], b""
        if code in self.garbles:
            return OK, self.garbles[code]
        if code != 0x1001 and code != 0x1002 and not self.session:
            return 0x2003, b""
        first = parameters[0] if parameters else 0
        if code == 0x1002:
            if self.session:
                return 0x201E, b""
            self.session = first
            return OK, b""
        if code == 0x1003:
            self.session = 0
            return OK, b""
        handlers: dict[int, Callable[[], tuple[int, bytes]]] = {
            0x1001: lambda: (OK, self.info().encode()),
            0x1004: lambda: (OK, pack_numbers((0x00010001, 0x00020000), 4)),
            0x1005: lambda: (OK, StorageInfo(4, 3, 0, 1 << 27, 1 << 26, 123, "", "").encode()),
            0x1007: lambda: (OK, pack_numbers(tuple(h for h in self.objects if h not in self.unwritten), 4)),
            0x1008: lambda: self.of_object(first, lambda info, _: info.encode()),
            0x1009: lambda: self.of_object(first, lambda _, body: body[: len(body) - self.loses]),
            0x100B: lambda: (OK if self.objects.pop(first, None) else 0x2009, b""),
            0x100E: lambda: self.release(transaction),
            0x1014: lambda: (OK, self.settings[first].encode()) if first in self.settings else (0x200A, b""),
            0x1016: lambda: self.put(first, data),
        }
        return handlers[code]()

    def info(self) -> DeviceInfo:
        properties = (*self.settings, *self.listed)
        return DeviceInfo(
            *(100, 0xA, 100, "Nikon PTP Extensions", 0),
            *(self.operations, (ADDED, COMPLETE), properties, (0x3801,), (0x3801, 0x3001)),
            *("Nikon Corporation", self.name, f"{self.name}v1.1", ""),
        )

    def of_object(self, handle: int, make: Callable[[ObjectInfo, bytes], bytes]) -> tuple[int, bytes]:
        return (OK, make(*self.objects[handle])) if handle in self.objects else (0x2009, b"")

    def put(self, code: int, data: bytes) -> tuple[int, bytes]:
        old = self.settings[code]
        if not old.writable:
            return 0x200F, b""
        value = int.from_bytes(data, "little")
        if old.choices and value not in old.choices:
            return 0x201C, b""
        if code == 0x500D and self.rounds_to is not None:
            value = self.rounds_to
        self.settings[code] = PropertyDescription(code, old.kind, True, old.default, value, old.choices)
        if code == 0x500E:  # the dial decides what may be set
            for dependent in (0x5007, 0x500D):
                if (p := self.settings.get(dependent)) is not None:
                    self.settings[dependent] = PropertyDescription(
                        p.code, p.kind, value == 1, p.default, p.current, p.choices
                    )
        return OK, b""

    def add(self, ending: str) -> int:
        self.counter += 1
        body = f"{self.name} {self.counter} {ending} ".encode() * 997  # some tens of kilobytes, each different
        kind = {"JPG": 0x3801, "NEF": 0x3000, "FOLDER": 0x3001}[ending]
        name = f"DSCN{self.released:04d}" + ("" if ending == "FOLDER" else f".{ending}")
        date = "20100722T131200"
        info = ObjectInfo(
            0x10001, kind, 0, len(body), 0x3808, 0, 0, 0, 2560, 1920, 24, 0, 0, 0, 0, name, date, date, ""
        )
        self.objects[self.counter] = (info, body)
        return self.counter

    def release(self, transaction: int) -> tuple[int, bytes]:
        if self.busy:
            self.busy -= 1
            return 0x2019, b""
        self.released += 1
        self.shutters.append(int(self.settings[0x500D].current) if 0x500D in self.settings else 0)  # type: ignore[arg-type]
        if self.full:
            self.events.append((0.2, STORE_FULL, (0x10001,)))
            return OK, b""
        made = [self.add(ending) for ending in self.endings] if self.exposes else []
        for delay, code, what in self.says:
            if what.startswith("h"):
                self.events.append((delay, code, (made[int(what[1:])],)))
                self.unwritten.add(made[int(what[1:])])
            else:
                self.events.append((delay, code, (int(what) if what else transaction,)))
        return OK, b""


# Behind PTP/IP


@dataclass
class IpFront:
    """Answers on two memory lines; ``bend`` may replace the packets of an answer."""

    model: Model
    bend: Callable[[int, bytes], list[tuple[float, bytes]] | None] = lambda code, raw: None
    greeting: bytes | None = None
    pongs: int = 0
    transaction: int = 0
    telling: set[asyncio.Task[None]] = field(default_factory=set)

    async def commands(self, near: PipeEnd, events: PipeEnd) -> None:
        reader = near.reader
        await self._packet(reader)
        ack = struct.pack("<III", 40, 2, 1) + bytes(16) + "emu\0".encode("utf-16-le") + struct.pack("<I", 0x10000)
        near.write(self.greeting or ack)
        while True:
            _, payload = await self._packet(reader)
            phase, code, transaction = struct.unpack_from("<IHI", payload)
            parameters = struct.unpack_from(f"<{(len(payload) - 10) // 4}I", payload, 10)
            data = b""
            if phase == 2:
                kind = 0
                while kind != 12:
                    kind, piece = await self._packet(reader)
                    data += piece[4:] if kind != 9 else b""
            self.transaction = transaction
            status, body = self.model.answer(code, transaction, parameters, data)
            raw = b""
            if body:
                raw = struct.pack("<IIIQ", 20, 9, transaction, len(body))
                for i in range(0, len(body), 4000):
                    piece = body[i : i + 4000]
                    raw += (
                        struct.pack("<III", 12 + len(piece), 12 if i + 4000 >= len(body) else 10, transaction) + piece
                    )
            raw += struct.pack("<IIHI", 14, 7, status, transaction)
            bent = self.bend(code, raw)
            for delay, piece in [(0.001, raw)] if bent is None else bent:
                await asyncio.sleep(delay)
                near.write(piece)
            queued, self.model.events = self.model.events, []
            telling = asyncio.create_task(self._tell(events, transaction, queued))
            self.telling.add(telling)
            telling.add_done_callback(self.telling.discard)

    async def _tell(self, end: PipeEnd, transaction: int, queued: list[tuple[float, int, tuple[int, ...]]]) -> None:
        for delay, event, values in queued:
            await asyncio.sleep(delay)
            self.model.unwritten.difference_update(values)
            end.write(struct.pack(f"<IIHI{len(values)}I", 14 + 4 * len(values), 8, event, transaction, *values))

    async def listen(self, end: PipeEnd) -> None:
        await self._packet(end.reader)
        end.write(struct.pack("<II", 8, 4))
        while True:
            kind, _ = await self._packet(end.reader)
            self.pongs += kind == 14

    async def _packet(self, reader: asyncio.StreamReader) -> tuple[int, bytes]:
        length, kind = struct.unpack("<II", await reader.readexactly(8))
        return kind, await reader.readexactly(length - 8)


@asynccontextmanager
async def on_ip(
    model: Model, options: CameraOptions | None = None, front: IpFront | None = None
) -> AsyncIterator[tuple[Camera, IpFront, tuple[PipeEnd, PipeEnd]]]:
    """Give a driver connected (not yet greeted) to ``model``, its front, and the far ends of both lines."""
    front = front or IpFront(model)
    (near, far), (near_events, far_events) = pipe(), pipe()
    link = PtpIp(
        PipeTransport("sky-camera", near, "host:15740"), PipeTransport("sky-camera", near_events, "host:15740")
    )
    camera = Camera("sky-camera", link, VirtualClock(START), options)
    tasks = [asyncio.create_task(front.commands(far, far_events)), asyncio.create_task(front.listen(far_events))]
    try:
        yield camera, front, (far, far_events)
    finally:
        await camera.aclose()
        await link.aclose()
        await asyncio.sleep(0.001)
        tasks += front.telling
        for task in tasks:
            task.cancel()
        ends = await asyncio.gather(*tasks, return_exceptions=True)
    for end in ends:
        if isinstance(end, Exception) and not isinstance(end, (asyncio.IncompleteReadError, ConnectionResetError)):
            raise end


# Behind a pyusb backend

_COMMON: dict[str, Any] = {"extra_descriptors": b"", "bLength": 0, "bDescriptorType": 0}


class UsbFront(usb.backend.IBackend):
    """A pyusb backend with cameras on it: what libusb would be with real ones.

    Attributes
    ----------
    packet
        Size of a full bulk packet; a transfer of whole packets needs an empty one after it.
    stalls, fails
        Transfers (by endpoint) that stall once; errors (by call) that are raised once.
    """

    def __init__(self, *models: Model, ends: tuple[int, int, int] = (0x81, 0x02, 0x83), packet: int = 64) -> None:
        self.models = models
        self.ends = ends
        self.packet = packet
        self.stalls: list[int] = []
        self.cleared: list[int] = []
        self.fails: dict[str, list[Exception]] = {}
        self.written: list[bytes] = []
        self.transfers: list[bytes] = []  # what the camera has to send on bulk in, one transfer each
        self.interrupts: list[bytes] = []
        self.pending: bytes = b""
        self.driver_active = True
        self.claimed: list[int] = []
        self.configured = True
        self.slow_reads = 0.0
        self.shape: Callable[[list[bytes]], list[bytes]] = lambda transfers: transfers
        self.lock = threading.Lock()
        self.asleep = threading.Event()

    # Enumeration

    def enumerate_devices(self) -> range:
        return range(len(self.models))

    def get_parent(self, dev: int) -> None:
        return None

    def get_device_descriptor(self, dev: int) -> SimpleNamespace:
        return SimpleNamespace(
            **_COMMON,
            **dict.fromkeys(("bcdUSB", "bDeviceClass", "bDeviceSubClass", "bDeviceProtocol", "bcdDevice"), 0),
            **dict.fromkeys(("iManufacturer", "iProduct", "port_number", "port_numbers", "speed"), 0),
            **{"bMaxPacketSize0": 64, "idVendor": 0x04B0, "idProduct": 0x010D + dev, "iSerialNumber": 3},
            **{"bNumConfigurations": 1, "address": dev + 1, "bus": 1},
        )

    def get_configuration_descriptor(self, dev: int, config: int) -> SimpleNamespace:
        if config:
            raise IndexError
        fields = {"wTotalLength": 39, "bNumInterfaces": 2, "bConfigurationValue": 1, "iConfiguration": 0}
        return SimpleNamespace(**_COMMON, **fields, bmAttributes=0xC0, bMaxPower=0)

    def get_interface_descriptor(self, dev: int, intf: int, alt: int, config: int) -> SimpleNamespace:
        if intf > 1 or alt:
            raise IndexError
        kind = (8, 6, 80) if intf == 0 else (6, 1, 1)  # mass storage first, then PTP
        fields = {"bInterfaceNumber": intf, "bAlternateSetting": 0, "bNumEndpoints": 3 * intf, "iInterface": 0}
        names = ("bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
        return SimpleNamespace(**_COMMON, **fields, **dict(zip(names, kind, strict=True)))

    def get_endpoint_descriptor(self, dev: int, ep: int, intf: int, alt: int, config: int) -> SimpleNamespace:
        if ep > 2:
            raise IndexError
        fields = {"bEndpointAddress": self.ends[ep], "bmAttributes": (2, 2, 3)[ep], "bInterval": 10}
        return SimpleNamespace(**_COMMON, **fields, wMaxPacketSize=self.packet, bRefresh=0, bSynchAddress=0)

    # Opening

    def open_device(self, dev: int) -> int:
        self._fail("open")
        return dev

    def close_device(self, handle: int) -> None:
        pass

    def get_configuration(self, handle: int) -> int:
        return int(self.configured)

    def set_configuration(self, handle: int, value: int) -> None:
        self.configured = True

    def set_interface_altsetting(self, handle: int, intf: int, alt: int) -> None:
        pass

    def claim_interface(self, handle: int, intf: int) -> None:
        self._fail("claim")
        self.claimed.append(intf)

    def release_interface(self, handle: int, intf: int) -> None:
        self.claimed.remove(intf)

    def is_kernel_driver_active(self, handle: int, intf: int) -> bool:
        return self.driver_active

    def detach_kernel_driver(self, handle: int, intf: int) -> None:
        self.driver_active = False

    def clear_halt(self, handle: int, end: int) -> None:
        self.cleared.append(end)

    def ctrl_transfer(
        self, handle: int, kind: int, request: int, value: int, index: int, data: "array.array[int]", timeout: int
    ) -> int:
        text = f"SN{handle}" if value & 0xFF else ""
        raw = (
            struct.pack("<BBH", 4, 3, 0x0409)
            if not value & 0xFF
            else bytes([2 + 2 * len(text), 3]) + text.encode("utf-16-le")
        )
        raw = raw[: len(data)]
        data[: len(raw)] = array.array("B", raw)
        return len(raw)

    # Transfers

    def bulk_write(self, handle: int, end: int, intf: int, data: "array.array[int]", timeout: int) -> int:
        self._fail("write")
        self._stall(end)
        assert (end, intf) == (self.ends[1], 1)
        with self.lock:
            self.written.append(data.tobytes())
            self.pending += data.tobytes()
            if len(data) % self.packet == 0 and len(data):
                return len(data)  # a whole number of packets: the transfer goes on
            self._obey(self.models[handle])
        return len(data)

    def _obey(self, model: Model) -> None:
        while len(self.pending) >= 12:
            length, kind, code, number = struct.unpack_from("<IHHI", self.pending)
            if kind == 1 and code == 0x1016 and len(self.pending) == length:
                return  # its data follow
            body, self.pending = self.pending[12:length], self.pending[length:]
            parameters = struct.unpack(f"<{len(body) // 4}I", body)
            data = b""
            if code == 0x1016:
                more = struct.unpack_from("<I", self.pending)[0]
                data, self.pending = self.pending[12:more], self.pending[more:]
            status, answer = model.answer(code, number, parameters, data)
            sends = [struct.pack("<IHHI", 12 + len(answer), 2, code, number) + answer] if answer else []
            sends.append(struct.pack("<IHHI", 12, 3, status, number))
            for raw in self.shape(sends):
                self.transfers.append(raw)
                if raw and len(raw) % self.packet == 0:
                    self.transfers.append(b"")
            model.unwritten.clear()
            for _, event, values in model.events:
                self.interrupts.append(
                    struct.pack(f"<IHHI{len(values)}I", 12 + 4 * len(values), 4, event, number, *values)
                )
            model.events = []

    def bulk_read(self, handle: int, end: int, intf: int, buffer: "array.array[int]", timeout: int) -> int:
        self._fail("read")
        self._stall(end)
        assert end == self.ends[0]
        return self._give(self.transfers, buffer, timeout)

    def intr_read(self, handle: int, end: int, intf: int, buffer: "array.array[int]", timeout: int) -> int:
        self._fail("interrupt")
        assert end == self.ends[2]
        return self._give(self.interrupts, buffer, timeout)

    def _give(self, queue: list[bytes], buffer: "array.array[int]", timeout: int) -> int:
        if self.slow_reads:
            self.asleep.wait(self.slow_reads)
        with self.lock:
            if queue:
                raw = queue.pop(0)
                assert len(raw) <= len(buffer), "an overflow on real USB"
                buffer[: len(raw)] = array.array("B", raw)
                return len(raw)
        self.asleep.wait(min(timeout, 20) / 1000)
        raise usb.core.USBTimeoutError("nothing there", -7, errno.ETIMEDOUT)

    def _fail(self, call: str) -> None:
        if self.fails.get(call):
            raise self.fails[call].pop(0)

    def _stall(self, end: int) -> None:
        if end in self.stalls:
            self.stalls.remove(end)
            raise usb.core.USBError("pipe", -9, errno.EPIPE)
