"""EULUMDAT: round trips, symmetries, malformed files, and a reader that is not ours."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.photometry import Distribution
from analysis.photometry.eulumdat import parse_eulumdat, read_eulumdat
from analysis.photometry.eulumdat_write import render_eulumdat, write_eulumdat
from analysis.photometry.lm63_model import Opening
from labdaq.errors import DataError


def lobe(c_count: int = 16) -> Distribution:
    gamma = np.array([0, 5, 15, 25, 35, 45, 55, 65, 75, 85, 90.0])
    c = np.arange(c_count) * 360 / c_count
    g = np.radians(gamma)
    planes = 1000 * np.cos(g) * (1 + 0.5 * np.cos(np.radians(c - 70))[:, None] * np.sin(g))
    d = Distribution.closed(gamma, c, np.maximum(planes, 0))
    return Distribution(d.gamma_deg, d.c_deg, d.candela, {"TESTLAB": "Greenwood", "TEST": "27"})


def relative(symmetry: int, planes: str, intensities: list[float], **changes: str) -> bytes:
    """A file with three gammas; every intensity list entry is one plane's peak."""
    n = len(planes.split())
    head = {
        "id": "Lab", "type": "2", "sym": str(symmetry), "mc": str(n), "dc": f"{360 / n:g}", "ng": "3", "dg": "45",
        "report": "r", "name": "n", "number": "no", "file": "f", "date": "d",
        "size": "600\n600\n100", "lum": "600\n0\n0\n0\n0\n0", "dff": "100", "lorl": "22.8", "conv": "1", "tilt": "0",
        "lamps": "1\n2\nT5\n4000\n830\n1A\n80", "dr": "\n".join(["0.5"] * 10),
        "c": "\n".join(planes.split()), "g": "0\n45\n90",
        "i": "\n".join(f"{v}\n{v / 2}\n0" for v in intensities),
    }  # fmt: skip
    head |= changes
    return "\r\n".join("\n".join(head.values()).split("\n")).encode("latin-1")


def test_round_trip() -> None:
    d = lobe()
    back = parse_eulumdat(render_eulumdat(d, opening=Opening.disc(0.3556), watts=3))
    assert back.oddities == ()
    assert back.absolute
    assert back.symmetry == 0
    assert np.array_equal(back.distribution.gamma_deg, d.gamma_deg)
    assert np.array_equal(back.distribution.c_deg, d.c_deg)
    assert back.distribution.candela == pytest.approx(d.candela, rel=1e-7, abs=1e-4)
    assert back.flux_lm == pytest.approx(d.flux(), rel=1e-9)
    assert (back.opening, back.watts) == (Opening(-0.3556, -0.3556, 0), 3)
    assert back.distribution.keywords == {"LAB": "Greenwood", "TEST": "27"}


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 30), st.integers(2, 30), st.sampled_from([90.0, 180.0]), st.integers(0, 2**32 - 1))
def test_any_distribution_round_trips(n_c: int, n_g: int, top: float, seed: int) -> None:
    values = np.random.default_rng(seed).random((n_c, n_g)) * 1e4 + 1
    d = Distribution.closed(np.linspace(0, top, n_g), np.arange(n_c) * 360 / n_c, values)
    back = parse_eulumdat(render_eulumdat(d)).distribution
    assert back.candela == pytest.approx(d.candela, rel=1e-7)
    assert back.c_deg == pytest.approx(d.c_deg, abs=1e-6)


QUARTERS = "0 45 90 135 180 225 270 315"


@pytest.mark.parametrize(
    ("symmetry", "planes", "peaks", "all_peaks"),
    [
        (0, QUARTERS, [1, 2, 3, 4, 5, 6, 7, 8], [1, 2, 3, 4, 5, 6, 7, 8]),
        (2, QUARTERS, [1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 4, 3, 2]),
        (3, QUARTERS, [1, 2, 3, 4, 5], [3, 4, 5, 4, 3, 2, 1, 2]),  # stored from 270 through 0 to 90
        (4, QUARTERS, [1, 2, 3], [1, 2, 3, 2, 1, 2, 3, 2]),
        (1, QUARTERS, [6], [6] * 8),
    ],
)
def test_symmetries(symmetry: int, planes: str, peaks: list[float], all_peaks: list[float], tmp_path: Path) -> None:
    data = relative(symmetry, planes, peaks)
    d = parse_eulumdat(data).distribution
    flux_factor = 4000 / 1000  # the total flux of the lamp set, not per lamp
    assert d.at(0.0, np.arange(0, 360, 45.0)) == pytest.approx(np.array(all_peaks) * flux_factor)
    pyldt = pytest.importorskip("pyldt", reason="eulumdat-py is not installed")
    (tmp_path / "x.ldt").write_bytes(data)
    theirs = pyldt.LdtReader.read(tmp_path / "x.ldt")
    assert [row[0] for row in theirs.intensities] == all_peaks


def test_another_reader_reads_what_we_write(tmp_path: Path) -> None:
    pyldt = pytest.importorskip("pyldt", reason="eulumdat-py is not installed")
    d = lobe()
    path = tmp_path / "x.ldt"
    write_eulumdat(path, d)
    assert list(tmp_path.iterdir()) == [path]
    theirs = pyldt.LdtReader.read(path)
    candela = np.array(theirs.intensities) * theirs.header.lamp_flux[0] / 1000
    assert candela == pytest.approx(d.candela[:-1], rel=1e-6, abs=1e-4)
    assert theirs.header.g_angles == list(d.gamma_deg)
    assert (theirs.header.dg, theirs.header.dc) == (0, 22.5)  # 0, 5, 15 .. are not equidistant
    assert theirs.header.num_lamps == [-1]


def test_oddities() -> None:
    good = relative(1, "0", [100])
    assert parse_eulumdat(good).oddities == ()
    commas = parse_eulumdat(good.replace(b"50.0", b"50,0"))
    assert commas.distribution.at(45, 0) == pytest.approx(200)
    assert "decimal commas" in str(commas.oddities[0])
    two = parse_eulumdat(relative(1, "0", [100], lamps="2\n2\nT5\n4000\n830\n1A\n80\n1\nT8\n3000\n830\n1A\n40"))
    assert "2 lamp sets" in str(two.oddities[0])
    assert two.flux_lm == 4000
    assert "byte order mark" in str(parse_eulumdat(b"\xef\xbb\xbf" + good).oddities[0])
    dark = parse_eulumdat(relative(1, "0", [100], i="100\n-1\n0"))
    assert str(dark.oddities[0]).endswith("1 negative intensity value(s), kept") and dark.oddities[0].line == 48
    bright = parse_eulumdat(relative(1, "0", [400]))
    assert str(bright.oddities[0]).startswith("line 23: the light output ratio is 22.8 %")
    assert "hold 91.3" in str(bright.oddities[0])
    assert parse_eulumdat(relative(1, "0", [400], lorl="0")).oddities == ()
    assert "not 30 apart" in str(parse_eulumdat(relative(1, "0", [100], dg="30")).oddities[0])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "the file is empty"),
        (relative(1, "0", [100])[:-3], "line 48: the file ends here, before the intensity"),
        (relative(1, "0", [100]) + b"\r\n7", r"line 50: 1 line\(s\) more than announced"),
        (relative(0, QUARTERS, [1] * 8, sym="9"), "line 3: the symmetry indicator must be"),
        (relative(1, "0", [100], ng="3.5"), "line 6: the number of gammas must be a whole"),
        (relative(1, "0", [100], ng="900"), "line 6"),
        (relative(1, "0", [100], g="0\n95\n90"), "line 46: the gamma angles do not increase"),
        (relative(1, "0", [100], g="0\n45\n190"), "not within 0..180"),
        (relative(1, "0", [100], i="1\ntwo\n3"), "line 48: 'two' is not a number"),
        (relative(1, "0", [100], i="1\nnan\n3"), "line 48: 'nan' is not a plain number"),
        (relative(1, "0", [100], lamps="1\n2\nT5\n0\n830\n1A\n80"), "line 29: the total lamp flux"),
        (relative(1, "0", [100], conv="0"), "line 24: the conversion factor"),
        (relative(2, "0 120 240", [1, 2]), "3 C-planes do not go with symmetry 2"),
        (relative(4, "0 60 120 180 240 300", [1, 2]), "6 C-planes do not go with symmetry 4"),
        (relative(2, "0 45 90 135", [1, 2, 3]), "must be 180, not 90"),
        (b"\0\0", "zero byte"),
    ],
)
def test_malformed(data: bytes, reason: str) -> None:
    with pytest.raises(DataError, match=reason):
        parse_eulumdat(data)


def test_what_is_not_written() -> None:
    d = lobe()
    with pytest.raises(DataError, match="no light"):
        render_eulumdat(d.scaled(0))
    spoilt = Distribution(d.gamma_deg, d.c_deg, d.candela - 500, {"TEST": "x" * 100, "LUMINAIRE": "a\nb"})
    with pytest.raises(DataError, match=r"(?s)negative.*100 characters.*one line of Latin-1"):
        render_eulumdat(spoilt)
    with pytest.raises(DataError, match=r"nowhere\.ldt"):
        read_eulumdat("nowhere.ldt")
