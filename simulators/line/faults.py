"""What can go wrong between an instrument and its reader, switched on by tests.

A fault is armed in a `FaultBox`, for a number of outgoing frames or for good. Faults change what the line carries,
never what the instrument does: a command whose reply is dropped was still obeyed.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Drop:
    """The frame is lost whole."""


@dataclass(frozen=True, slots=True)
class Truncate:
    """Only the first ``keep`` bytes arrive (a negative number counts from the end)."""

    keep: int = -1


@dataclass(frozen=True, slots=True)
class Corrupt:
    """The byte at ``index`` arrives with the bits of ``mask`` flipped."""

    index: int = 0
    mask: int = 0x01


@dataclass(frozen=True, slots=True)
class Late:
    """The frame begins ``seconds`` later than it should."""

    seconds: float = 1.0


@dataclass(frozen=True, slots=True)
class Garbage:
    """Noise arrives immediately before the frame."""

    data: bytes = b"\x7f\x00\x15"


@dataclass(frozen=True, slots=True)
class Disconnect:
    """The line breaks after ``after`` bytes of the frame."""

    after: int = 0


@dataclass(frozen=True, slots=True)
class Echo:
    """The line returns what the reader sends, before the reply (an RS-485 adapter with its receiver left on)."""


LineFault = Drop | Truncate | Corrupt | Late | Garbage | Disconnect | Echo


@dataclass(frozen=True, slots=True)
class Mangled:
    """What is left of an outgoing frame.

    Attributes
    ----------
    data
        The bytes to carry.
    late_s
        How much later than usual they begin [s].
    disconnect
        Whether the line breaks after them.
    """

    data: bytes
    late_s: float = 0.0
    disconnect: bool = False


@dataclass
class _Armed:
    fault: LineFault
    times: int | None
    skip: int


@dataclass
class FaultBox:
    """The faults in force on one line."""

    _armed: list[_Armed] = field(default_factory=list)

    def arm(self, fault: LineFault, times: int | None = 1, skip: int = 0) -> None:
        """Spoil the next ``times`` frames (``None``: every one from now on) after letting ``skip`` frames pass."""
        self._armed.append(_Armed(fault, times, skip))

    def clear(self) -> None:
        """Mend the line."""
        self._armed.clear()

    @property
    def echo(self) -> bool:
        """Whether the line echoes now."""
        return any(isinstance(armed.fault, Echo) and not armed.skip for armed in self._armed)

    def mangle(self, frame: bytes) -> Mangled:
        """Use up one turn of every armed fault on an outgoing frame; return what remains to be carried."""
        spoilt = Mangled(frame)
        for armed in tuple(self._armed):
            if armed.skip:
                armed.skip -= 1
                continue
            spoilt = _apply(armed.fault, spoilt)
            if armed.times is not None:
                armed.times -= 1
                if armed.times <= 0:
                    self._armed.remove(armed)
        return spoilt


def _apply(fault: LineFault, frame: Mangled) -> Mangled:
    """One fault on what earlier faults left."""
    data, late_s, disconnect = frame.data, frame.late_s, frame.disconnect
    match fault:
        case Drop():
            data = b""
        case Truncate(keep):
            data = data[:keep]
        case Corrupt(index, mask) if data:
            at = index % len(data)
            data = data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]
        case Late(seconds):
            late_s += seconds
        case Garbage(noise):
            data = noise + data
        case Disconnect(after):
            data, disconnect = data[:after], True
        case _:
            pass
    return Mangled(data, late_s, disconnect)
