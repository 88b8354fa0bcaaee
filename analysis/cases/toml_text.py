"""Write TOML: what `tomllib` reads, from plain dicts, in the shape a person would give it.

Tables of the file become ``[name]``, lists of tables ``[[name]]``; whatever is nested deeper goes on one line.
Every float reads back as the same float (its shortest decimal is written).
"""

import re
from collections.abc import Iterator, Mapping
from datetime import UTC, date, datetime, time
from typing import Any, Final

import numpy as np

from labdaq.errors import DataError

_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES: Final = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def toml_text(table: Mapping[str, Any]) -> str:
    """TOML text of ``table``; ``None`` values are left out.

    Values are str, bool, int, float, numpy scalars, datetime (aware ones in UTC), date, time, lists and dicts of these.
    Raises `DataError` for anything else, naming the key.
    """
    return "\n".join(_lines(table)).lstrip("\n") + "\n"


def _lines(table: Mapping[str, Any]) -> Iterator[str]:
    given = {key: value for key, value in table.items() if value is not None}
    tables = {k: v for k, v in given.items() if isinstance(v, Mapping)}
    arrays = {k: v for k, v in given.items() if _is_array_of_tables(v)}
    for key, value in given.items():
        if key not in tables and key not in arrays:
            yield f"{_key(key)} = {_value(value, key)}"
    for key, value in tables.items():
        yield f"\n[{_key(key)}]"
        yield from _pairs(value, key)
    for key, entries in arrays.items():
        for entry in entries:
            yield f"\n[[{_key(key)}]]"
            yield from _pairs(entry, key)


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) > 0 and all(isinstance(v, Mapping) for v in value)


def _pairs(table: Mapping[str, Any], where: str) -> Iterator[str]:
    for key, value in table.items():
        if value is not None:
            yield f"{_key(key)} = {_value(value, f'{where}.{key}')}"


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _string(name, name)


def _value(value: Any, where: str) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _string(value, where)
        case int():
            return str(int(value))
        case float():
            return repr(float(value))  # numpy and enum subclasses would print their type
        case datetime():
            return _moment(value)
        case date() | time():
            return value.isoformat()
        case list() | tuple():
            return "[" + ", ".join(_value(v, where) for v in value) + "]"
        case Mapping():
            inside = ", ".join(f"{_key(k)} = {_value(v, f'{where}.{k}')}" for k, v in value.items() if v is not None)
            return f"{{ {inside} }}" if inside else "{}"
    raise DataError(f"{where}: a {type(value).__name__} cannot be written as TOML")


def _moment(moment: datetime) -> str:
    if moment.tzinfo is None:
        return moment.isoformat()
    return moment.astimezone(UTC).replace(tzinfo=None).isoformat() + "Z"


def _string(text: str, where: str) -> str:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        raise DataError(f"{where}: {text!r} holds half a character and cannot be written") from None
    escaped = (
        _ESCAPES.get(letter) or (f"\\u{ord(letter):04X}" if ord(letter) < 0x20 or ord(letter) == 0x7F else letter)
        for letter in text
    )
    return f'"{"".join(escaped)}"'
