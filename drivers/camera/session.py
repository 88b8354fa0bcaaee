"""A PTP session: numbered transactions with a time limit, and the few operations the camera's driver needs."""

from collections.abc import Callable
from typing import Final, TypeVar

from drivers.camera.codes import ALL_STORES, Answer, Operation, reason
from drivers.camera.containers import command
from drivers.camera.datasets import (
    DeviceInfo,
    ObjectInfo,
    PropertyDescription,
    StorageInfo,
    Value,
    decode_handles,
    pack_value,
)
from drivers.camera.link import Event, Link, Reply
from drivers.exchange import FrameError, answer_within, open_within
from labdaq.clock import NS, Clock
from labdaq.errors import ConnectError, Exchange, Place, ProtocolError, RefusedError

T = TypeVar("T")

_SESSION: Final = 1
_BUSY_PAUSE_S: Final = 0.1
_GOODBYE_S: Final = 2.0
_SILENT: Final = "check that the camera is on and not asleep; switch it off and on, then connect again"


class Session:
    """One session with one camera.

    Parameters
    ----------
    link, clock
        The connection, and what limits waiting.
    timeout_s
        Longest wait for a reply [s], also of a picture's size unless the caller says otherwise.
    busy_s
        How long a busy camera is asked again [s]; being busy means that it has not begun.
    """

    def __init__(self, link: Link, clock: Clock, timeout_s: float, busy_s: float) -> None:
        self._link = link
        self._clock = clock
        self._timeout_s = timeout_s
        self._busy_s = busy_s
        self._transaction = 0
        self._is_open = False

    @property
    def place(self) -> Place:
        """Which camera is meant, and where."""
        return self._link.place

    @property
    def transaction(self) -> int:
        """Number of the last transaction."""
        return self._transaction

    async def open(self) -> None:
        """Connect and open the session; one that an earlier program left open is closed first."""
        await open_within(self._timeout_s, self._link, self._clock)
        self._transaction = -1  # opening the session is transaction 0
        reply = await self._transact(Operation.OPEN_SESSION, (_SESSION,))
        if reply.code == Answer.SESSION_ALREADY_OPEN:
            self._transaction = 0
            await self._transact(Operation.CLOSE_SESSION, ())
            self._transaction = -1
            reply = await self._transact(Operation.OPEN_SESSION, (_SESSION,))
        self._expect_ok(reply, Operation.OPEN_SESSION, (_SESSION,))
        self._is_open = True

    async def aclose(self) -> None:
        """Close the session if the camera still listens, and disconnect."""
        was_open, self._is_open = self._is_open, False
        try:
            if was_open:
                await self._transact(Operation.CLOSE_SESSION, (), timeout_s=_GOODBYE_S)
        finally:
            await self._link.aclose()

    async def call(
        self,
        operation: Operation,
        *parameters: int,
        data: bytes | None = None,
        timeout_s: float | None = None,
    ) -> Reply:
        """Do one operation; a busy camera is asked again.

        Raises `RefusedError` for every other response than OK, `DeviceTimeout`, `ProtocolError`, `ConnectError`.
        """
        if not self._is_open:
            raise ConnectError("the camera is not connected", place=self.place, hint="connect first")
        began_ns = self._clock.mono_ns()
        while True:
            reply = await self._transact(operation, parameters, data, timeout_s)
            waited_s = (self._clock.mono_ns() - began_ns) / NS
            if reply.code != Answer.DEVICE_BUSY or waited_s >= self._busy_s:
                break
            await self._clock.sleep(_BUSY_PAUSE_S)
        self._expect_ok(reply, operation, parameters)
        return reply

    async def device_info(self) -> DeviceInfo:
        """Ask who it is and what it can do."""
        return await self._dataset(DeviceInfo.decode, Operation.GET_DEVICE_INFO)

    async def storages(self) -> dict[int, StorageInfo]:
        """Ask for its cards, by storage number; empty slots are left out."""
        numbers = await self._dataset(decode_handles, Operation.GET_STORAGE_IDS)
        cards = [number for number in numbers if number & 0xFFFF]
        return {number: await self._dataset(StorageInfo.decode, Operation.GET_STORAGE_INFO, number) for number in cards}

    async def handles(self) -> tuple[int, ...]:
        """Ask for all objects on all cards."""
        return await self._dataset(decode_handles, Operation.GET_OBJECT_HANDLES, ALL_STORES, 0, 0)

    async def object_info(self, handle: int) -> ObjectInfo:
        """Ask what an object is."""
        return await self._dataset(ObjectInfo.decode, Operation.GET_OBJECT_INFO, handle)

    async def describe(self, code: int) -> PropertyDescription:
        """Ask for a setting, its value and its choices."""
        return await self._dataset(PropertyDescription.decode, Operation.GET_DEVICE_PROP_DESC, code)

    async def put(self, description: PropertyDescription, value: Value) -> PropertyDescription:
        """Change a setting, read it back and return it as it is now.

        Raises `RefusedError` when the camera took another value than it was given.
        """
        data = pack_value(value, description.kind)
        await self.call(Operation.SET_DEVICE_PROP_VALUE, description.code, data=data)
        after = await self.describe(description.code)
        if after.current != value:
            raise RefusedError(
                f"setting 0x{description.code:04X} became {after.current} when it was given {value}",
                place=self.place,
                hint="turn the mode dial to M; choose one of the values it offers",
            )
        return after

    async def next_event(self, within_s: float) -> Event | None:
        """Wait for the camera's next event; ``None`` when it says nothing in that time."""
        try:
            async with self._clock.timeout(within_s):
                return await self._link.next_event()
        except TimeoutError:
            return None

    async def _dataset(self, decode: Callable[[bytes], T], operation: Operation, *parameters: int) -> T:
        reply = await self.call(operation, *parameters)
        try:
            return decode(reply.data)
        except FrameError as error:
            raise ProtocolError(
                f"{operation.name}: {error}",
                place=self.place,
                exchange=Exchange(command(operation, self._transaction, parameters).encode(), reply.data[:256]),
                hint="switch the camera off and on, then connect again",
            ) from error

    async def _transact(
        self,
        operation: Operation,
        parameters: tuple[int, ...],
        data: bytes | None = None,
        timeout_s: float | None = None,
    ) -> Reply:
        self._transaction = (self._transaction + 1) % 0xFFFF_FFFF
        sent = command(operation, self._transaction, parameters).encode()
        async with answer_within(timeout_s or self._timeout_s, self._link, self._clock, sent, _SILENT):
            return await self._link.transact(operation, self._transaction, parameters, data)

    def _expect_ok(self, reply: Reply, operation: Operation, parameters: tuple[int, ...]) -> None:
        if reply.code == Answer.OK:
            return
        meaning, hint = reason(reply.code)
        listed = ", ".join(f"0x{parameter:X}" for parameter in parameters)
        raise RefusedError(
            f"{operation.name}({listed}) was refused with {meaning}",
            place=self.place,
            exchange=Exchange(command(operation, self._transaction, parameters).encode()),
            hint=hint,
        )
