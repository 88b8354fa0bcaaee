"""Read LBNL BSDF files (the XML of WINDOW, Radiance and the Complex Glazing Database): Klems matrices and tensor trees.

Lenient about what real files get wrong without harm (case of units, empty thickness, negative noise), strict about what
could give a wrong number: counts of values, bases, doubled components.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from analysis.bsdf.basis import KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, KNOWN, OLD_HALF, AngleBasis
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Floats, Material
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import Tree
from analysis.bsdf.tree_text import parse_tree
from analysis.bsdf.xml_tree import Node, parse_xml
from analysis.text_numbers import is_number
from labdaq.errors import DataError

_LENGTHS: Final = {"meter": 1.0, "millimeter": 1e-3, "centimeter": 1e-2, "foot": 0.3048, "inch": 0.0254}


@dataclass(frozen=True)
class BsdfFile:
    """A file that was read.

    Attributes
    ----------
    bsdf
        The scattering in the band that was asked for.
    band, bands
        That band, and all the file holds, e.g. ``Visible`` and ``Solar``.
    oddities
        What the reader stepped over, each with its line.
    """

    bsdf: KlemsBsdf | TensorTreeBsdf
    band: str
    bands: tuple[str, ...]
    oddities: tuple[str, ...] = ()


def read_bsdf(path: Path | str, band: str = "Visible") -> BsdfFile:
    """Read a BSDF file; raises `DataError` with line and reason."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    return parse_bsdf(data, str(path), band)


def parse_bsdf(data: bytes, source: str = "BSDF data", band: str = "Visible") -> BsdfFile:
    """Read BSDF XML from memory; ``source`` names it in messages. Raises `DataError`."""
    return _Reader(parse_xml(data, source), source).read(band)


class _Reader:
    def __init__(self, root: Node, source: str) -> None:
        self.root = root
        self.source = source
        self.oddities: list[str] = []

    def error(self, node: Node, what: str) -> DataError:
        return DataError(f"{self.source}: line {node.line}: {what}")

    def odd(self, node: Node, what: str) -> None:
        self.oddities.append(f"line {node.line}: {what}")

    def need(self, node: Node, *path: str) -> Node:
        found = node.find(*path)
        if found is None:
            raise self.error(node, f"<{node.tag}> holds no <{'/'.join(path)}>")
        return found

    def number(self, node: Node) -> float:
        try:
            value = float(node.text)
        except ValueError:
            raise self.error(node, f"<{node.tag}> is {node.text!r}, not a number") from None
        if not np.isfinite(value):
            raise self.error(node, f"<{node.tag}> is {node.text}, not a finite number")
        return value

    def read(self, band: str) -> BsdfFile:
        if self.root.tag != "WindowElement":
            raise self.error(self.root, f"the file is <{self.root.tag}>, not the <WindowElement> of a BSDF file")
        layer = self.need(self.root, "Optical", "Layer")
        structure = self.need(layer, "DataDefinition", "IncidentDataStructure")
        kind = structure.text.lower()
        blocks, bands = self._blocks(layer, band)
        material = self._material(layer.find("Material"))
        if kind in ("tensortree3", "tensortree4"):
            rank = int(kind[-1])
            trees = {component: self._tree(block, rank) for component, block in blocks.items()}
            bsdf: KlemsBsdf | TensorTreeBsdf = TensorTreeBsdf(trees, material)
        elif kind in ("columns", "rows"):
            bsdf = self._klems(layer, blocks, kind == "rows", material)
        else:
            raise self.error(structure, f"a data structure of {structure.text!r} is not known")
        return BsdfFile(bsdf, band, bands, tuple(self.oddities))

    def _blocks(self, layer: Node, band: str) -> tuple[dict[Component, Node], tuple[str, ...]]:
        """Data blocks of the band by component, and the names of all bands."""
        blocks: dict[Component, Node] = {}
        bands: list[str] = []
        for data in layer.all("WavelengthData"):
            wavelength = self.need(data, "Wavelength")
            if wavelength.text not in bands:
                bands.append(wavelength.text)
            if wavelength.text.lower() != band.lower():
                continue
            for block in data.all("WavelengthDataBlock"):
                direction = self.need(block, "WavelengthDataDirection")
                component = next((c for c in Component if c.value.lower() == direction.text.lower()), None)
                if component is None:
                    self.odd(direction, f"direction {direction.text!r} is not read")
                elif component in blocks:
                    raise self.error(block, f"{component} stands there twice for {band}")
                else:
                    blocks[component] = block
        if not blocks:
            raise self.error(layer, f"there are no data for {band}; the file holds {', '.join(bands) or 'none at all'}")
        return blocks, tuple(bands)

    def _material(self, node: Node | None) -> Material:
        if node is None:
            return Material()

        def text(tag: str) -> str:
            found = node.find(tag)
            return found.text if found else ""

        def length(tag: str) -> float | None:
            found = node.find(tag)
            if found is None:
                return None
            if not found.text:
                self.odd(found, f"<{tag}> is empty")
                return None
            unit = found.attributes.get("unit", "")
            if unit not in ("Meter", "Millimeter"):
                self.odd(found, f"<{tag}> has the unit {unit!r} instead of Meter or Millimeter")
            if unit.lower() not in _LENGTHS:
                return None
            return self.number(found) * _LENGTHS[unit.lower()]

        return Material(
            text("Name"), text("Manufacturer"), length("Thickness"), length("Width"), length("Height"),
            text("DeviceType") or "Other",
        )  # fmt: skip

    def _tree(self, block: Node, rank: int) -> Tree:
        basis = self.need(block, "AngleBasis")
        if basis.text.lower() != "lbnl/shirley-chiu":
            raise self.error(basis, f"a tensor tree on the basis {basis.text!r} is not known")
        data = self.need(block, "ScatteringData")
        tree = parse_tree(data.raw_text, rank, self.source, data.line)
        if (tree.leaves < 0).any():
            self.odd(data, f"{int((tree.leaves < 0).sum())} negative value(s), read as 0")
        return Tree(rank, tree.branches, np.maximum(tree.leaves, 0.0), tree.root)

    def _klems(self, layer: Node, blocks: dict[Component, Node], rows: bool, material: Material) -> KlemsBsdf:
        defined = self._bases(self.need(layer, "DataDefinition"))
        names = set()
        for block in blocks.values():
            names |= {self.need(block, f"{side}AngleBasis").text for side in ("Column", "Row")}
        if len(names) > 1:
            raise self.error(layer, f"components on different bases ({', '.join(sorted(names))}) are not read")
        name = names.pop()
        basis = defined.get(name.lower()) or self._assumed(layer, name, blocks)
        matrices = {component: self._matrix(block, basis, rows) for component, block in blocks.items()}
        return KlemsBsdf(basis, matrices, material)

    def _bases(self, definition: Node) -> dict[str, AngleBasis]:
        """Bases the file defines, by lower-case name; their own bounds count, whatever the name."""
        found: dict[str, AngleBasis] = {}
        for node in definition.all("AngleBasis"):
            name = self.need(node, "AngleBasisName").text
            bounds, counts = [0.0], []
            for ring in node.all("AngleBasisBlock"):
                low = self.number(self.need(ring, "ThetaBounds", "LowerTheta"))
                if abs(low - bounds[-1]) > 1e-6:
                    raise self.error(ring, f"the ring starts at {low:g}, but the one before ends at {bounds[-1]:g}")
                bounds.append(self.number(self.need(ring, "ThetaBounds", "UpperTheta")))
                counts.append(int(self.number(self.need(ring, "nPhis"))))
            try:
                basis = AngleBasis(name, tuple(bounds), tuple(counts))
            except ValueError as error:
                raise self.error(node, str(error)) from None
            usual = KNOWN.get(name)
            if usual is not None and usual != basis:
                self.odd(node, f"{name} with {basis.size} patches is not what Radiance 6 takes by that name")
            found[name.lower()] = basis
        return found

    def _assumed(self, layer: Node, name: str, blocks: dict[Component, Node]) -> AngleBasis:
        """A basis that is named but not defined: known by its name, and by the number of values."""
        count = len(_words(self.need(next(iter(blocks.values())), "ScatteringData")))
        for basis in (KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, OLD_HALF):
            if basis.name.lower() == name.lower() and basis.size**2 == count:
                self.odd(layer, f"{name} is not defined in the file, taken as {basis.size} patches")
                return basis
        raise self.error(layer, f"the basis {name!r} is not defined, and {count} values do not tell it")

    def _matrix(self, block: Node, basis: AngleBasis, rows: bool) -> Floats:
        """Matrix (outgoing, incident). Columns: the file runs through all incident patches of an outgoing one."""
        node = self.need(block, "ScatteringData")
        words = _words(node)
        if len(words) != basis.size**2:
            raise self.error(node, f"{len(words)} values; {basis.name} has {basis.size} x {basis.size}")
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError:
            bad = next(word for word in words if not is_number(word))
            raise self.error(node, f"{bad!r} is not a number") from None
        if not np.isfinite(values).all():
            raise self.error(node, "a value is not finite")
        if (values < 0).any():
            self.odd(node, f"{int((values < 0).sum())} negative value(s), read as 0")
        matrix = np.maximum(values, 0.0).reshape(basis.size, basis.size)
        return matrix.T.copy() if rows else matrix


def _words(node: Node) -> list[str]:
    return node.raw_text.replace(",", " ").split()
