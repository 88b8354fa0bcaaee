"""Text made of a row: ``T{test}`` puts the cell of column ``test`` behind a T."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from pydantic_core import CoreSchema, core_schema

_PLACE: Final = re.compile(r"\{([^{}]+)\}")


@dataclass(frozen=True)
class Template:
    """A text with columns in braces.

    Attributes
    ----------
    text
        As it was written.
    columns
        The columns it names, in order.
    """

    text: str
    columns: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read a template; raises `ValueError` for braces that do not pair."""
        if any(brace in _PLACE.sub("", text) for brace in "{}"):
            raise ValueError(f"the braces in {text!r} do not pair around column names")
        return cls(text, tuple(dict.fromkeys(_PLACE.findall(text))))

    def fill(self, cells: Mapping[str, str]) -> str:
        """The text for one row; empty when every column it names is empty there."""
        if self.columns and not any(cells[name] for name in self.columns):
            return ""
        return _PLACE.sub(lambda found: cells[found[1]], self.text)

    def pattern(self) -> re.Pattern[str]:
        """A pattern that matches such texts, the columns as groups ``p0``, ``p1`` ... (the shortest match of each)."""
        pieces = _PLACE.split(self.text)
        made = "".join(
            f"(?P<p{self.columns.index(piece)}>.+?)" if k % 2 else re.escape(piece) for k, piece in enumerate(pieces)
        )
        return re.compile(made)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Callable[[Any], CoreSchema]) -> CoreSchema:
        """In a recipe: a text in quotes."""
        return core_schema.no_info_plain_validator_function(_of_toml)


def _of_toml(given: object) -> Template:
    if isinstance(given, Template):
        return given
    if not isinstance(given, str):
        raise ValueError(f"must be text in quotes, not {given!r}")
    return Template.parse(given)
