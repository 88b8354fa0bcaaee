"""What an IES LM-63 file says, apart from the candelas.

Sources: the header of Radiance's ``ies2rad.c`` (R. Fritz 2018, who read the five editions), the record layout in the
AGi32 and Photometric Toolbox manuals, and the scope and definitions of ANSI/IESNA LM-63-2002.
"""

from dataclasses import dataclass, field
from enum import Enum, StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.distribution import Distribution
from analysis.photometry.goniometry import PhotometricType

Floats = NDArray[np.float64]

REQUIRED_KEYWORDS = ("TEST", "TESTLAB", "ISSUEDATE", "MANUFAC")
"""Without these a 2002 file breaks its standard; we ask for them in 2019 files too."""

_KEYWORDS = """
TEST TESTLAB TESTDATE ISSUEDATE NEARFIELD MANUFAC LUMCAT LUMINAIRE LAMPCAT LAMP BALLASTCAT BALLAST MAINTCAT
DISTRIBUTION FLASHAREA COLORCONSTANT LAMPPOSITION OTHER SEARCH MORE BLOCK ENDBLOCK DATE TESTMETHOD
"""
STANDARD_KEYWORDS = frozenset(_KEYWORDS.split())
"""Keywords of the editions from 1991 on, as far as they are publicly listed; a user's own begin with ``_``."""


class Edition(Enum):
    """An edition of LM-63; its value is the first line of the file (1986 has none)."""

    E1986 = ""
    E1991 = "IESNA91"
    E1995 = "IESNA:LM-63-1995"
    E2002 = "IESNA:LM-63-2002"
    E2019 = "IES:LM-63-2019"

    @property
    def year(self) -> int:
        """Year of publication."""
        return int(self.name[1:])


class FileGeneration(StrEnum):
    """How the candelas came about: the bit string of LM-63-2019, table 2, always written with five decimals.

    Digits after the point: accredited laboratory, interpolated angles, lumen scaled, computer simulation, undefined.
    """

    UNDEFINED = "1.00001"
    SIMULATED = "1.00010"
    MEASURED = "1.00000"
    MEASURED_SCALED = "1.00100"
    MEASURED_INTERPOLATED = "1.01000"
    MEASURED_INTERPOLATED_SCALED = "1.01100"
    ACCREDITED = "1.10000"
    ACCREDITED_SCALED = "1.10100"
    ACCREDITED_INTERPOLATED = "1.11000"
    ACCREDITED_INTERPOLATED_SCALED = "1.11100"

    @classmethod
    def measured(
        cls, *, accredited: bool = False, interpolated: bool = False, scaled: bool = False
    ) -> "FileGeneration":
        """The type of a measured file; ``interpolated`` also covers angles that were filled in."""
        return cls(f"1.{int(accredited)}{int(interpolated)}{int(scaled)}00")


@dataclass(frozen=True, slots=True)
class Oddity:
    """Something a lenient reader stepped over.

    Attributes
    ----------
    line
        Line number in the file, from 1.
    what
        What is unusual there, and how it was read.
    """

    line: int
    what: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.what}"


@dataclass(frozen=True)
class Tilt:
    """How lamp output varies with the tilt of the luminaire; never applied to the candelas, which are for no tilt.

    Attributes
    ----------
    source
        ``NONE``, ``INCLUDE``, or the name of the file that holds the factors (not read; not allowed from 2019 on).
    lamp_geometry
        1 lamp vertical base up or down, 2 lamp horizontal and fixed in the luminaire, 3 lamp horizontal always.
    angle_deg, factor : shape (n,)
        Tilt angles [deg] and the factors that belong to them.
    """

    source: str = "NONE"
    lamp_geometry: int = 1
    angle_deg: Floats = field(default_factory=lambda: np.empty(0))
    factor: Floats = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True)
class Opening:
    """Size of the luminous opening [m]; negative numbers mark round shapes, as the standard does.

    ``width_m`` runs across the C = 0 plane, ``length_m`` along it, ``height_m`` up.
    """

    width_m: float = 0.0
    length_m: float = 0.0
    height_m: float = 0.0

    @classmethod
    def disc(cls, diameter_m: float) -> "Opening":
        """A flat round opening (equal negative width and length)."""
        return cls(-diameter_m, -diameter_m, 0.0)


NO_TILT: Final = Tilt()
POINT: Final = Opening()


@dataclass(frozen=True)
class Table:
    """The numbers as they stand in the file, before multiplying, unfolding and turning.

    Attributes
    ----------
    photometric_type
        C, B or A.
    vertical_deg : shape (V,), horizontal_deg : shape (H,) [deg]
        Angles as written.
    values : shape (H, V)
        Candelas before the multiplier and the ballast factor.
    """

    photometric_type: PhotometricType
    vertical_deg: Floats
    horizontal_deg: Floats
    values: Floats


@dataclass(frozen=True)
class Lm63:
    """One LM-63 file.

    Attributes
    ----------
    distribution
        Type C, unfolded to C = 0..360 and multiplied out [cd]; its ``keywords`` are the file's, without brackets;
        lines of a repeated keyword or of ``[MORE]`` are joined by line feeds.
    edition
        Which standard the first line names.
    labels
        Header lines that are not keywords (all of them in a 1986 file).
    lamps, lumens_per_lamp
        ``None`` lumens: absolute photometry (-1 in the file).
    multiplier, ballast_factor, ballast_lamp_factor
        Already contained in ``distribution``. The last exists in 1986 and 1991 files only, else 1.
    generation
        ``None`` when the file does not say (all editions before 2019).
    watts
        Input power [W].
    oddities
        What the reader stepped over; empty for a clean file.
    """

    distribution: Distribution
    table: Table
    edition: Edition = Edition.E2019
    labels: tuple[str, ...] = ()
    lamps: int = 1
    lumens_per_lamp: float | None = None
    multiplier: float = 1.0
    ballast_factor: float = 1.0
    ballast_lamp_factor: float = 1.0
    generation: FileGeneration | None = None
    watts: float = 0.0
    opening: Opening = POINT
    tilt: Tilt = NO_TILT
    oddities: tuple[Oddity, ...] = ()
