"""Write LM-63 files of 2002 and 2019, strictly: what the standard does not allow is refused, all mistakes at once."""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63_model import (
    NO_TILT,
    POINT,
    REQUIRED_KEYWORDS,
    STANDARD_KEYWORDS,
    Edition,
    FileGeneration,
    Opening,
    Tilt,
)
from labdaq.errors import DataError, Problems
from labdaq.whole_file import write_whole_bytes

_LINE: Final = 254
"""Characters before CR LF: the limit of 2002. 2019 has none, but readers such as ies2rad keep it."""
_LONGEST: Final = 25  # characters of a plain decimal
_NAME: Final = re.compile(r"_?[A-Z0-9][A-Z0-9_-]{0,17}")
_WRITABLE: Final = (Edition.E2002, Edition.E2019)


def write_lm63(
    path: Path | str,
    distribution: Distribution,
    *,
    generation: FileGeneration,
    edition: Edition = Edition.E2019,
    opening: Opening = POINT,
    watts: float = 0.0,
    tilt: Tilt = NO_TILT,
    digits: int = 7,
) -> None:
    """Write a type C file of absolute photometry (-1 lumens, multiplier and ballast factor 1, metres).

    Parameters
    ----------
    path
        Written beside its name and renamed, so that nothing half-written stays.
    distribution
        Closed at gamma 90 or 180 (see `analysis.photometry.closing`); its keywords become the file's and must hold
        TEST, TESTLAB, ISSUEDATE and MANUFAC.
    generation
        How the candelas came about; a 2002 file has no place for it, but the caller must know it.
    opening
        Luminous opening [m].
    watts
        Input power [W].
    digits
        Significant digits of the candelas, and at most two more decimals than the largest one has; 17 keep every bit.

    Raises
    ------
    DataError
        The distribution or its keywords would make an illegal file; all reasons are listed.
    StorageError
        The disk refused.
    """
    text = render_lm63(
        distribution,
        generation=generation,
        edition=edition,
        opening=opening,
        watts=watts,
        tilt=tilt,
        digits=digits,
        source=str(path),
    )
    write_whole_bytes(Path(path), text)


def render_lm63(
    distribution: Distribution,
    *,
    generation: FileGeneration,
    edition: Edition = Edition.E2019,
    opening: Opening = POINT,
    watts: float = 0.0,
    tilt: Tilt = NO_TILT,
    digits: int = 7,
    source: str = "LM-63 data",
) -> bytes:
    """The bytes `write_lm63` writes; same parameters and errors."""
    problems = Problems(source)
    if edition not in _WRITABLE:
        problems.add("edition", f"{edition.year} is read only; write 2002 or 2019")
    _check_distribution(distribution, problems)
    _check_keywords(distribution.keywords, problems)
    if tilt.source not in ("NONE", "INCLUDE"):
        problems.add("TILT", f"a reference to another file ({tilt.source}) is not allowed from 2019 on")
    problems.raise_if_any(DataError)
    c, planes = distribution.c_deg, distribution.candela
    if len(c) == 2:  # the same in all planes: one plane says so
        c, planes = c[:1], planes[:1]
    lines = [edition.value, *_keyword_lines(distribution.keywords), *_tilt_lines(tilt)]
    size = " ".join(_exact(x) for x in (opening.width_m, opening.length_m, opening.height_m))
    lines.append(f"1 -1 1 {len(distribution.gamma_deg)} {len(c)} 1 2 {size}")
    lines.append(f"1 {generation.value if edition is Edition.E2019 else '1'} {_exact(watts)}")
    lines += _wrapped(map(_exact, distribution.gamma_deg))
    lines += _wrapped(map(_exact, c))
    if digits < 17 and planes.max() > 0:  # what is a billionth of the peak is noise of the arithmetic
        planes = np.round(planes, digits + 2 - int(np.floor(np.log10(planes.max()))))
    for plane in planes:
        lines += _wrapped(_rounded(plane.tolist(), digits))
    return "".join(f"{line}\r\n" for line in lines).encode("ascii")


def _check_distribution(distribution: Distribution, problems: Problems) -> None:
    gamma, planes = distribution.gamma_deg, distribution.candela
    if gamma[0] not in (0.0, 90.0):
        problems.add("gamma", f"starts at {gamma[0]:g}; a type C file starts at 0 or 90")
    if gamma[-1] not in (90.0, 180.0):
        problems.add("gamma", f"ends at {gamma[-1]:g}; a type C file ends at 90 or 180 (fill the row, and declare it)")
    if gamma[0] == gamma[-1]:
        problems.add("gamma", "covers a single angle")
    if not np.array_equal(planes[0], planes[-1]):
        problems.add("C", "the plane at 360 differs from the plane at 0")
    if np.any(planes < 0):
        j, i = np.argwhere(planes < 0)[0]
        problems.add("candela", f"{planes[j, i]:g} at gamma {gamma[i]:g}, C {distribution.c_deg[j]:g} is negative")


def _check_keywords(keywords: Mapping[str, str], problems: Problems) -> None:
    for key in REQUIRED_KEYWORDS:
        if not keywords.get(key, "").strip():
            problems.add(f"[{key}]", "is required")
    for key, value in keywords.items():
        if key in ("MORE", "BLOCK", "ENDBLOCK"):
            problems.add(f"[{key}]", "is written where it is needed, not given")
        elif not _NAME.fullmatch(key):
            problems.add(f"[{key}]", "a keyword has up to 18 capitals, digits, - or _")
        elif not key.startswith("_") and key not in STANDARD_KEYWORDS:
            problems.add(f"[{key}]", "is not in the standard; a keyword of one's own begins with _")
        odd = {letter for letter in value if letter != "\n" and not " " <= letter <= "~"}
        if odd:
            problems.add(f"[{key}]", f"only ASCII is allowed, not {''.join(sorted(odd))!r}")


def _keyword_lines(keywords: Mapping[str, str]) -> Iterator[str]:
    order = [key for key in REQUIRED_KEYWORDS if key in keywords]
    order += [key for key in keywords if key not in REQUIRED_KEYWORDS and not key.startswith("_")]
    order += [key for key in keywords if key.startswith("_")]
    for key in order:
        name = key
        for text in keywords[key].split("\n"):
            rest = text.strip()
            while True:
                room = _LINE - len(name) - 3
                yield f"[{name}] {rest[:room]}".rstrip()
                rest, name = rest[room:], "MORE"
                if not rest:
                    break


def _tilt_lines(tilt: Tilt) -> Iterator[str]:
    yield f"TILT={tilt.source}"
    if tilt.source == "INCLUDE":
        yield str(tilt.lamp_geometry)
        yield str(len(tilt.angle_deg))
        yield from _wrapped(map(_exact, tilt.angle_deg))
        yield from _wrapped(map(_exact, tilt.factor))


def _exact(value: float) -> str:
    """The shortest decimal that reads back as the same float; plain unless it is very small or large."""
    text = np.format_float_positional(value, trim="-")
    return text if len(text) < _LONGEST else repr(float(value))


def _rounded(values: list[float], digits: int) -> Iterator[str]:
    for value in values:
        text = f"{value:.{digits}g}"
        yield text if "e" not in text else _exact(float(text))


def _wrapped(words: Iterable[str]) -> Iterator[str]:
    """Lines of words, none longer than the limit."""
    line: list[str] = []
    length = -1
    for word in words:
        if length + 1 + len(word) > _LINE:
            yield " ".join(line)
            line, length = [], -1
        line.append(word)
        length += 1 + len(word)
    if line:
        yield " ".join(line)
