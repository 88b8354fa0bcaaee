"""What a Modbus unit can be asked, in words and bits; the wire code knows how to ask."""

from typing import Final, Protocol

ILLEGAL_FUNCTION: Final = 1
ILLEGAL_ADDRESS: Final = 2
ILLEGAL_VALUE: Final = 3
DEVICE_FAILURE: Final = 4
BUSY: Final = 6
BAD_CRC: Final = 8  # the drive's own use of the code
NO_SUCH_DEVICE: Final = 0x0B  # from a gateway


class Refusal(Exception):
    """A unit refuses a request with a Modbus exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code:02X}")
        self.code = code


class Unit(Protocol):
    """One device on the line.

    Attributes
    ----------
    functions
        Function codes it knows.
    turnaround_s
        Time from request to reply [s].
    answers_bad_crc
        Whether it answers a frame with a wrong check sum (exception 08) instead of keeping silent.
    """

    functions: frozenset[int]
    turnaround_s: float
    answers_bad_crc: bool

    @property
    def answering(self) -> bool:
        """Whether it has power and has finished starting."""
        ...

    def read_bits(self, address: int, count: int) -> list[bool]:
        """Coils or discrete inputs; raises `Refusal`."""
        ...

    def read_words(self, address: int, count: int, *, inputs: bool) -> list[int]:
        """Input registers (``inputs``) or holding registers, 0 to 65535 each; raises `Refusal`."""
        ...

    def write_bits(self, address: int, values: list[bool]) -> None:
        """Set coils; raises `Refusal`, and then nothing is changed."""
        ...

    def write_words(self, address: int, values: list[int]) -> None:
        """Set holding registers; raises `Refusal`, and then nothing is changed."""
        ...
