"""Read EULUMDAT (.ldt) files; see `eulumdat_write` for the other way.

The order of lines is A. Stockmar's (Licht '90, Berlin 1990, p. 641), as many public descriptions give it: one value a
line, intensities in cd per 1000 lm of lamp flux. C-planes mean the same as ours: nothing is turned.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63_model import POINT, Oddity, Opening
from labdaq.errors import DataError

Floats = NDArray[np.float64]

_DIRECT_RATIOS: Final = 10
_LAMP_LINES: Final = 6
_TOO_MANY: Final = 20  # lamp sets
_RATIO_OFF: Final = 0.05
"""A light output ratio that is off by this share of itself is told of. (Of 20 real files' none is by more than 0.022:
they were integrated otherwise.)"""


@dataclass(frozen=True)
class Eulumdat:
    """One EULUMDAT file.

    Attributes
    ----------
    distribution
        Intensity [cd] for the first lamp set, unfolded to C = 0..360; keywords LAB, TEST, LUMINAIRE, LUMCAT and DATE
        come from lines 1, 8, 9, 10 and 12.
    symmetry
        The file's Isym: 0 none, 1 about the vertical axis, 2 to the plane C 0-180, 3 to C 90-270, 4 to both.
    flux_lm
        Total flux of the first lamp set [lm].
    absolute
        Whether the lamp count is negative: then ``flux_lm`` is the luminaire's own.
    watts
        Power of the first lamp set [W].
    opening
        Luminous area [m].
    oddities
        What the reader stepped over, by line.
    """

    distribution: Distribution
    symmetry: int
    flux_lm: float
    absolute: bool
    watts: float
    opening: Opening = POINT
    oddities: tuple[Oddity, ...] = ()


def read_eulumdat(path: Path | str) -> Eulumdat:
    """Read an EULUMDAT file; raises `DataError` naming the line and the reason."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    return parse_eulumdat(data, str(path))


def parse_eulumdat(data: bytes, source: str = "EULUMDAT data") -> Eulumdat:
    """Read EULUMDAT from memory; ``source`` names it in messages. Raises `DataError`."""
    return _Reader(data, source).read()


class _Reader:
    """Walks down the lines; every number is checked where it stands."""

    def __init__(self, data: bytes, source: str) -> None:
        self.source = source
        self.oddities: list[Oddity] = []
        if b"\0" in data:
            raise DataError(
                f"{source}: line {data[: data.index(0)].count(10) + 1}: a zero byte; this is not a text file"
            )
        if data.startswith(b"\xef\xbb\xbf"):
            data = data[3:]
            self.oddities.append(Oddity(1, "the file starts with a UTF-8 byte order mark"))
        self.lines = [line.decode("latin-1").strip() for line in data.splitlines()]
        while self.lines and self.lines[-1] in ("", "\x1a"):
            self.lines.pop()
        if not self.lines:
            raise DataError(f"{source}: the file is empty", "is this an EULUMDAT (.ldt) file?")
        self.at = 0
        self.commas = 0

    def error(self, line: int, what: str) -> DataError:
        return DataError(f"{self.source}: line {line}: {what}")

    def text(self, what: str) -> str:
        if self.at >= len(self.lines):
            raise self.error(len(self.lines), f"the file ends here, before the {what}")
        self.at += 1
        return self.lines[self.at - 1]

    def number(self, what: str) -> float:
        text = self.text(what)
        if "," in text and not self.commas:
            self.commas = self.at
        try:
            value = float(text.replace(",", "."))
        except ValueError:
            raise self.error(self.at, f"{text!r} is not a number ({what} expected)") from None
        if not np.isfinite(value) or "_" in text:
            raise self.error(self.at, f"{text!r} is not a plain number ({what} expected)")
        return value

    def whole(self, what: str, low: int, high: int) -> int:
        value = self.number(what)
        if value != int(value) or not low <= value <= high:
            raise self.error(self.at, f"the {what} must be a whole number from {low} to {high}, not {value:g}")
        return int(value)

    def numbers(self, count: int, what: str) -> Floats:
        return np.array([self.number(what) for _ in range(count)])

    def angles(self, count: int, what: str) -> Floats:
        start = self.at
        values = self.numbers(count, what)
        fallen = np.flatnonzero(np.diff(values) <= 0)
        if fallen.size:
            raise self.error(start + int(fallen[0]) + 2, f"the {what}s do not increase")
        return values

    def read(self) -> Eulumdat:
        keywords = {"LAB": self.text("identification")}
        self.whole("type indicator", 0, 3)
        symmetry = self.whole("symmetry indicator", 0, 4)
        n_c = self.whole("number of C-planes", 1, 721)
        step_c = self.number("distance of C-planes")
        n_g = self.whole("number of gammas", 2, 361)
        step_g = self.number("distance of gammas")
        for key in ("TEST", "LUMINAIRE", "LUMCAT", "", "DATE"):
            keywords[key] = self.text(key.lower() or "file name")
        del keywords[""]
        self.numbers(3, "luminaire size")
        opening = self._opening()
        self.number("downward flux fraction")
        ratio = self.number("light output ratio"), self.at
        conversion = self.number("conversion factor")
        if conversion <= 0:
            raise self.error(self.at, f"the conversion factor must be positive, not {conversion:g}")
        self.number("tilt")
        flux, absolute, watts = self._lamps()
        self.numbers(_DIRECT_RATIOS, "direct ratio")
        first_c = self.at
        c = self.angles(n_c, "C angle")
        gamma = self.angles(n_g, "gamma angle")
        self._check_steps(first_c, c, step_c, gamma, step_g)
        table = self._table(symmetry, c, n_g) * (flux / 1000.0 * conversion)
        if self.at < len(self.lines):
            raise self.error(self.at + 1, f"{len(self.lines) - self.at} line(s) more than announced")
        if self.commas:
            self.oddities.append(Oddity(self.commas, "decimal commas"))
        planes_c, planes = _unfold(symmetry, c, table)
        words = {key: value for key, value in keywords.items() if value}
        made = Distribution(gamma, planes_c, planes, words)
        self._check_ratio(*ratio, 100.0 * made.flux() / flux)
        return Eulumdat(made, symmetry, flux, absolute, watts, opening, tuple(self.oddities))

    def _check_ratio(self, told: float, line: int, found: float) -> None:
        """Compare the light output ratio [%] with that of the intensities; 0 says that nobody worked it out."""
        if told > 0.0 and abs(found - told) > _RATIO_OFF * told:
            what = f"the light output ratio is {told:g} %, and the intensities hold {found:.4g} % of the lamp flux"
            self.oddities.append(Oddity(line, what))

    def _opening(self) -> Opening:
        """Luminous area: length or diameter, width (0 for round) and the mean of four heights, all in mm."""
        length, width = self.number("luminous length") / 1000.0, self.number("luminous width") / 1000.0
        height = float(self.numbers(4, "luminous height").mean()) / 1000.0
        return Opening(-length, -length, height) if width == 0 and length > 0 else Opening(width, length, height)

    def _lamps(self) -> tuple[float, bool, float]:
        """Flux [lm], whether it is the luminaire's own, and power [W] of the first set."""
        sets = self.whole("number of lamp sets", 1, _TOO_MANY)
        first = self.at
        count = self.whole("number of lamps", -9999, 9999)
        self.text("lamp type")
        flux = self.number("total lamp flux")
        if flux <= 0:
            raise self.error(self.at, f"the total lamp flux must be positive, not {flux:g}")
        self.text("colour")
        self.text("colour rendering")
        watts = self.number("lamp power")
        if sets > 1:
            self.oddities.append(Oddity(first, f"{sets} lamp sets; intensities are for the first"))
            for _ in range((sets - 1) * _LAMP_LINES):
                self.text("next lamp set")
        return flux, count < 0, watts

    def _check_steps(self, line: int, c: Floats, step_c: float, gamma: Floats, step_g: float) -> None:
        if gamma[0] < 0 or gamma[-1] > 180:
            raise self.error(self.at, f"gammas run from {gamma[0]:g} to {gamma[-1]:g}, not within 0..180")
        if c[0] != 0 or c[-1] > 360:
            raise self.error(line + 1, f"C angles run from {c[0]:g} to {c[-1]:g}, not from 0 to 360")
        for name, angles, step, place in (("C", c, step_c, 5), ("gamma", gamma, step_g, 7)):
            even = len(angles) < 2 or np.allclose(np.diff(angles), step, atol=1e-3)
            if step != 0 and not even:
                self.oddities.append(Oddity(place, f"{name} angles are not {step:g} apart; the listed angles are used"))

    def _table(self, symmetry: int, c: Floats, n_g: int) -> Floats:
        n_c = len(c)
        stored = {0: n_c, 1: 1, 2: n_c // 2 + 1, 3: n_c // 2 + 1, 4: n_c // 4 + 1}[symmetry]
        if (symmetry in (2, 3) and n_c % 2) or (symmetry == 4 and n_c % 4):
            raise self.error(4, f"{n_c} C-planes do not go with symmetry {symmetry}")
        ends = {2: ((n_c // 2, 180.0),), 3: ((n_c // 4, 90.0), (3 * n_c // 4, 270.0)), 4: ((n_c // 4, 90.0),)}
        for index, angle in ends.get(symmetry, ()):
            if n_c < 4 and symmetry == 3:
                raise self.error(4, f"{n_c} C-planes do not go with symmetry 3")
            if c[index] != angle:
                raise self.error(
                    4, f"with symmetry {symmetry}, C-plane {index + 1} must be {angle:g}, not {c[index]:g}"
                )
        first = self.at
        values = self.numbers(stored * n_g, "intensity")
        negative = np.flatnonzero(values < 0)
        if negative.size:
            line = first + int(negative[0]) + 1
            self.oddities.append(Oddity(line, f"{negative.size} negative intensity value(s), kept"))
        return values.reshape(stored, n_g)


def _unfold(symmetry: int, c: Floats, table: Floats) -> tuple[Floats, Floats]:
    """All planes from 0 to 360, both included."""
    n = len(c)
    if symmetry == 1:
        return np.array([0.0, 360.0]), np.repeat(table, 2, axis=0)
    if symmetry == 0:
        rows = np.arange(n)
    elif symmetry == 2:
        rows = np.minimum(np.arange(n), n - np.arange(n))
    elif symmetry == 4:
        half = np.minimum(np.arange(n), n - np.arange(n))
        rows = np.minimum(half, n // 2 - half)
    else:  # stored from C = 270 through 0 to 90; C and 180 - C are alike
        k = (np.arange(n) - 3 * n // 4) % n
        rows = np.where(k <= n // 2, k, n - k)
    full = table[rows]
    if c[-1] == 360.0:
        return c, full
    return np.append(c, 360.0), np.concatenate([full, full[:1]])
