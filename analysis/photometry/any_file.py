"""A distribution from a file of any form that is read here, by the suffix of its name."""

from pathlib import Path
from typing import Final

from analysis.photometry.distribution import Distribution

OTHER_SUFFIXES: Final = (".ldt", ".csv", ".txt", ".tsv")
"""Suffixes of what is not LM-63."""

_LM63_NAMES: Final = {"LAB": "TESTLAB", "DATE": "ISSUEDATE"}


def read_distribution(path: Path) -> Distribution:
    """Read LM-63 (``.ies``), EULUMDAT (``.ldt``) or a candela table (``.csv``, ``.txt``, ``.tsv``).

    Keywords get LM-63's names. Files of other names are taken for LM-63. Raises `DataError` naming file, line and why.
    """
    suffix = path.suffix.lower()
    if suffix == ".ldt":
        from analysis.photometry.eulumdat import read_eulumdat

        found = read_eulumdat(path).distribution
        named = {_LM63_NAMES.get(key, key): value for key, value in found.keywords.items()}
        return Distribution(found.gamma_deg, found.c_deg, found.candela, named)
    if suffix in (".csv", ".txt", ".tsv"):
        from analysis.photometry.candela_table import read_candela_table

        return read_candela_table(path)
    from analysis.photometry.lm63 import read_lm63

    return read_lm63(path).distribution
