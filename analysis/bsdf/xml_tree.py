"""XML with line numbers, so that a message can say where."""

from dataclasses import dataclass, field
from xml.parsers import expat

from labdaq.errors import DataError


@dataclass
class Node:
    """An element.

    Attributes
    ----------
    tag
        Local name, without a namespace.
    attributes, text, children
        As written; ``text`` without the text of children.
    line
        Where it starts.
    text_line
        Where its first text starts.
    """

    tag: str
    line: int
    attributes: dict[str, str] = field(default_factory=dict)
    pieces: list[str] = field(default_factory=list)
    children: list["Node"] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Text without surrounding blanks."""
        return "".join(self.pieces).strip()

    @property
    def raw_text(self) -> str:
        """Text as it stands."""
        return "".join(self.pieces)

    def find(self, *path: str) -> "Node | None":
        """First descendant along a path of tags, whatever their case."""
        node = self
        for tag in path:
            found = next((child for child in node.children if child.tag.lower() == tag.lower()), None)
            if found is None:
                return None
            node = found
        return node

    def all(self, tag: str) -> list["Node"]:
        """Children with a tag, whatever its case."""
        return [child for child in self.children if child.tag.lower() == tag.lower()]


def parse_xml(data: bytes, source: str) -> Node:
    """Parse a document without DOCTYPE; raises `DataError` with the line."""
    parser = expat.ParserCreate()
    top = Node("", 0)
    stack = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        node = Node(tag.rpartition(":")[2], parser.CurrentLineNumber, attributes)
        stack[-1].children.append(node)
        stack.append(node)

    def text(piece: str) -> None:
        stack[-1].pieces.append(piece)

    def refuse(*_: object) -> None:
        raise DataError(f"{source}: line {parser.CurrentLineNumber}: a DOCTYPE; BSDF files have none")

    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: stack.pop()
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse
    before, mark, _ = data.partition(b"<")
    if mark and before.isascii() and before.strip():  # as where a program's messages went into its output
        words = before.decode().strip().split("\n")[0][:40]
        raise DataError(f"{source}: line 1: {words!r} stands before the document", "take out all before the first '<'")
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise DataError(f"{source}: line {error.lineno}: {expat.errors.messages[error.code]}") from None
    return top.children[0]
