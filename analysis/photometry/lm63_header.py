"""The lines before TILT: edition and keywords."""

import re
from dataclasses import dataclass, field

from analysis.photometry.lm63_model import REQUIRED_KEYWORDS, STANDARD_KEYWORDS, Edition, Oddity

_KEYWORD = re.compile(r"\s*\[([^\]\[]*)\]\s?(.*)")
_LABEL_LIMIT = 80  # characters without the line end, 1986 to 1995
_LINE_LIMIT = 256  # characters with the line end, 2002


@dataclass
class Header:
    """What stands before the TILT line."""

    edition: Edition = Edition.E1986
    keywords: dict[str, str] = field(default_factory=dict)
    labels: list[str] = field(default_factory=list)
    oddities: list[Oddity] = field(default_factory=list)


def decode_line(raw: bytes) -> tuple[str, bool]:
    """Text of a line, and whether it was plain ASCII; UTF-8 is tried before Latin-1."""
    try:
        return raw.decode("ascii"), True
    except UnicodeDecodeError:
        pass
    try:
        return raw.decode("utf-8"), False
    except UnicodeDecodeError:
        return raw.decode("latin-1"), False


def parse_header(raw_lines: list[bytes]) -> Header:
    """Read the lines before TILT; nothing here is fatal, everything unusual becomes an oddity."""
    header = Header()
    lines: list[tuple[int, str]] = []
    foreign = 0
    for number, raw in enumerate(raw_lines, start=1):
        text, plain = decode_line(raw)
        if not plain and not foreign:
            foreign = number
        lines.append((number, text))
    if foreign:
        header.oddities.append(Oddity(foreign, "characters beyond ASCII"))
    while lines and not lines[0][1].strip():
        number, _ = lines.pop(0)
        header.oddities.append(Oddity(number, "empty line before the edition"))
    if lines and _read_edition(header, *lines[0]):
        lines.pop(0)
    _read_keywords(header, lines)
    _check_lengths(header, lines)
    return header


def _read_edition(header: Header, number: int, text: str) -> bool:
    """Recognise the first line; false when it is not an edition (1986 files have none)."""
    for edition in Edition:
        if edition.value and text == edition.value:
            header.edition = edition
            return True
    squeezed = re.sub(r"\s+", "", text).upper()
    match = re.fullmatch(r"(?:IESNA|IES):?(?:LM-?63-?)?((?:19|20)?\d\d)", squeezed)
    if match is None:
        return False
    year = int(match[1]) if len(match[1]) == 4 else int(match[1]) + (1900 if int(match[1]) > 50 else 2000)
    known = [edition for edition in Edition if edition.year <= max(year, 1986)]
    header.edition = known[-1]
    header.oddities.append(Oddity(number, f"edition written as {text!r}, read as {header.edition.year}"))
    return True


def _read_keywords(header: Header, lines: list[tuple[int, str]]) -> None:
    last = ""
    for number, text in lines:
        match = _KEYWORD.fullmatch(text)
        if match is None:
            if text.strip():
                header.labels.append(text.strip())
                if header.edition is not Edition.E1986:
                    header.oddities.append(Oddity(number, "a header line that is not a keyword, kept as a label"))
            continue
        if header.edition is Edition.E1986 and not header.keywords:
            header.oddities.append(Oddity(number, "keywords, but no edition on the first line; read as 1986"))
        key, value = match[1].strip(), match[2].strip()
        if key != key.upper():
            header.oddities.append(Oddity(number, f"keyword [{key}] is not in capitals"))
            key = key.upper()
        if key in ("BLOCK", "ENDBLOCK"):
            continue
        if key == "MORE":
            if not last:
                header.oddities.append(Oddity(number, "[MORE] without a keyword before it, kept as a label"))
                header.labels.append(value)
                continue
            key = last
        elif not key.startswith("_") and key not in STANDARD_KEYWORDS:
            header.oddities.append(Oddity(number, f"keyword [{key}] is neither standard nor the user's own"))
        header.keywords[key] = f"{header.keywords[key]}\n{value}" if key in header.keywords else value
        last = key
    if header.edition.year >= 2002:
        missing = [key for key in REQUIRED_KEYWORDS if not header.keywords.get(key)]
        if missing:
            names = ", ".join(f"[{key}]" for key in missing)
            header.oddities.append(Oddity(1, f"required and missing or empty: {names}"))


def _check_lengths(header: Header, lines: list[tuple[int, str]]) -> None:
    if header.edition is Edition.E2019:
        return
    limit = _LABEL_LIMIT if header.edition.year < 2002 else _LINE_LIMIT - 2
    long = [number for number, text in lines if len(text) > limit]
    if long:
        header.oddities.append(Oddity(long[0], f"{len(long)} header line(s) longer than {limit} characters"))
