"""The units on one line and what may go wrong with their answers; RTU and TCP are two ways of reaching them."""

from dataclasses import dataclass, field

from simulators.goniophotometer.pdu import answer, exception
from simulators.goniophotometer.units import Unit


@dataclass(frozen=True, slots=True)
class LateReply:
    """The request is obeyed at once, its reply comes ``seconds`` later; meanwhile other requests are answered."""

    seconds: float = 2.0


@dataclass(frozen=True, slots=True)
class WrongCrc:
    """The reply comes with a wrong check sum (over TCP, which has none, it is lost)."""


@dataclass(frozen=True, slots=True)
class ExceptionReply:
    """The request is not obeyed but refused with ``code``."""

    code: int = 4


@dataclass(frozen=True, slots=True)
class LostReply:
    """The request is obeyed, its reply is lost."""


@dataclass(frozen=True, slots=True)
class SilentUnit:
    """The request is not even heard."""


ModbusFault = LateReply | WrongCrc | ExceptionReply | LostReply | SilentUnit


@dataclass
class _Armed:
    unit: int | None
    function: int | None
    fault: ModbusFault
    times: int | None
    skip: int


@dataclass
class ModbusFaults:
    """Faults in force, by unit and function code."""

    _armed: list[_Armed] = field(default_factory=list)

    def arm(
        self,
        fault: ModbusFault,
        *,
        unit: int | None = None,
        function: int | None = None,
        times: int | None = 1,
        skip: int = 0,
    ) -> None:
        """Spoil the next ``times`` answers (``None``: all) of a unit to a function, after ``skip`` good ones."""
        self._armed.append(_Armed(unit, function, fault, times, skip))

    def clear(self) -> None:
        """Mend everything."""
        self._armed.clear()

    def take(self, unit: int, function: int) -> ModbusFault | None:
        """The fault for this request, if any; uses up one turn of it."""
        for armed in self._armed:
            if armed.unit not in (None, unit) or armed.function not in (None, function):
                continue
            if armed.skip:
                armed.skip -= 1
                continue
            if armed.times is not None:
                armed.times -= 1
                if armed.times <= 0:
                    self._armed.remove(armed)
            return armed.fault
        return None


@dataclass(frozen=True, slots=True)
class Answer:
    """A reply to send.

    Attributes
    ----------
    pdu
        The reply.
    delay_s
        When it is ready, after the request [s].
    late
        Whether that is a fault, during which other requests are served.
    spoil_crc
        Whether its check sum is to be wrong.
    """

    pdu: bytes
    delay_s: float
    late: bool = False
    spoil_crc: bool = False


class Slaves:
    """All units reached over one line."""

    def __init__(self, units: dict[int, Unit], faults: ModbusFaults | None = None) -> None:
        self.units = units
        self.faults = faults or ModbusFaults()

    def answer(self, unit_id: int, pdu: bytes) -> Answer | None:
        """Obey a request to a unit that exists; return its answer, or ``None`` for silence."""
        unit = self.units[unit_id]
        if not unit.answering:
            return None
        fault = self.faults.take(unit_id, pdu[0])
        match fault:
            case SilentUnit():
                return None
            case ExceptionReply(code):
                return Answer(exception(pdu[0], code), unit.turnaround_s)
        reply = answer(unit, pdu)
        match fault:
            case LostReply():
                return None
            case LateReply(seconds):
                return Answer(reply, seconds, late=True)
            case WrongCrc():
                return Answer(reply, unit.turnaround_s, spoil_crc=True)
        return Answer(reply, unit.turnaround_s)

    def broadcast(self, pdu: bytes) -> None:
        """Let every unit obey a write to unit 0; nobody answers."""
        for unit in self.units.values():
            if unit.answering and pdu[0] in (5, 6, 15, 16):
                answer(unit, pdu)
