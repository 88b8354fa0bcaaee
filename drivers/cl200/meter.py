"""The driver of the CL-200: all heads measure at one trigger, then each is read."""

from typing import Final

from drivers.cl200.codec import (
    BROADCAST,
    CONNECT_PARAMETER,
    END,
    FACTORY_PARAMETER,
    HOLD_PARAMETER,
    SET_EXTERNAL_PARAMETER,
    TRIGGER_PARAMETER,
    Command,
    Complaint,
    Frame,
    Number,
    complaint_of,
    decode,
    encode,
    error_of,
)
from drivers.cl200.options import ChromaMeterOptions, Head
from drivers.cl200.readings import Answer, Taken, colour_readings, instrument_of, temperature_reading, values_of
from drivers.exchange import FrameError, Span, answer_within, open_within, span
from drivers.serial_port import SerialSettings
from drivers.transport import Transport
from labdaq.clock import NS, Clock
from labdaq.errors import (
    ConnectError,
    DeviceTimeout,
    Exchange,
    ProtocolError,
    RefusedError,
)
from labdaq.reading import Instrument, Reading

LINE: Final = SerialSettings(9600, 7, "E", 1)
"""The meter's fixed serial settings."""

WAIT_S: Final = 0.5
"""The maker's waiting time after connecting, hold, setting a head, and a trigger [s]."""
MEASURING_S: Final = 0.5
"""Length of a measurement after the trigger [s]."""
LONGEST_LINE: Final = 128
"""A frame has at most 38 bytes; noise may stand before it."""

_CONNECT_HINT: Final = (
    "switch the meter on, wait until CAL leaves the display, check the cable (9600 7E1) and the numbers on the heads"
)
REMEASURE: Final = frozenset({Complaint.OUT_OF_RANGE, Complaint.RANGE_UNKNOWN})
_BROKEN_HEAD: Final[dict[Complaint, str]] = {
    Complaint.HEAD_POWER: "switch the meter off and on, then connect again",
    Complaint.EEPROM: "switch the meter off and on; if it comes back, the head needs service",
}


class ChromaMeter:
    """A CL-200 or CL-200A.

    Parameters
    ----------
    name
        Its name in the station file.
    transport
        The line to it; a serial port is opened with `LINE`.
    clock
        What stamps readings and limits waiting.
    options
        See `ChromaMeterOptions`.
    """

    def __init__(
        self, name: str, transport: Transport, clock: Clock, options: ChromaMeterOptions | None = None
    ) -> None:
        self.options: Final = options or ChromaMeterOptions()
        self._name = name
        self._line = transport
        self._clock = clock
        self._started = False

    def identity(self) -> Instrument:
        """Who it is, as declared."""
        return instrument_of(self._name, self._line.place.port, self.options, self.options.heads[0])

    async def connect(self) -> None:
        """Open the line and bring meter and heads under control: connect, hold, external mode of each head.

        Takes a second and half a second for each head. Raises `ConnectError` when the port cannot be had or nobody
        answers, `RefusedError` when a head cannot be used.
        """
        await open_within(self.options.timeout_s, self._line, self._clock)
        try:
            await self._start()
        except DeviceTimeout as error:
            raise ConnectError(
                "the meter or one of its heads does not answer",
                place=error.place,
                exchange=error.exchange,
                hint=_CONNECT_HINT,
            ) from error

    async def aclose(self) -> None:
        """Close the line; the meter stays under control until it is switched off."""
        await self._line.aclose()
        self._started = False

    async def measure(self) -> list[Reading]:
        """Trigger all heads at once; return illuminance [lx] and chromaticity x, y of each, and (if asked) Tcp [K].

        While a head changes its range the measurement is repeated, at most ``retriggers`` times. The time given is the
        middle of the half second after the trigger.

        The standard uncertainty takes the maker's limits of error as the half-width of a uniform distribution (GUM
        4.3.7): illuminance (2 % + 1 digit)/√3, x and y 0.002/√3. These are the data sheet's figures for illuminant A
        (chromaticity: at 800 lx); a certificate's go into the options. Chromaticity in low light and Tcp have none.

        A value that the meter declares void is ``None`` with a flag: ``OVER_RANGE``, ``LOW_BATTERY``, ``MISSING``
        (the range was never determined). Raises `RefusedError` for a head without power or with faulty memory,
        `DeviceTimeout` and `ProtocolError` when the answers stay away or void; the next call then starts the meter
        anew.
        """
        if not self._started:
            await self._start()
        for _ in range(1 + self.options.retriggers):
            when = await self._trigger()
            answers = [(head, await self._ask_head(head, Command.EV_XY)) for head in self.options.heads]
            if not any(complaint_of(answer.frame) in REMEASURE for _, answer in answers):
                break
        else:  # perhaps it never gets well because it is broken
            for head, answer in answers:
                self._refuse_broken(head, error_of(answer.frame), answer)
        readings: list[Reading] = []
        for head, answer in answers:
            taken = Taken(
                when, self._clock.state(), instrument_of(self._name, self._line.place.port, self.options, head)
            )
            readings += colour_readings(self.options, head, answer, taken)
            if self.options.colour_temperature:
                in_kelvin = await self._ask_head(head, Command.EV_TCP_DUV)
                readings.append(temperature_reading(head, in_kelvin, taken))
        return readings

    async def read_last(self, command: Command) -> dict[int, tuple[Number | None, Number | None, Number | None]]:
        """Read the last measurement once more in other terms, for each head number.

        ``command`` is `Command.XYZ` (X, Y, Z), `Command.EV_XY`, `Command.EV_UV` (Ev, u', v') or `Command.EV_TCP_DUV`.
        All are ``None`` where the status voids the values. Raises as `measure`.
        """
        values = {}
        for head in self.options.heads:
            values[head.number] = values_of((await self._ask_head(head, command)).frame)
        return values

    # The conversation

    async def _start(self) -> None:
        self._started = False
        await self._ask(Frame(0, Command.CONNECT, CONNECT_PARAMETER))
        await self._clock.sleep(WAIT_S)
        await self._line.drain_input()
        await self._tell(Frame(BROADCAST, Command.HOLD, HOLD_PARAMETER))
        for head in self.options.heads:
            await self._set_external(head)
        self._started = True

    async def _set_external(self, head: Head) -> None:
        request = Frame(head.number, Command.EXTERNAL, SET_EXTERNAL_PARAMETER)
        answer = await self._ask(request)
        if error_of(answer.frame) is Complaint.NOT_HELD:  # the maker's cure: hold, then set once more
            await self._clock.sleep(WAIT_S)
            await self._tell(Frame(BROADCAST, Command.HOLD, HOLD_PARAMETER))
            answer = await self._ask(request)
        complaint = error_of(answer.frame)
        if complaint is Complaint.NOT_HELD:
            raise self._refused(head, complaint, answer)
        self._refuse_broken(head, complaint, answer)
        await self._clock.sleep(WAIT_S)  # other errors only tell of the measurement before

    async def _trigger(self) -> Span:
        began_ns = self._clock.mono_ns()
        await self._tell(Frame(BROADCAST, Command.EXTERNAL, TRIGGER_PARAMETER))
        return span(self._clock, began_ns, began_ns + round(MEASURING_S * NS))

    async def _ask_head(self, head: Head, command: Command) -> Answer:
        answer = await self._ask(Frame(head.number, command, FACTORY_PARAMETER))
        self._refuse_broken(head, complaint_of(answer.frame), answer)
        return answer

    async def _tell(self, frame: Frame) -> None:
        """Send what nobody answers, and wait as long as the maker says, counted from the last character."""
        sent = encode(frame)
        await self._line.drain_input()
        async with answer_within(self.options.timeout_s, self._line, self._clock, sent, _CONNECT_HINT):
            await self._line.write(sent)
        await self._clock.sleep(WAIT_S + len(sent) * LINE.character_s)

    async def _ask(self, request: Frame) -> Answer:
        """Send a question until a sound answer comes; none of them makes the meter measure."""
        trials = 1 + self.options.resends
        for trial in range(trials):
            try:
                return await self._exchange(request, retried=trial > 0)
            except (DeviceTimeout, ProtocolError):
                if trial == trials - 1:
                    self._started = False
                    raise
        raise AssertionError("unreachable: the last trial returns or raises")

    async def _exchange(self, request: Frame, *, retried: bool) -> Answer:
        sent = encode(request)
        await self._line.drain_input()
        began_ns = self._clock.mono_ns()
        async with answer_within(self.options.timeout_s, self._line, self._clock, sent, _CONNECT_HINT):
            await self._line.write(sent)
            while True:
                line = await self._line.read_until(END, LONGEST_LINE)
                try:
                    frame = self._sound(request, line, sent)
                except FrameError as error:
                    elapsed_s = (self._clock.mono_ns() - began_ns) / NS
                    raise ProtocolError(
                        f"void answer: {error}",
                        place=self._line.place,
                        exchange=Exchange(sent, line, elapsed_s),
                        hint="check the serial settings (9600 7E1), the cable and its surroundings",
                    ) from error
                if frame is not None:
                    return Answer(frame, sent, line, retried)

    def _sound(self, request: Frame, line: bytes, sent: bytes) -> Frame | None:
        """Return the frame if it answers the request, ``None`` if it answers an earlier one; raises `FrameError`."""
        if line.endswith(sent):
            raise FrameError("the line gives back what is sent (switch off the echo of the adapter)")
        frame = decode(line)
        if (frame.head, frame.command) != (request.head, request.command):
            return None
        if request.command in {Command.CONNECT, Command.EXTERNAL}:
            if frame.data:
                raise FrameError("data where none belong")
            error_of(frame)
        else:
            values_of(frame)
        return frame

    def _refuse_broken(self, head: Head, complaint: Complaint | None, answer: Answer) -> None:
        if complaint in _BROKEN_HEAD:
            self._started = False
            raise self._refused(head, complaint, answer)

    def _refused(self, head: Head, complaint: Complaint, answer: Answer) -> RefusedError:
        hint = _BROKEN_HEAD.get(complaint, "switch the meter off and on, wait until CAL leaves the display")
        return RefusedError(
            f"head {head.number:02d}: {complaint.value}",
            place=self._line.place,
            exchange=Exchange(answer.sent, answer.raw),
            hint=hint,
        )
