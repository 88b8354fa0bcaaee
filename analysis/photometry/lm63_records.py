"""The records after the TILT line of an LM-63 file, turned into a distribution."""

from typing import Final

import numpy as np

from analysis.photometry.distribution import Distribution
from analysis.photometry.goniometry import PhotometricType, from_type
from analysis.photometry.lm63_header import Header
from analysis.photometry.lm63_layout import check_angles, check_layout
from analysis.photometry.lm63_model import Edition, FileGeneration, Lm63, Oddity, Opening, Table, Tilt
from analysis.photometry.lm63_numbers import Numbers
from analysis.photometry.unfold import UnfoldError, unfold_ab, unfold_c

METRES_PER_FOOT: Final = 0.3048
COUNTS: Final = 13
"""Numbers in the two records before the angles."""
TILT_HEAD: Final = 2
"""Numbers before the angles and factors of TILT=INCLUDE."""


class Records:
    """Walks through the records; see `read`."""

    def __init__(self, header: Header, numbers: Numbers, oddities: list[Oddity], tilt_line: int) -> None:
        self.header = header
        self.numbers = numbers
        self.oddities = oddities + header.oddities
        self.tilt_line = tilt_line

    def odd(self, index: int, what: str) -> None:
        """Note an oddity at number ``index``."""
        self.oddities.append(Oddity(self.numbers.line(index), what))

    def read(self, tilt_text: str) -> Lm63:
        """Read everything; raises `DataError` with line and reason."""
        n, values = self.numbers, self.numbers.values
        tilt, at = self._tilt(tilt_text)
        n.need(at + COUNTS, "lamp and ballast records")
        lamps = n.whole(at, "number of lamps")
        n_v, n_h = n.whole(at + 3, "number of vertical angles"), n.whole(at + 4, "number of horizontal angles")
        self._check_total(at, n_v, n_h)
        for index, name in ((at + 2, "multiplier"), (at + 10, "ballast factor")):
            if values[index] <= 0:
                raise n.error(index, f"the {name} must be positive, not {n.token(index)}")
        generation, lamp_factor = self._field_12(at + 11)
        table = self._table(at, n_v, n_h)
        multiplier, ballast = float(values[at + 2]), float(values[at + 10])
        return Lm63(
            distribution=self._distribution(table, multiplier * ballast * lamp_factor, at + COUNTS),
            table=table,
            edition=self.header.edition,
            labels=tuple(self.header.labels),
            lamps=lamps,
            lumens_per_lamp=self._lumens(at + 1),
            multiplier=multiplier,
            ballast_factor=ballast,
            ballast_lamp_factor=lamp_factor,
            generation=generation,
            watts=float(values[at + 12]),
            opening=self._opening(at + 6),
            tilt=tilt,
            oddities=tuple(sorted(self.oddities, key=lambda oddity: oddity.line)),
        )

    def _tilt(self, text: str) -> tuple[Tilt, int]:
        """The tilt record, and the index of the number after it."""
        n = self.numbers
        word = text.upper()
        if word in ("NONE", ""):
            if not word:
                self.oddities.append(Oddity(self.tilt_line, "TILT= without a word, read as NONE"))
            return Tilt(), 0
        if word != "INCLUDE":
            self.oddities.append(
                Oddity(self.tilt_line, f"tilt factors are in another file ({text}), which is not read")
            )
            return Tilt(source=text), 0
        geometry, count = n.whole(0, "lamp geometry"), n.whole(1, "number of tilt angles")
        if count < 1:
            raise n.error(1, f"TILT=INCLUDE announces {count} angles")
        end = TILT_HEAD + 2 * count
        n.need(end, "tilt angles and factors")
        angles = n.values[TILT_HEAD : TILT_HEAD + count].copy()
        factors = n.values[TILT_HEAD + count : end].copy()
        if np.any(np.diff(angles) <= 0):
            raise n.error(TILT_HEAD, "the tilt angles do not increase")
        if np.any(factors < 0):
            raise n.error(TILT_HEAD + count, "a tilt factor is negative")
        return Tilt("INCLUDE", geometry, angles, factors), end

    def _check_total(self, at: int, n_v: int, n_h: int) -> None:
        """There must be exactly as many numbers as announced."""
        n = self.numbers
        if n_v < 2:
            raise n.error(at + 3, f"{n_v} vertical angle(s); at least two are needed")
        if n_h < 1:
            raise n.error(at + 4, f"{n_h} horizontal angles")
        total = at + COUNTS + n_v + n_h + n_v * n_h
        place = n.line(at + 3)
        n.need(total, f"{n_v} + {n_h} angles and {n_v} x {n_h} candelas announced on line {place}")
        extra = len(n.values) - total
        if extra:
            raise n.error(total, f"{extra} number(s) more than the {n_v} x {n_h} candelas announced on line {place}")
        if n.text_after:
            self.odd(total, "text after the last candela, not read")

    def _lumens(self, index: int) -> float | None:
        lumens = float(self.numbers.values[index])
        if lumens >= 0:
            return lumens
        if lumens != -1:
            self.odd(index, f"{lumens:g} lumens per lamp, read as -1 (absolute photometry)")
        return None

    def _field_12(self, index: int) -> tuple[FileGeneration | None, float]:
        """Ballast-lamp factor (1986, 1991), nothing (1995, 2002) or file generation type (2019)."""
        n, edition = self.numbers, self.header.edition
        value = float(n.values[index])
        if edition.year < 1995:
            if value <= 0:
                raise n.error(index, f"the ballast-lamp photometric factor must be positive, not {value:g}")
            return None, value
        if edition is not Edition.E2019:
            if value != 1:
                self.odd(index, f"the field for future use is {value:g} instead of 1; not used")
            return None, 1.0
        text = n.token(index)
        try:
            generation = FileGeneration(f"{value:.5f}")
        except ValueError:
            self.odd(index, f"{text} is no file generation type")
            return None, 1.0
        if text != generation:
            self.odd(index, f"file generation type written as {text} instead of {generation}")
        return generation, 1.0

    def _opening(self, index: int) -> Opening:
        """Units code and three dimensions."""
        unit = self.numbers.values[index]
        if unit not in (1, 2):
            raise self.numbers.error(index, f"the units must be 1 (feet) or 2 (metres), not {unit:g}")
        scale = METRES_PER_FOOT if unit == 1 else 1.0
        width, length, height = (float(x) * scale for x in self.numbers.values[index + 1 : index + 4])
        return Opening(width, length, height)

    def _table(self, at: int, n_v: int, n_h: int) -> Table:
        n = self.numbers
        code = n.values[at + 5]
        if code not in (1, 2, 3):
            raise n.error(at + 5, f"the photometric type must be 1 (C), 2 (B) or 3 (A), not {code:g}")
        kind = PhotometricType(int(code))
        first_v, first_h, first_cd = at + COUNTS, at + COUNTS + n_v, at + COUNTS + n_v + n_h
        vertical, horizontal = n.values[first_v:first_h].copy(), n.values[first_h:first_cd].copy()
        values = n.values[first_cd:].copy().reshape(n_h, n_v)
        for message in check_angles(n, kind, first_v, first_h, first_cd):
            self.odd(first_v, message)
        for index, message in check_layout(n, at, n_v, n_h):
            self.odd(index, message)
        negative = np.flatnonzero(values < 0)
        if negative.size:
            self.odd(first_cd + int(negative[0]), f"{negative.size} negative candela value(s), kept")
        return Table(kind, vertical, horizontal, values)

    def _distribution(self, table: Table, factor: float, first_v: int) -> Distribution:
        n = self.numbers
        first_h = first_v + len(table.vertical_deg)
        candela = table.values * factor
        try:
            if table.photometric_type is PhotometricType.C:
                c, candela, remark = unfold_c(table.horizontal_deg, candela)
                if remark:
                    self.odd(first_h, remark)
                elif not np.array_equal(candela[0], candela[-1]):
                    self.odd(first_h, "the planes C = 0 and C = 360 differ; both kept")
                return Distribution(table.vertical_deg, c, candela, dict(self.header.keywords))
            horizontal, candela = unfold_ab(table.horizontal_deg, candela)
        except UnfoldError as error:
            raise n.error(first_h, str(error)) from None
        turned = from_type(table.photometric_type, table.vertical_deg, horizontal, candela)
        return Distribution(turned.gamma_deg, turned.c_deg, turned.candela, dict(self.header.keywords))
