"""From a picture's codes to a signal proportional to exposure.

Raw files need none: their codes less black are linear. An 8-bit picture has been through the camera's tone curve, so
its response is either frozen (measured once for the camera and kept in a file, the better way), or recovered from the
stack itself (`analysis.hdr.recover`).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from labdaq.errors import DataError, Problems
from labdaq.whole_file import write_whole_bytes

Floats = NDArray[np.float64]

REFERENCE_CODE: Final = 128
"""Where the channels' curves are tied together: equal codes there mean equal signals."""


@dataclass(frozen=True, eq=False)
class Response:
    """Signal of each code.

    Attributes
    ----------
    curves : shape (3, 256)
        Signal of each code of red, green, blue: 0 at code 0, increasing, about 1 at code 255.
    kind
        ``linear``, ``srgb``, ``rsp``, ``recovered`` or ``file``.
    source
        Where it came from, in words.
    residual
        Root mean square misfit of the recovery (natural logarithm of exposure); ``None`` when not recovered here.
    """

    curves: Floats
    kind: str
    source: str
    residual: float | None = None

    def __post_init__(self) -> None:
        if self.curves.shape != (3, 256) or not np.all(np.isfinite(self.curves)):
            raise DataError(f"{self.source}: a response has 3 x 256 finite numbers, not {self.curves.shape}")
        for name, curve in zip(("red", "green", "blue"), self.curves, strict=True):
            falls = np.flatnonzero(np.diff(curve) <= 0.0)
            if len(falls):
                raise DataError(
                    f"{self.source}: the {name} response does not grow between codes {falls[0]} and {falls[0] + 1}"
                )

    @classmethod
    def linear(cls) -> Self:
        """Codes proportional to exposure."""
        return cls(np.tile(np.arange(256) / 255.0, (3, 1)), "linear", "linear")

    @classmethod
    def srgb(cls) -> Self:
        """The curve of IEC 61966-2-1 undone; cameras follow it loosely, so this is a guess for real pictures."""
        return cls(np.tile(srgb_signal(np.arange(256) / 255.0), (3, 1)), "srgb", "sRGB (IEC 61966-2-1)")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a response kept by `save`, or a polynomial one (.rsp) as Photosphere and hdrgen keep it.

        Raises `DataError` when the file is neither, or its curve is not increasing.
        """
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise DataError(f"{path}: cannot be read as a response: {error}") from error
        if text.lstrip().startswith("{"):
            try:
                kept = json.loads(text)
                return cls(np.asarray(kept["curves"], dtype=np.float64), "file", f"{path.name}: {kept['source']}")
            except (ValueError, KeyError, TypeError) as error:
                raise DataError(f"{path}: not a response: {error}") from error
        return cls(_polynomials(text, path), "rsp", path.name)

    def table(self, bits: int) -> Floats:
        """Signals (3, 2^bits) of the codes of a picture of 8 or 16 bits.

        Raises `DataError` for 16 bits, unless the response is ``linear`` or ``srgb``.
        """
        if bits == 8:
            return self.curves
        value = np.arange(2**bits) / (2.0**bits - 1.0)
        if self.kind == "linear":
            return np.tile(value, (3, 1))
        if self.kind == "srgb":
            return np.tile(srgb_signal(value), (3, 1))
        raise DataError(
            f"the response '{self.source}' is one of 8 bits, the pictures have {bits}",
            "say linear or srgb, whichever their developing program wrote",
        )

    def save(self, path: Path) -> None:
        """Write the curves as JSON, to be used frozen from now on."""
        kept = {"source": self.source, "residual": self.residual, "curves": self.curves.tolist()}
        write_whole_bytes(path, json.dumps(kept).encode())


def srgb_signal(value: Floats) -> Floats:
    """Linear light of an sRGB value in [0, 1] (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _polynomials(text: str, path: Path) -> Floats:
    """Curves of a .rsp text: a line a channel, the degree and then the coefficients from the highest power down."""
    problems = Problems(str(path))
    lines = [line.split() for line in text.splitlines() if line.strip()]
    curves = []
    for number, words in enumerate(lines, 1):
        coefficients = _numbers(words)
        if coefficients is None or len(coefficients) < 2 or len(coefficients) != int(coefficients[0]) + 2:
            problems.add(f"line {number}", "should hold the degree of a polynomial and one coefficient more than that")
            continue
        curve = np.polyval(coefficients[1:], np.arange(256) / 255.0)
        curves.append(_from_zero(np.asarray(curve, dtype=np.float64)))
    if not problems.found and len(curves) not in (1, 3):
        problems.add("end", f"a response has one line, or one for each of red, green and blue, not {len(curves)}")
    problems.raise_if_any(DataError, "give a .rsp file of Photosphere or hdrgen, or one kept by labdaq")
    return np.array(curves * 3 if len(curves) == 1 else curves)


def _numbers(words: Sequence[str]) -> list[float] | None:
    try:
        return [float(word) for word in words]
    except ValueError:
        return None


def _from_zero(curve: Floats) -> Floats:
    """The curve with its foot bent to 0: polynomial fits start a little above or below it, or dip on the way.

    Below the last code at which the polynomial is not positive and rising, the signal is proportional to the code.
    """
    rising = np.diff(curve, prepend=-np.inf) > 0.0
    bad = np.flatnonzero(~rising[:64] | (curve[:64] <= 0.0))
    start = max(4, int(bad[-1]) + 2 if len(bad) else 0)
    bent = curve.copy()
    bent[: start + 1] = curve[start] * np.arange(start + 1) / start
    return bent
