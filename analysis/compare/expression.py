"""Arithmetic between the columns of a table: ``+ - * /``, parentheses, numbers and column names, nothing else.

A column whose name is not a plain word stands in backticks: ```` `Set 1_CLTC_fc` - 2 * dark ````. An expression with a
missing value in it is missing (NaN).
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from pydantic_core import CoreSchema, core_schema

_TOKEN: Final = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])"
    r"|(?P<name>[^\W\d]\w*(?:\.\w+)*)|`(?P<quoted>[^`]+)`|(?P<sign>[-+*/()]))"
)
_LONGEST: Final = 400
_DEEPEST: Final = 50

Node = float | str | tuple[str, "Node", "Node"]


@dataclass(frozen=True)
class Expression:
    """A parsed expression.

    Attributes
    ----------
    text
        As it was written.
    columns
        The columns it names, in order.
    """

    text: str
    columns: tuple[str, ...]
    _tree: Node

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read an expression; raises `ValueError` saying what is wrong and where."""
        if len(text) > _LONGEST:
            raise ValueError(f"an expression of {len(text)} characters is too long")
        parser = _Parser(text)
        tree = parser.whole()
        return cls(text, tuple(dict.fromkeys(_names(tree))), tree)

    def value(self, cells: Mapping[str, float]) -> float:
        """Evaluate with a number for each column; NaN when one is missing. Raises `ZeroDivisionError`."""
        return _value(self._tree, cells)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Callable[[Any], CoreSchema]) -> CoreSchema:
        """In a recipe: a text that parses, or a plain number."""
        return core_schema.no_info_plain_validator_function(_of_toml)


def _of_toml(given: object) -> Expression:
    if isinstance(given, Expression):
        return given
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        raise ValueError(f"must be a number, or an expression in quotes, not {given!r}")
    if isinstance(given, str):
        return Expression.parse(given)
    if not math.isfinite(given):
        raise ValueError(f"must be a finite number, not {given!r}")
    return Expression(f"{given:g}", (), float(given))


class _Parser:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.depth = 0
        self._next()

    def whole(self) -> Node:
        tree = self._sum()
        if self.kind:
            raise self._error(f"{self.word!r} is not expected")
        return tree

    def _next(self) -> None:
        """Step to the next token: ``kind`` is '' at the end."""
        rest = self.text[self.at :]
        self.start = len(self.text) - len(rest.lstrip())
        if not rest.strip():
            self.kind, self.word = "", ""
            return
        found = _TOKEN.match(self.text, self.at)
        if found is None or found.lastgroup is None:
            raise self._error("only numbers, columns, + - * / and parentheses are allowed (odd names in `backticks`)")
        self.kind, self.word, self.at = found.lastgroup, found[found.lastgroup], found.end()

    def _sum(self) -> Node:
        tree = self._product()
        while self.kind == "sign" and self.word in "+-":
            sign = self.word
            self._next()
            tree = (sign, tree, self._product())
        return tree

    def _product(self) -> Node:
        tree = self._factor()
        while self.kind == "sign" and self.word in "*/":
            sign = self.word
            self._next()
            tree = (sign, tree, self._factor())
        return tree

    def _factor(self) -> Node:
        kind, word = self.kind, self.word
        if kind == "number":
            self._next()
            return float(word)
        if kind in ("name", "quoted"):
            self._next()
            return word
        if kind == "sign" and word in "-(":
            self.depth += 1
            if self.depth > _DEEPEST:
                raise self._error("too many parentheses or signs")
            self._next()
            inner: Node = ("-", 0.0, self._factor()) if word == "-" else self._bracket()
            self.depth -= 1
            return inner
        raise self._error("a number or a column is expected" + (f", not {word!r}" if word else " at the end"))

    def _bracket(self) -> Node:
        inner = self._sum()
        if self.word != ")" or self.kind != "sign":
            raise self._error("a ')' is missing")
        self._next()
        return inner

    def _error(self, what: str) -> ValueError:
        return ValueError(f"expression {self.text!r}, character {self.start + 1}: {what}")


def _names(tree: Node) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, tuple):
        yield from _names(tree[1])
        yield from _names(tree[2])


def _value(tree: Node, cells: Mapping[str, float]) -> float:
    if isinstance(tree, str):
        return cells[tree]
    if isinstance(tree, float):
        return tree
    sign, a, b = tree[0], _value(tree[1], cells), _value(tree[2], cells)
    if sign == "+":
        return a + b
    if sign == "-":
        return a - b
    if sign == "*":
        return a * b
    if math.isnan(a) or math.isnan(b):
        return math.nan
    return a / b
