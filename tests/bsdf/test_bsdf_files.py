"""LBNL BSDF files: round trips, the official schema, Radiance as the judge, real and malformed files."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from analysis.bsdf.basis import KLEMS_2X, KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, OLD_HALF, AngleBasis
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component, Material, travel_sign, with_z
from analysis.bsdf.prism import PrismSheet, prism_tracer
from analysis.bsdf.report import report
from analysis.bsdf.tally import klems_of
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.tree import tree_of
from analysis.bsdf.tree_tally import reciprocal_mean, tensor_tree_of
from analysis.bsdf.xml_read import parse_bsdf, read_bsdf
from analysis.bsdf.xml_write import render_bsdf, write_bsdf
from labdaq.errors import DataError

SHARED = next((p / "shared/data" for p in Path(__file__).parents if (p / "shared/data").is_dir()), Path("shared/data"))
DATA = SHARED / "bsdf"
SCHEMA = DATA / "BSDF-v1.7.7.xsd"
MATERIAL = Material("Lens <1> & more", "Us", 0.003, 0.6096, 0.6096)


def random_klems(basis: AngleBasis, seed: int = 0) -> KlemsBsdf:
    rng = np.random.default_rng(seed)
    return KlemsBsdf(basis, {c: rng.random((basis.size,) * 2) * 0.3 for c in Component}, MATERIAL)


def random_tree(rank: int, seed: int = 0) -> TensorTreeBsdf:
    rng = np.random.default_rng(seed)
    trees = {}
    for component in Component:
        dense = rng.random((8,) * rank) * 0.3
        if not component.transmits and rank == 4:
            dense = reciprocal_mean(dense)
        trees[component] = tree_of(dense, 50)
    return TensorTreeBsdf(trees, MATERIAL)


@pytest.mark.parametrize("basis", [KLEMS_FULL, KLEMS_HALF, KLEMS_QUARTER, KLEMS_2X], ids=lambda b: b.name)
def test_klems_round_trip(basis: AngleBasis) -> None:
    bsdf = random_klems(basis)
    back = parse_bsdf(render_bsdf(bsdf))
    assert back.oddities == ()
    assert back.bands == ("Visible",)
    assert isinstance(back.bsdf, KlemsBsdf)
    assert back.bsdf.basis == basis
    assert back.bsdf.material == MATERIAL
    for component in Component:
        assert np.allclose(back.bsdf.matrices[component], bsdf.matrices[component], rtol=1e-6, atol=0)


@pytest.mark.parametrize("rank", [3, 4])
def test_tensor_tree_round_trip(rank: int) -> None:
    bsdf = random_tree(rank)
    back = parse_bsdf(render_bsdf(bsdf)).bsdf
    assert isinstance(back, TensorTreeBsdf)
    a, b = np.random.default_rng(1).uniform(-0.7, 0.7, (2, 100, 2))
    for component in Component:
        assert back.evaluate(component, a, b) == pytest.approx(bsdf.evaluate(component, a, b), rel=1e-6)


@pytest.mark.skipif(not SCHEMA.is_file(), reason="the LBNL schema in shared/data/bsdf is not here")
@pytest.mark.parametrize("basis", [KLEMS_FULL, KLEMS_QUARTER], ids=lambda b: b.name)
def test_the_official_schema_finds_no_fault(basis: AngleBasis) -> None:
    xmlschema = pytest.importorskip("xmlschema", reason="xmlschema is not installed")
    schema = xmlschema.XMLSchema(str(SCHEMA))
    plain = KlemsBsdf(basis, random_klems(basis).matrices)
    for bsdf in (random_klems(basis), plain):
        assert [str(e) for e in schema.iter_errors(render_bsdf(bsdf).decode())] == []
    # the test of the test: the schema does find what real files get wrong
    spoilt = render_bsdf(random_klems(basis)).decode().replace('unit="Millimeter"', 'unit="millimeter"')
    assert list(schema.iter_errors(spoilt))


def judge(*command: str) -> str:
    """Output of a Radiance program."""
    pyradiance = pytest.importorskip("pyradiance", reason="pyradiance is not installed")
    program = Path(pyradiance.__file__).parent / "bin" / command[0]
    return subprocess.run([program, *command[1:]], capture_output=True, text=True, check=True).stdout


QUERY = """
import json, sys, pyradiance.bsdf as b
data = b.load_file(sys.argv[1])
print(json.dumps([float(b.query(data, *angles)[1]) for angles in json.load(sys.stdin)]))
"""


def radiance_values(path: Path, component: Component, incident: np.ndarray, outgoing: np.ndarray) -> np.ndarray:
    """What Radiance's library says; it takes vectors that point away from the surface, as theta and phi in degrees."""
    sign = travel_sign(component.incidence)
    vectors = [-with_z(incident, sign), with_z(outgoing, sign if component.transmits else -sign)]
    angles = []
    for v in vectors:
        angles += [
            np.degrees(np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2])),
            np.degrees(np.arctan2(v[:, 1], v[:, 0])),
        ]
    rows = np.stack(angles, axis=1).tolist()
    # in a process of its own: the extension is not ours to trust with this one's life
    done = subprocess.run(
        [sys.executable, "-c", QUERY, str(path)], input=json.dumps(rows), capture_output=True, text=True, check=True
    )
    return np.array(json.loads(done.stdout))


@pytest.mark.parametrize("form", ["full", "half", "quarter", "2x", "tree3", "tree4"])
def test_radiance_evaluates_our_files_as_we_do(form: str, tmp_path: Path) -> None:
    pytest.importorskip("pyradiance", reason="pyradiance is not installed")
    bases = {"full": KLEMS_FULL, "half": KLEMS_HALF, "quarter": KLEMS_QUARTER, "2x": KLEMS_2X}
    bsdf = random_klems(bases[form]) if form in bases else random_tree(int(form[-1]))
    path = tmp_path / "x.xml"
    write_bsdf(path, bsdf)
    assert list(tmp_path.iterdir()) == [path]
    incident, outgoing = np.random.default_rng(2).uniform(-0.7, 0.7, (2, 60, 2))
    for component in Component:
        ours = bsdf.evaluate(component, incident, outgoing)
        theirs = radiance_values(path, component, incident, outgoing)
        # Radiance perturbs values by up to 3e-4 by position (bsdf_m.c, bsdf_t.c), and keeps them as float
        assert theirs == pytest.approx(ours, rel=4e-4)


def test_checkbsdf_on_the_sheet(tmp_path: Path) -> None:
    sheet = prism_tracer(PrismSheet())
    rng = np.random.default_rng(3)
    klems = klems_of(sheet, rng, rays=2000, material=MATERIAL)
    write_bsdf(tmp_path / "klems.xml", klems)
    said = judge("checkBSDF", str(tmp_path / "klems.xml"))
    assert "Klems_Full" in said
    assert "Lens <1> & more" in said
    theirs = {line.split("\t")[0]: line for line in said.splitlines()}
    most = 100 * klems.hemispherical_by_patch(Component.TF).max()
    assert float(theirs["Ext->Int Trans"].split("%")[0].split()[-1]) == pytest.approx(most, abs=0.1)
    tree = tensor_tree_of(sheet, rng, depth=4, rays=300, material=MATERIAL)
    write_bsdf(tmp_path / "tree.xml", tree)
    said = judge("checkBSDF", str(tmp_path / "tree.xml"))
    assert "Anisotropic_Tensor_Tree" in said
    tops = [float(line.split("%")[0].split()[-1]) for line in said.splitlines() if "Trans\t" in line and "%" in line]
    assert tops
    assert max(tops) < 100
    isotropic = tensor_tree_of(sheet, rng, rank=3, depth=4, rays=1000)
    write_bsdf(tmp_path / "iso.xml", isotropic)
    assert "Isotropic_Tensor_Tree" in judge("checkBSDF", str(tmp_path / "iso.xml"))


@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings in shared/data/bsdf are not here")
def test_real_files() -> None:
    fabric = read_bsdf(DATA / "2011-SA1.XML")
    assert fabric.oddities == ()
    assert fabric.bands == ("Visible", "Solar")
    assert fabric.bsdf.material.thickness_m == pytest.approx(0.001)
    assert isinstance(fabric.bsdf, KlemsBsdf)
    laws = report(fabric.bsdf)
    assert laws.total_front.max() < 1
    solar = read_bsdf(DATA / "2011-SA1.XML", band="solar")
    assert isinstance(solar.bsdf, KlemsBsdf)
    assert solar.bsdf.diffuse(Component.RF) != fabric.bsdf.diffuse(Component.RF)
    shade = read_bsdf(DATA / "klems_aniso_high.xml")
    assert "<Thickness> is empty" in shade.oddities[0]
    with pytest.raises(DataError, match="no data for Infrared; the file holds Visible, Solar"):
        read_bsdf(DATA / "2011-SA1.XML", band="Infrared")


@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings in shared/data/bsdf are not here")
@pytest.mark.parametrize("name", ["2011-SA1.XML", "klems_aniso_high.xml"])
def test_radiance_reads_real_files_as_we_do(name: str) -> None:
    pytest.importorskip("pyradiance", reason="pyradiance is not installed")
    bsdf = read_bsdf(DATA / name).bsdf
    incident, outgoing = np.random.default_rng(4).uniform(-0.7, 0.7, (2, 60, 2))
    for component in Component:
        theirs = radiance_values(DATA / name, component, incident, outgoing)
        assert theirs == pytest.approx(bsdf.evaluate(component, incident, outgoing), rel=1e-3, abs=1e-5)


SMALL = KlemsBsdf(KLEMS_QUARTER, {Component.TF: random_klems(KLEMS_QUARTER).matrices[Component.TF]}, MATERIAL)
GOOD = render_bsdf(SMALL)


def test_oddities() -> None:
    def odd(data: bytes) -> str:
        return "; ".join(parse_bsdf(data).oddities)

    assert odd(GOOD) == ""
    assert "unit 'millimeter'" in odd(GOOD.replace(b'unit="Millimeter">3<', b'unit="millimeter">3<'))
    assert parse_bsdf(GOOD.replace(b'unit="Millimeter">3<', b'unit="millimeter">3<')).bsdf.material.thickness_m == 0.003
    assert "unit ''" in odd(GOOD.replace(b'<Thickness unit="Millimeter">', b"<Thickness>"))
    first = GOOD.split(b"<ScatteringData>")[1].split()[0]
    negative = parse_bsdf(GOOD.replace(b"<ScatteringData>\n" + first, b"<ScatteringData>\n-1e-5"))
    assert "1 negative value(s), read as 0" in negative.oddities[0]
    commas = parse_bsdf(GOOD.replace(b" 0.", b", 0.")).bsdf
    assert isinstance(commas, KlemsBsdf)
    assert commas.matrices[Component.TF] == pytest.approx(SMALL.matrices[Component.TF], rel=1e-6)
    bare = GOOD[: GOOD.index(b"\t\t<AngleBasis>")] + GOOD[GOOD.index(b"</AngleBasis>\n") + len(b"</AngleBasis>\n") :]
    assert "is not defined in the file, taken as 41 patches" in odd(bare)


def test_rows_are_transposed() -> None:
    rows = parse_bsdf(GOOD.replace(b">Columns<", b">Rows<")).bsdf
    assert isinstance(rows, KlemsBsdf)
    assert rows.matrices[Component.TF] == pytest.approx(SMALL.matrices[Component.TF].T, rel=1e-6)


def test_an_old_basis_of_the_same_name_keeps_its_own_bounds() -> None:
    """Half bases of 73 patches are about; Radiance 6 takes 77 by that name and would read rubbish."""
    old = KlemsBsdf(OLD_HALF, {Component.TF: np.random.default_rng(5).random((73, 73))})
    with pytest.raises(DataError, match="77 patches of its own"):
        render_bsdf(old)
    text = render_bsdf(KlemsBsdf(AngleBasis("mine", OLD_HALF.theta_bounds_deg, OLD_HALF.n_phi), old.matrices))
    back = parse_bsdf(text.replace(b">mine<", b">LBNL/Klems Half<"))
    assert isinstance(back.bsdf, KlemsBsdf)
    assert back.bsdf.basis.n_phi == OLD_HALF.n_phi
    assert "not what Radiance 6 takes" in back.oddities[0]


def cut(data: bytes, tag: bytes) -> bytes:
    start = data.index(b"<" + tag)
    return data[:start] + data[data.index(b"</" + tag + b">") + len(tag) + 3 :]


MALFORMED = {
    "no XML": (b"hello", "line 1: syntax error"),
    "messages before it": (b"Recover using: genBSDF\n<a/>", "line 1: 'Recover using: genBSDF' stands before"),
    "cut": (GOOD[:2000], "line .*: no element found|unclosed token"),
    "empty": (b"", "no element found"),
    "something else": (b"<a/>", "line 1: the file is <a>"),
    "doctype": (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "DOCTYPE"),
    "a word": (GOOD.replace(b"\n0.", b"\nabc0.", 1), "not a number"),
    "nan": (GOOD.replace(b"<ScatteringData>\n0", b"<ScatteringData>\nnan 0", 1), "values|finite"),
    "no data": (cut(GOOD, b"ScatteringData"), "line .*: <WavelengthDataBlock> holds no <ScatteringData>"),
    "no direction": (cut(GOOD, b"WavelengthDataDirection"), "holds no <WavelengthDataDirection>"),
    "no structure": (cut(GOOD, b"IncidentDataStructure"), "<Layer> holds no <DataDefinition/IncidentDataStructure>"),
    "structure": (GOOD.replace(b">Columns<", b">Heap<"), "'Heap' is not known"),
    "bounds": (GOOD.replace(b"<LowerTheta>9<", b"<LowerTheta>8<"), "ring starts at 8, but the one before ends at 9"),
    "theta": (GOOD.replace(b"<UpperTheta>9<", b"<UpperTheta>nine<"), "is 'nine', not a number"),
    "90": (GOOD.replace(b"<UpperTheta>90<", b"<UpperTheta>80<"), "must cover 0 to 90"),
    "thickness": (GOOD.replace(b">3</Thickness>", b">thin</Thickness>"), "<Thickness> is 'thin'"),
    "other basis": (GOOD.replace(b"<RowAngleBasis>LBNL/Klems Quarter", b"<RowAngleBasis>LBNL/Klems Full"), "different"),
    "unknown basis": (GOOD.replace(b"AngleBasis>LBNL/Klems Quarter", b"AngleBasis>Mine"), "'Mine' is not defined"),
    "twice": (
        GOOD.replace(b"</WavelengthDataBlock>", b"</WavelengthDataBlock>" + GOOD.split(b"<WavelengthData>")[1]
                     .split(b"</WavelengthData>")[0].split(b".dsp</DetectorSpectrum>")[1]),
        "Transmission Front stands there twice",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed(name: str) -> None:
    data, reason = MALFORMED[name]
    assert data != GOOD
    with pytest.raises(DataError, match=reason):
        parse_bsdf(data)


def test_a_matrix_with_one_value_missing_is_refused() -> None:
    start = GOOD.index(b"<ScatteringData>") + len(b"<ScatteringData>\n")
    end = GOOD.index(b" ", start)
    with pytest.raises(DataError, match=r"line \d+: 1680 values; LBNL/Klems Quarter has 41 x 41"):
        parse_bsdf(GOOD[:start] + GOOD[end:])


def test_what_is_not_written(tmp_path: Path) -> None:
    bad = KlemsBsdf(KLEMS_QUARTER, SMALL.matrices, Material(device="Window", thickness_m=-1))
    with pytest.raises(DataError, match=r"(?s)device.*thickness_m"):
        write_bsdf(tmp_path / "x.xml", bad)
    assert list(tmp_path.iterdir()) == []
