"""A serial port: opened and configured by pyserial, awaited by asyncio through its file descriptor.

Pseudo-terminals (emulators) carry no parity and always eight bits: the kernel drops both wishes, and glibc reports
that as EINVAL when nothing else changed (Linux 6.18, glibc 2.36). So a port under ``/dev/pts`` is opened with 8N and
the wished speed and stop bits, and no port is configured a second time. The wish itself stays readable in
`SerialTransport.settings`.
"""

import os
import termios
from dataclasses import dataclass, replace
from errno import EACCES, EAGAIN, EBUSY, ENOENT
from pathlib import Path
from typing import Final

import serial

from drivers.transport import CHUNK, DescriptorTransport
from labdaq.errors import ConnectError, Place


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """How a line is set.

    Attributes
    ----------
    baudrate
        Speed [bit/s].
    bytesize
        Data bits, 7 or 8.
    parity
        ``N``, ``E`` or ``O``.
    stopbits
        1 or 2.
    """

    baudrate: int
    bytesize: int = 8
    parity: str = "N"
    stopbits: int = 1

    def __str__(self) -> str:
        return f"{self.baudrate} {self.bytesize}{self.parity}{self.stopbits}"

    @property
    def character_s(self) -> float:
        """Time one character takes on the wire [s]: start bit, data, parity, stop bits."""
        return (1 + self.bytesize + (self.parity != "N") + self.stopbits) / self.baudrate


def is_pseudo_terminal(port: str) -> bool:
    """Whether ``port`` (or what it is a link to) is a pseudo-terminal."""
    return Path(port).resolve().is_relative_to("/dev/pts")


def possible_settings(port: str, wish: SerialSettings) -> SerialSettings:
    """Return what ``port`` can be opened with: the wish, or 8N at the same speed on a pseudo-terminal."""
    return replace(wish, bytesize=8, parity="N") if is_pseudo_terminal(port) else wish


class SerialTransport(DescriptorTransport):
    """A serial port that nobody else may open meanwhile.

    RTS and DTR are asserted on opening, which the LS-110 needs before it sends. A character received with wrong
    parity is read as NUL, which no codec here accepts, so the line it stands in is void.

    Attributes
    ----------
    settings
        The settings that were asked for (a pseudo-terminal cannot carry all of them).
    """

    def __init__(self, instrument: str, port: str, settings: SerialSettings) -> None:
        super().__init__(Place(instrument, port))
        self.settings: Final = settings
        self._port: serial.Serial | None = None

    async def open(self) -> None:
        """Open and configure the port once; raises `ConnectError` saying why it cannot be had."""
        if self._port is not None:
            return
        actual = possible_settings(self.place.port, self.settings)
        try:
            self._port = serial.Serial(
                port=self.place.port,
                baudrate=actual.baudrate,
                bytesize=actual.bytesize,
                parity=actual.parity,
                stopbits=actual.stopbits,
                timeout=0,
                write_timeout=0,
                exclusive=True,
            )
            _complete_settings(self._port.fileno())
        except (OSError, ValueError, termios.error) as error:
            self._release()
            raise self._cannot_open(error) from error
        self._buffer.clear()

    async def aclose(self) -> None:
        """Close the port and let others have it."""
        self._release()

    def _descriptor(self) -> int:
        if self._port is None:
            raise self._gone("the port is not open")
        return int(self._port.fileno())

    def _read_now(self) -> bytes:
        return os.read(self._descriptor(), CHUNK)

    def _write_now(self, data: bytes) -> int:
        return os.write(self._descriptor(), data)

    def _release(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def _cannot_open(self, error: Exception) -> ConnectError:
        code = getattr(error, "errno", None) or (error.args[0] if error.args else None)
        why, hint = {
            ENOENT: ("there is no such port", "plug the cable in; `ls -l /dev/serial/by-id` shows what is there"),
            EACCES: ("you may not open this port", "add the user to the group of the port: usermod -aG dialout USER"),
            EAGAIN: ("another program holds the port", "end the other program; `fuser -v PORT` names it"),
            EBUSY: ("another program holds the port", "end the other program; `fuser -v PORT` names it"),
        }.get(code or 0, (f"cannot be opened with {self.settings}: {error}", "check that the port is a serial port"))
        return ConnectError(why, place=self.place, hint=hint)


def _complete_settings(descriptor: int) -> None:
    """Set what pyserial leaves out; called once, right after opening.

    The kernel shall check parity, not only generate it. And reading an idle line shall say that there is nothing
    yet: with pyserial's VMIN = 0 it returns no bytes, which looks as if the line were gone.
    """
    attributes = termios.tcgetattr(descriptor)
    attributes[0] = (attributes[0] | termios.INPCK) & ~(termios.IGNPAR | termios.PARMRK)
    attributes[6][termios.VMIN] = 1
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
