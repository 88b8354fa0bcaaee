"""Read what a person wrote in TOML, and refuse it once, with all its mistakes.

Each mistake names the file and the field; an unknown key names its nearest neighbour. Models are pydantic and forbid
unknown keys (`Table`).
"""

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, ClassVar, Final, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from labdaq.errors import ConfigError, Problems

M = TypeVar("M", bound=BaseModel)

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Fraction01 = Annotated[float, Field(ge=0, le=1)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=64)]
"""A name that is also safe as part of a file's name."""


class Table(BaseModel):
    """Base of every table a person writes: unknown keys are mistakes, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_enum_values=True)

    described_in: ClassVar[str] = "docs/formats.md"
    """The page that a mistake refers to."""


def load(path: Path, model: type[M]) -> M:
    """Read a TOML file as ``model``; raises `ConfigError` listing every mistake with its field."""
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors on Windows put a mark in front
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise ConfigError(f"{path}: cannot be read: {reason}", "check the path and its permissions") from error
    return parse(text, model, str(path))


def parse(text: str, model: type[M], source: str) -> M:
    """Read TOML text as ``model``; ``source`` is what mistakes are said to be in."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source}: not valid TOML: {error}") from error
    return check(data, model, source)


def check(data: Mapping[str, Any], model: type[M], source: str) -> M:
    """Validate data that came from TOML or from a session's header; raises `ConfigError` as `load` does."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = Problems(source)
        for detail in mistakes_of(error):
            for line in _say(detail, model).splitlines():
                problems.add(_where(detail["loc"], data), line)
        page = getattr(model, "described_in", Table.described_in)
        problems.raise_if_any(ConfigError, f"correct {source} and start again; {page} describes each field")
        raise AssertionError("unreachable") from error


def mistakes_of(error: ValidationError) -> list[ErrorDetails]:
    """What pydantic found, without lists that are too short only because of bad items.

    It counts the good items only, and the bad ones are told already.
    """
    found = error.errors(include_url=False)
    places = [one["loc"] for one in found]

    def has_bad_items(loc: tuple[int | str, ...]) -> bool:
        return any(place[: len(loc)] == loc and len(place) > len(loc) for place in places)

    return [one for one in found if not (one["type"] == "too_short" and has_bad_items(one["loc"]))]


_PLAIN: Final = {
    "missing": "is missing",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "string_type": "must be text in quotes",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "timezone_aware": "has no time zone; write UTC, e.g. 2010-07-22T13:12:00Z",
    "union_tag_not_found": "has no 'kind'",
}


def _say(detail: ErrorDetails, model: type[BaseModel]) -> str:
    """One mistake in plain words."""
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return _unknown_key(detail["loc"], model)
    if kind in _PLAIN:
        shown = "" if kind in {"missing", "union_tag_not_found"} else f", not {given!r}"
        return _PLAIN[kind] + shown
    if kind == "value_error":
        return str(detail["ctx"]["error"])
    if kind == "literal_error":
        return f"must be {detail['ctx']['expected']}, not {given!r}"
    if kind == "union_tag_invalid":
        return f"kind must be one of {detail['ctx']['expected_tags']}, not {detail['ctx']['tag']!r}"
    if kind == "string_pattern_mismatch":
        return f"may hold letters, digits, '.', '_' and '-' only, not {given!r}"
    if kind in {"too_short", "too_long"}:
        return detail["msg"].replace("Tuple", "It").replace("List", "It")
    return f"{detail['msg'].replace('Input should', 'must')}, not {given!r}"


def _unknown_key(loc: Sequence[int | str], model: type[BaseModel]) -> str:
    known = _keys(model, loc[:-1])
    near = difflib.get_close_matches(str(loc[-1]), known, n=1, cutoff=0.5)
    return f"unknown key; did you mean '{near[0]}'?" if near else f"unknown key; known are {', '.join(sorted(known))}"


def _keys(annotation: Any, loc: Sequence[int | str]) -> list[str]:
    """The keys that a table at ``loc`` below ``annotation`` may have."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        fields = {f.alias or name: f for name, f in annotation.model_fields.items()}
        if not loc:
            return list(fields)
        field = fields.get(str(loc[0]))
        return _keys(field.annotation, loc[1:]) if field else []
    inner = get_args(annotation)
    if loc and isinstance(loc[0], int):
        return _keys(inner[0], loc[1:])
    if (
        get_origin(annotation) in (Union, UnionType) and loc
    ):  # a union told apart by its `kind`: pydantic puts the tag into loc
        chosen = [a for a in inner if loc[0] in get_args(a.model_fields["kind"].annotation)]
        return _keys(chosen[0], loc[1:]) if chosen else []
    optional = [a for a in inner if a is not type(None)]
    return _keys(optional[0], loc) if len(optional) == 1 else []


def _where(loc: Sequence[int | str], data: Any) -> str:
    """``instrument[roof-luminance].port``: list entries go by their name where they have one."""
    text = ""
    for part in loc:
        if isinstance(part, int):
            data = data[part] if isinstance(data, Sequence) and part < len(data) else None
            name = next((data[k] for k in ("name", "id") if k in data), None) if isinstance(data, Mapping) else None
            text += f"[{name}]" if isinstance(name, str) else f"[{part + 1}]"
        elif isinstance(data, Mapping) and data.get("kind") == part and part not in data:
            continue  # the tag of a union, not a field
        else:
            data = data.get(part) if isinstance(data, Mapping) else None
            text += f".{part}" if text else str(part)
    return text or "the file"
