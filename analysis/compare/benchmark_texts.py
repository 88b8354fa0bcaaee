"""The words of a benchmark: its README, which must be enough to use it without labdaq, and its licence."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from analysis.compare.benchmark_columns import COLUMNS, there
from labdaq.errors import ConfigError

_KNOWN: Final = {
    "CC0-1.0": ("Creative Commons Zero 1.0 Universal", "https://creativecommons.org/publicdomain/zero/1.0/legalcode"),
    "CC-BY-4.0": (
        "Creative Commons Attribution 4.0 International",
        "https://creativecommons.org/licenses/by/4.0/legalcode",
    ),
    "CC-BY-SA-4.0": (
        "Creative Commons Attribution-ShareAlike 4.0 International",
        "https://creativecommons.org/licenses/by-sa/4.0/legalcode",
    ),
    "ODbL-1.0": ("Open Data Commons Open Database License 1.0", "https://opendatacommons.org/licenses/odbl/1-0/"),
}
LICENCES: Final = tuple(_KNOWN)


@dataclass(frozen=True)
class Licence:
    """What others may do with the data: an SPDX identifier of an open licence, and who grants it."""

    spdx: str = "CC-BY-4.0"
    holder: str = ""

    def __post_init__(self) -> None:
        if self.spdx not in _KNOWN:
            raise ConfigError(f"{self.spdx}: is not a licence for open data known here", f"use {', '.join(_KNOWN)}")

    def text(self) -> str:
        """Content of LICENCE.txt."""
        name, where = _KNOWN[self.spdx]
        holder = f"Granted by: {self.holder}\n" if self.holder else ""
        return (
            f"The data in this folder may be used under the terms of\n\n    {name}\n    {where}\n\n"
            f"SPDX-License-Identifier: {self.spdx}\n{holder}"
        )


_TOP: Final = """\
WHAT THIS IS

Recordings of skylights under a real or emulated sky, beside what simulations predict for the same readings, for
checking daylight simulations. Everything is plain text (CSV, TOML, IES LM-63), pictures excepted (Radiance .hdr, camera
files).

CONVENTIONS

Times are UTC (ISO 8601). Angles are degrees. Illuminance is in lx, luminous intensity in cd, luminance in cd/m2,
lengths in m, unless a column or file says otherwise. Azimuth runs from north (0) through east (90).
Photometry is of type C: gamma = 0 at nadir, 90 at the horizon; C = 0 towards north, 90 west, 180 south, 270 east,
which is counter-clockwise seen from above. A place in the sky is given the same way: the zenith is gamma = 180, and C
is 360 minus its azimuth. CSV files have one line of column names; an empty field is a missing value; the decimal sign
is a point.
"""
_FILES: Final = {
    "benchmark.toml": "what the folder holds",
    "LICENCE.txt": "what may be done with it",
    "MANIFEST.sha256": "check sums of all files: sha256sum -c MANIFEST.sha256",
    "tests.csv": "one line for each test of a case and of a session, with the files that belong to it",
    "columns.csv": "every column of every CSV file, with unit and meaning",
    "systems/": "the skylights, as simulations assumed them (TOML)",
    "cases/": "recorded beside predicted readings: case.toml (the set-up), records.csv, simulated/*.ies",
    "photometry/": "recorded intensities of the tests of cases as IES LM-63-2019 files",
    "sessions/": "recordings: session.toml, readings.csv, exposures.csv, derived/ (sky maps, photometry), original/",
}
_IES: Final = """\
ABOUT THE .IES FILES

Absolute photometry (-1 lumens). Files in photometry/ hold intensity = illuminance x distance^2 at one finite distance
(the keyword [_DISTANCE]); they are near-field data and hold at that distance. Gamma 90 is zero by definition, not
measured (keyword [_ROW90]). [_PART] tells whether a simulated file is the sun part, the sky part or both.
"""


def readme(title: str, licence: Licence, names: Sequence[str]) -> str:
    """Text of README.txt for a folder that holds ``names``."""
    every = [*names, "MANIFEST.sha256"]
    parts = [f"{title.upper()}\n{'=' * len(title)}\n", _TOP, "FILES\n"]
    parts += [f"  {name:<16} {what}" for name, what in _FILES.items() if any(n.startswith(name) for n in every)]
    for file, columns in COLUMNS.items():
        if there(file, names):
            parts.append(f"\nCOLUMNS OF {file}\n")
            parts += [f"  {name} [{unit}]: {what}" for name, unit, what in columns]
    if any(n.endswith(".ies") for n in names):
        parts.append(f"\n{_IES}")
    parts.append(f"\nLICENCE\n\n{licence.text()}")
    return "\n".join(parts)
