"""What can go wrong, in words an operator can act on.

::

    LabdaqError                      1   (70 when it is our own bug)
    ├── ConfigError                  78  a station file or test script that cannot be used
    ├── DataError                    65  a recording, picture, .ies or case that cannot be read
    ├── ClockError                   75  the clock is not good enough for what was asked; try later
    ├── StorageError                 74  the disk refused; the session ends, nothing acknowledged is lost
    ├── RunError                     1   a test ended before its script did
    ├── SimulationError              70  an engine failed, or broke energy conservation
    └── DeviceError                  69  an instrument did not do what was asked
        ├── ConnectError             69  the port cannot be opened, or nobody answers on it
        ├── DeviceTimeout            69  no (complete) answer in time; also a builtin TimeoutError
        ├── ProtocolError            69  an answer that breaks the instrument's protocol
        └── RefusedError             69  a well-formed answer that says no

The number is the exit code of the command that ends with the error (after sysexits.h; 64 is wrong usage).
"""

from dataclasses import dataclass, field


class LabdaqError(Exception):
    """Base of everything labdaq raises on purpose.

    Parameters
    ----------
    message
        One sentence: what happened, naming the file, line, field, port or instrument.
    hint
        What the operator should try next; empty when there is nothing to try.
    """

    exit_code = 1

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  try: {self.hint}" if self.hint else self.message


class ConfigError(LabdaqError):
    """A station file or script has mistakes; the message lists all of them, one a line.

    Example scenarios: an unknown key, a port given twice, a gamma beyond 90 degrees.
    """

    exit_code = 78


class DataError(LabdaqError):
    """Recorded or foreign data cannot be read as what it claims to be.

    Example scenarios: a truncated RAW file, NaN in a case's ``simulated`` column, a journal cut in the middle.
    """

    exit_code = 65


class ClockError(LabdaqError):
    """The clock's uncertainty is larger than the script allows.

    Example scenario: no time server was reached since the station was switched on.
    """

    exit_code = 75


class StorageError(LabdaqError):
    """Writing or syncing failed; what was acknowledged before stays readable.

    Example scenarios: the disk is full, the medium was pulled.
    """

    exit_code = 74


class RunError(LabdaqError):
    """A test could not be finished; the session on disk says how far it came.

    Example scenarios: the goniophotometer raised an alarm, the operator pressed Ctrl-C.
    """

    exit_code = 1


class SimulationError(LabdaqError):
    """A simulation engine failed or gave out more light than came in."""

    exit_code = 70


@dataclass(frozen=True, slots=True)
class Exchange:
    """The last conversation with an instrument, for the error message and the journal."""

    sent: bytes = b""
    received: bytes = b""
    elapsed_s: float | None = None

    def __str__(self) -> str:
        sent = f"sent {self.sent!r}" if self.sent else "sent nothing"
        received = f"received {self.received!r}" if self.received else "received nothing"
        after = "" if self.elapsed_s is None else f" after {self.elapsed_s:.2f} s"
        return f"{sent}, {received}{after}"


@dataclass(frozen=True, slots=True)
class Place:
    """Where an instrument is reached: its name in the station file and its port."""

    instrument: str
    port: str

    def __str__(self) -> str:
        return f"{self.instrument} on {self.port}"


class DeviceError(LabdaqError):
    """An instrument failed; carries what happened, where it is and the last exchange with it."""

    exit_code = 69

    def __init__(self, message: str, *, place: Place, exchange: Exchange | None = None, hint: str = "") -> None:
        self.what = message
        self.place = place
        self.exchange = exchange or Exchange()
        text = f"{place}: {message}"
        if exchange is not None:
            text += f" ({exchange})"
        super().__init__(text, hint)


class ConnectError(DeviceError):
    """The port could not be opened, or the right instrument does not answer there.

    Example scenarios: cable unplugged, another program holds the port, LS-110 not switched on with F held.
    """


class DeviceTimeout(DeviceError, TimeoutError):
    """No complete answer came within the instrument's own worst case.

    Example scenarios: the meter left remote mode, the motor drive lost power, a frame with a wrong check sum.
    """


class ProtocolError(DeviceError):
    """The answer breaks the protocol: length, check sum, echo, letters or number are wrong.

    Example scenarios: wrong parity setting, two masters on one RS-485 line, line noise.
    """


class RefusedError(DeviceError):
    """The instrument answered properly and said no.

    Example scenarios: LS-110 ``ER30`` battery exhausted, Modbus exception 02, PTP AccessDenied, an axis alarm.
    """


@dataclass
class Problems:
    """Collects all mistakes of an input before it is refused once.

    Attributes
    ----------
    source
        The file the mistakes are in; starts each line of the final message.
    """

    source: str
    found: list[str] = field(default_factory=list)

    def add(self, where: str, what: str) -> None:
        """Note one mistake: ``where`` names the line, field or row."""
        self.found.append(f"{self.source}: {where}: {what}")

    def raise_if_any(self, error: type[LabdaqError], hint: str = "") -> None:
        """Raise ``error`` with one line per mistake, or return when there is none."""
        if self.found:
            raise error("\n".join(self.found), hint)
