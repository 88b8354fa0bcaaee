"""Write LBNL BSDF files, strictly: Klems matrices that validate against the schema 1.7.7, tensor trees for Radiance.

The schema has no word for tensor trees (its data structure is ``Columns`` only); Radiance's own layout is written.
"""

from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape

from analysis.bsdf.basis import KNOWN, AngleBasis
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Floats, Material
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree_text import render_tree
from labdaq.errors import DataError, Problems
from labdaq.whole_file import write_whole_bytes

DEVICE_TYPES = frozenset(
    {
        "Venetian blind horizontal",
        "Venetian blind vertical",
        "Woven shade",
        "Diffusing glass",
        "Specular glass",
        "Fritted Glass",
        "Cellular Shade",
        "Pleated Shade",
        "Solid Layer",
        "Other",
    }
)
"""Device types the schema allows."""

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<WindowElement xmlns="http://windows.lbl.gov" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:schemaLocation="http://windows.lbl.gov BSDF-v1.7.7.xsd">
<WindowElementType>System</WindowElementType>
<FileType>BSDF</FileType>
<Optical>
<Layer>"""
_TAIL = """</Layer>
</Optical>
</WindowElement>"""


def write_bsdf(path: Path | str, bsdf: KlemsBsdf | TensorTreeBsdf) -> None:
    """Write a BSDF file for the visible band, beside its name and renamed.

    Raises
    ------
    DataError
        The material or the basis cannot be written; all reasons are listed.
    StorageError
        The disk refused.
    """
    write_whole_bytes(Path(path), render_bsdf(bsdf, str(path)))


def render_bsdf(bsdf: KlemsBsdf | TensorTreeBsdf, source: str = "BSDF data") -> bytes:
    """The bytes `write_bsdf` writes; same errors."""
    problems = Problems(source)
    _check_material(bsdf.material, problems)
    if isinstance(bsdf, KlemsBsdf):
        _check_basis(bsdf.basis, problems)
    problems.raise_if_any(DataError)
    return ("\n".join(_document(bsdf)) + "\n").encode("utf-8")


def _check_material(material: Material, problems: Problems) -> None:
    if material.device not in DEVICE_TYPES:
        problems.add("device", f"{material.device!r} is none of {', '.join(sorted(DEVICE_TYPES))}")
    for name in ("thickness_m", "width_m", "height_m"):
        value = getattr(material, name)
        if value is not None and not value >= 0.0:
            problems.add(name, f"must not be negative, {value:g} is")


def _check_basis(basis: AngleBasis, problems: Problems) -> None:
    usual = KNOWN.get(basis.name)
    if usual is not None and usual != basis:
        problems.add(
            "basis",
            f"{basis.name} with {basis.size} patches: Radiance 6 takes {usual.size} patches of its own by that name; "
            "convert first",
        )


def _document(bsdf: KlemsBsdf | TensorTreeBsdf) -> Iterator[str]:
    yield _HEAD
    yield from _material(bsdf.material)
    yield "\t<DataDefinition>"
    if isinstance(bsdf, KlemsBsdf):
        yield "\t\t<IncidentDataStructure>Columns</IncidentDataStructure>"
        yield from _basis(bsdf.basis)
    else:
        yield f"\t\t<IncidentDataStructure>TensorTree{bsdf.rank}</IncidentDataStructure>"
    yield "\t</DataDefinition>"
    for component in Component:
        if component in bsdf.components():
            yield from _block(bsdf, component)
    yield _TAIL


def _material(material: Material) -> Iterator[str]:
    yield "\t<Material>"
    yield f"\t\t<Name>{escape(material.name)}</Name>"
    yield f"\t\t<Manufacturer>{escape(material.manufacturer)}</Manufacturer>"
    lengths = (("Thickness", material.thickness_m), ("Width", material.width_m), ("Height", material.height_m))
    for tag, value in lengths:
        if value is not None:
            yield f'\t\t<{tag} unit="Millimeter">{value * 1000.0:.7g}</{tag}>'
    yield f"\t\t<DeviceType>{material.device}</DeviceType>"
    yield "\t</Material>"


def _basis(basis: AngleBasis) -> Iterator[str]:
    yield "\t\t<AngleBasis>"
    yield f"\t\t\t<AngleBasisName>{escape(basis.name)}</AngleBasisName>"
    bounds = basis.theta_bounds_deg
    for ring, count in enumerate(basis.n_phi):
        low, high = bounds[ring], bounds[ring + 1]
        theta = 0.0 if ring == 0 and count == 1 else (low + high) / 2.0
        yield "\t\t\t<AngleBasisBlock>"
        yield f"\t\t\t\t<Theta>{theta:g}</Theta>"
        yield f"\t\t\t\t<nPhis>{count}</nPhis>"
        yield "\t\t\t\t<ThetaBounds>"
        yield f"\t\t\t\t\t<LowerTheta>{low:g}</LowerTheta>"
        yield f"\t\t\t\t\t<UpperTheta>{high:g}</UpperTheta>"
        yield "\t\t\t\t</ThetaBounds>"
        yield "\t\t\t</AngleBasisBlock>"
    yield "\t\t</AngleBasis>"


def _block(bsdf: KlemsBsdf | TensorTreeBsdf, component: Component) -> Iterator[str]:
    yield "\t<WavelengthData>"
    yield "\t\t<LayerNumber>System</LayerNumber>"
    yield '\t\t<Wavelength unit="Integral">Visible</Wavelength>'
    yield "\t\t<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>"
    yield "\t\t<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>"
    yield "\t\t<WavelengthDataBlock>"
    yield f"\t\t\t<WavelengthDataDirection>{component.value}</WavelengthDataDirection>"
    if isinstance(bsdf, KlemsBsdf):
        yield f"\t\t\t<ColumnAngleBasis>{escape(bsdf.basis.name)}</ColumnAngleBasis>"
        yield f"\t\t\t<RowAngleBasis>{escape(bsdf.basis.name)}</RowAngleBasis>"
    else:
        yield "\t\t\t<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"
    yield "\t\t\t<ScatteringDataType>BTDF</ScatteringDataType>"
    yield "\t\t\t<ScatteringData>"
    if isinstance(bsdf, KlemsBsdf):
        yield from _rows(bsdf.matrices[component])
    else:
        yield render_tree(bsdf.trees[component]).rstrip("\n")
    yield "\t\t\t</ScatteringData>"
    yield "\t\t</WavelengthDataBlock>"
    yield "\t</WavelengthData>"


def _rows(matrix: Floats) -> Iterator[str]:
    """A line for each outgoing patch."""
    for row in matrix.tolist():
        yield " ".join(f"{value:.7g}" for value in row)
