"""One Modbus line with one owner: a question, its answer, and silence where silence is due.

RTU answers carry no number: an answer that comes after its question was given up looks like the answer to the next
one. So after any failed exchange the line keeps quiet for longer than the slowest device needs, and throws away what
came meanwhile. Writes are sent once, whatever happens; only the device's state can tell whether a write that was not
acknowledged was obeyed.
"""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from drivers.exchange import FrameError, answer_within, open_within
from drivers.goniophotometer.codec import (
    BAD_CHECK_SUM,
    EXCEPTIONS,
    Answer,
    Framing,
    Function,
    Request,
    decode_rtu,
    decode_tcp,
    encode,
    rtu_length,
    tcp_length,
    transaction_of,
)
from drivers.serial_port import SerialSettings
from drivers.transport import Transport
from labdaq.clock import NS, Clock
from labdaq.errors import ConfigError, DeviceError, DeviceTimeout, Exchange, Place, ProtocolError, RefusedError

RTU_SETTINGS: Final = SerialSettings(9600, 8, "N", 1)
"""Default of the CS2RS drive and the ICP DAS modules."""

_LONGEST_FRAME: Final = 256
_PATIENCE: Final = 10
_SILENT: Final = "check its power, unit number, wiring (A and B swapped?) and the line's speed"
_DAMAGED: Final = "check termination and grounding of the line, its speed and parity, and that it has one master only"


@dataclass(frozen=True, slots=True)
class LineOptions:
    """What the station file says about a Modbus line.

    Attributes
    ----------
    framing
        RTU on a serial line, TCP on a network; RTU through a serial device server is RTU on a TCP transport.
    timeout_s
        Longest wait for an answer [s].
    worst_reply_s
        Longest time after a question at which a device may still begin to answer [s]; longer than ``timeout_s``.
    read_retries
        How often a read is asked again; writes never are.
    settings
        Of the serial line; gives the length of the silence between frames. Unused in TCP framing.
    echo
        Whether the adapter gives back what is sent.
    """

    framing: Framing = Framing.RTU
    timeout_s: float = 1.0
    worst_reply_s: float = 2.0
    read_retries: int = 1
    settings: SerialSettings = RTU_SETTINGS
    echo: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.timeout_s <= self.worst_reply_s:
            raise ConfigError(
                f"a Modbus line's timeout_s ({self.timeout_s:g}) must be positive and not above worst_reply_s "
                f"({self.worst_reply_s:g})"
            )


class Line:
    """A Modbus master on one transport.

    Parameters
    ----------
    name
        Name of the instrument the line belongs to, for errors.
    transport, clock, options
        The line itself, what limits waiting, and see `LineOptions`.

    Attributes
    ----------
    retries
        How many reads had to be asked again since the line was made.
    """

    def __init__(self, name: str, transport: Transport, clock: Clock, options: LineOptions | None = None) -> None:
        self.options: Final = options or LineOptions()
        self.retries = 0
        self._name = name
        self._transport = transport
        self._clock = clock
        self._lock = asyncio.Lock()
        self._transaction = 0
        self._quiet_until_ns = 0
        self._suspect = False  # the last question was given up: answers may be out of step

    @property
    def clock(self) -> Clock:
        """The clock of all devices on the line."""
        return self._clock

    @property
    def port(self) -> str:
        """Where the line is reached."""
        return self._transport.place.port

    def place(self, unit: int) -> Place:
        """Return the place of one device."""
        return Place(self._name, f"{self.port} unit {unit}")

    async def open(self) -> None:
        """Open the line; raises `ConnectError`."""
        await open_within(max(5.0, self.options.timeout_s), self._transport, self._clock)

    async def aclose(self) -> None:
        """Close the line."""
        await self._transport.aclose()

    async def read_bits(
        self, unit: int, address: int, count: int, function: Function = Function.READ_COILS
    ) -> tuple[int, ...]:
        """Read coils (or discrete inputs) as 0 and 1; raises as `ask`."""
        return await self.ask(Request(unit, function, address, count))

    async def read_words(
        self, unit: int, address: int, count: int, function: Function = Function.READ_HOLDING
    ) -> tuple[int, ...]:
        """Read holding (or input) registers; raises as `ask`."""
        return await self.ask(Request(unit, function, address, count))

    async def write_coil(self, unit: int, address: int, value: bool) -> None:
        """Write one coil, once; raises as `ask`."""
        await self.ask(Request(unit, Function.WRITE_COIL, address, values=(int(value),)))

    async def write_word(self, unit: int, address: int, value: int) -> None:
        """Write one register, once; raises as `ask`."""
        await self.ask(Request(unit, Function.WRITE_REGISTER, address, values=(value,)))

    async def write_words(self, unit: int, address: int, values: Sequence[int]) -> None:
        """Write registers in one frame, once; raises as `ask`."""
        await self.ask(Request(unit, Function.WRITE_REGISTERS, address, len(values), tuple(values)))

    async def ask(self, request: Request) -> tuple[int, ...]:
        """Ask one question and return the words or bits of its answer.

        A read is asked again when its answer is missing or damaged, or says that the question was (exception 08).
        Raises `RefusedError` for other exceptions, `DeviceTimeout`, `ProtocolError` and `ConnectError`.
        """
        trials = 1 + (self.options.read_retries if request.is_read else 0)
        async with self._lock:
            for trial in range(1, trials + 1):
                try:
                    answer, exchange = await self._exchange(request)
                except (DeviceTimeout, ProtocolError):
                    if trial == trials:
                        raise
                else:
                    if not answer.exception:
                        return answer.values
                    if answer.exception != BAD_CHECK_SUM or trial == trials:
                        raise self._refused(request, answer.exception, exchange)
                self.retries += 1
        raise AssertionError("unreachable: the last trial returns or raises")

    async def _exchange(self, request: Request) -> tuple[Answer, Exchange]:
        self._transaction = self._transaction % 0xFFFF + 1
        sent = encode(request, self.options.framing, self._transaction)
        await self._silence()
        began_ns = self._clock.mono_ns()
        try:
            async with answer_within(self.options.timeout_s, self._transport, self._clock, sent, _SILENT):
                await self._transport.write(sent)
                frame = await self._receive(request, sent)
            elapsed_s = (self._clock.mono_ns() - began_ns) / NS
            exchange = Exchange(sent, frame, elapsed_s)
            try:
                answer = (decode_rtu if self._is_rtu else decode_tcp)(request, frame)
            except FrameError as error:
                raise self._damaged(request, error, exchange) from error
        except BaseException as error:
            self._suspect = True
            self._distrust(began_ns)
            if isinstance(error, DeviceError):
                raise self._at_unit(error, request) from error
            raise
        if self._suspect:  # was this the late answer to the question before? then its own is still to come
            self._distrust(began_ns)
            self._suspect = False
        else:
            self._keep_gap()
        return answer, exchange

    async def _receive(self, request: Request, sent: bytes) -> bytes:
        """Return one whole frame that may answer the request."""
        if self.options.echo:
            echo = await self._transport.read_exactly(len(sent))
            if echo != sent:
                raise self._damaged(request, FrameError("the echo differs from what was sent"), Exchange(sent, echo))
        if not self._is_rtu:
            return await self._receive_tcp(request, sent)
        try:
            frame = await self._transport.read_frame(2, lambda head: rtu_length(request, head))
        except FrameError as error:
            received = await self._transport.drain_input()
            raise self._damaged(request, error, Exchange(sent, received)) from error
        if request.is_read and (sent.startswith(frame) or frame.startswith(sent)):
            heard_itself = FrameError(
                "the line gives back what is sent (set echo = true, or switch off the adapter's echo)"
            )
            raise self._damaged(request, heard_itself, Exchange(sent, frame))
        return frame

    async def _receive_tcp(self, request: Request, sent: bytes) -> bytes:
        """Return the frame with our transaction number; late answers to earlier questions are passed over."""
        while True:
            try:
                frame = await self._transport.read_frame(6, tcp_length)
            except FrameError as error:
                received = await self._transport.drain_input()
                await self._transport.aclose()  # where the next frame begins cannot be told any more
                raise self._damaged(request, error, Exchange(sent, received)) from error
            if transaction_of(frame) == self._transaction:
                return frame

    @property
    def _is_rtu(self) -> bool:
        return self.options.framing is Framing.RTU

    async def _silence(self) -> None:
        """Wait until nothing that is still to come could be taken for the answer to the next question."""
        quiet_s = (self._quiet_until_ns - self._clock.mono_ns()) / NS
        if quiet_s > 0:
            await self._clock.sleep(quiet_s)
        if not self._is_rtu:
            return
        for _ in range(_PATIENCE):
            if not (received := await self._transport.drain_input()):
                return
            await self._clock.sleep(self._longest_s)  # let it talk itself out, and be silent for as long
        raise ProtocolError(
            "the line does not become silent",
            place=self._transport.place,
            exchange=Exchange(received=received),
            hint="find the device or second master that talks without being asked",
        )

    @property
    def _longest_s(self) -> float:
        """Time from a question to the end of the latest and longest answer [s]."""
        return self.options.worst_reply_s + _LONGEST_FRAME * self.options.settings.character_s

    def _distrust(self, asked_ns: int) -> None:
        """Keep quiet until the slowest device would have ended its answer to a question of ``asked_ns``."""
        if self._is_rtu:
            self._quiet_until_ns = asked_ns + round(self._longest_s * NS)

    def _keep_gap(self) -> None:
        """RTU frames are 3.5 characters apart, at least 1.75 ms (Modbus over serial line V1.02, 2.5.1.1)."""
        if self._is_rtu:
            gap_s = max(3.5 * self.options.settings.character_s, 1.75e-3)
            self._quiet_until_ns = self._clock.mono_ns() + round(gap_s * NS)

    def _damaged(self, request: Request, error: FrameError, exchange: Exchange) -> ProtocolError:
        return ProtocolError(f"void answer: {error}", place=self.place(request.unit), exchange=exchange, hint=_DAMAGED)

    def _at_unit(self, error: DeviceError, request: Request) -> DeviceError:
        """Return the error with the unit in its place, and a word of caution after a write."""
        hint = error.hint
        if not request.is_read:
            hint += "; nobody knows whether the device obeyed: look at its state before sending again"
        return type(error)(error.what, place=self.place(request.unit), exchange=error.exchange, hint=hint)

    def _refused(self, request: Request, code: int, exchange: Exchange) -> RefusedError:
        meaning, hint = EXCEPTIONS.get(code, ("a reason outside the Modbus specification", "see the device's manual"))
        return RefusedError(
            f"exception {code:02d} to function {request.function.value:02d} at 0x{request.address:04X}: {meaning}",
            place=self.place(request.unit),
            exchange=exchange,
            hint=hint,
        )
