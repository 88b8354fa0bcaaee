"""Tensor trees as text: nested braces, as in LBNL files and Radiance's ``bsdf_t.c``."""

import re
from collections.abc import Callable, Iterator

import numpy as np

from analysis.bsdf.tree import Tree, TreeBuilder
from labdaq.errors import DataError

_BRACE = re.compile(r"[{}]")


def parse_tree(text: str, rank: int, source: str = "tensor tree", first_line: int = 1) -> Tree:
    """Read a tree.

    Parameters
    ----------
    text
        ``{ .. }`` with either 2**rank nested nodes or 2**(rank k) values in each pair of braces.
    source, first_line
        For messages.

    Raises
    ------
    DataError
        Braces do not match, or a node holds a wrong number of nodes or values; names the line.
    """
    builder = TreeBuilder(rank)
    stack: list[list[int]] = []
    root: int | None = None
    at = 0

    def fail(place: int, what: str) -> DataError:
        return DataError(f"{source}: line {first_line + text.count(chr(10), 0, place)}: {what}")

    for match in _BRACE.finditer(text):
        words = text[at : match.start()].replace(",", " ").split()
        opens = match[0] == "{"
        if words and (opens or not stack or stack[-1]):
            raise fail(at, f"values beside nested nodes, or outside the braces ({words[0]!r})")
        at = match.end()
        if opens:
            if root is not None:
                raise fail(match.start(), "a second tree begins")
            stack.append([])
            continue
        if not stack:
            raise fail(match.start(), "a brace closes that was not opened")
        children = stack.pop()
        if children and len(children) != 1 << rank:
            raise fail(match.start(), f"a node has {len(children)} branches instead of {1 << rank}")
        node = builder.branch(children) if children else _grid_node(builder, words, fail, match.start())
        if stack:
            stack[-1].append(node)
        else:
            root = node
    if stack or root is None:
        raise fail(len(text), "the tree ends within its braces" if stack else "there is no tree")
    if text[at:].strip():
        raise fail(at, "text after the tree")
    return builder.tree(root)


def _grid_node(builder: TreeBuilder, words: list[str], fail: Callable[[int, str], DataError], place: int) -> int:
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        raise fail(place, f"not a number among {words[:3]}") from None
    if not np.isfinite(values).all():
        raise fail(place, "a value is not finite")
    count, per_level = len(values), 1 << builder.rank
    level = 0
    while per_level**level < count:
        level += 1
    if count == 0 or per_level**level != count:
        raise fail(place, f"{count} values in a node; 1, {per_level}, {per_level**2} .. are possible")
    return builder.grid(values.reshape((1 << level,) * builder.rank))


def render_tree(tree: Tree) -> str:
    """The tree as text that `parse_tree` and Radiance read back."""
    return "\n".join(_lines(tree)) + "\n"


def _lines(tree: Tree) -> Iterator[str]:
    rank = tree.rank
    # written with the last dimension fastest, stored with the first dimension in the lowest bit
    order = [sum((k >> (rank - 1 - i) & 1) << i for i in range(rank)) for k in range(1 << rank)]

    def visit(node: int, level: int) -> Iterator[str]:
        indent = "    " * level
        if node < 0:
            yield f"{indent}{{ {_number(tree.leaves[-node - 1])} }}"
            return
        children = tree.branches[node]
        if (children < 0).all():
            yield f"{indent}{{ {' '.join(_number(tree.leaves[-children[k] - 1]) for k in order)} }}"
            return
        yield f"{indent}{{"
        for child in children:
            yield from visit(int(child), level + 1)
        yield f"{indent}}}"

    yield from visit(tree.root, 0)


def _number(value: float) -> str:
    return f"{value:.7g}"
