"""LM-63: round trips, what is odd, what other programs make of our files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.photometry import Distribution
from analysis.photometry.closing import Row90, closed_at_90
from analysis.photometry.goniometry import PhotometricType, to_type, type_angles, type_vector
from analysis.photometry.lm63 import (
    Edition,
    FileGeneration,
    Opening,
    Tilt,
    parse_lm63,
    read_lm63,
    render_lm63,
    write_lm63,
)
from analysis.photometry.testdata import TestData
from labdaq.errors import DataError
from tests.photometry.lamps import KEYWORDS, lopsided

SHARED = next((p / "shared/data" for p in Path(__file__).parents if (p / "shared/data").is_dir()), Path("shared/data"))
REAL = SHARED / "ies"


def text_of(**changes: object) -> list[str]:
    """Lines of a valid 2002 file to spoil."""
    lines = {
        "edition": "IESNA:LM-63-2002",
        "test": "[TEST] 1",
        "lab": "[TESTLAB] here",
        "date": "[ISSUEDATE] today",
        "maker": "[MANUFAC] us",
        "tilt": "TILT=NONE",
        "lamp": "1 -1 1 3 2 1 2 0 0 0",
        "ballast": "1 1 10",
        "v": "0 45 90",
        "h": "0 360",
        "p1": "10 5 0",
        "p2": "10 5 0",
    }
    lines |= {key: str(value) for key, value in changes.items()}
    return [line for line in lines.values() if line != ""]


def parse(lines: list[str], end: str = "\r\n"):  # type: ignore[no-untyped-def]
    return parse_lm63((end.join(lines) + end).encode("latin-1"))


angle_steps = st.integers(1, 12)


@st.composite
def distributions(draw: st.DrawFn) -> Distribution:
    gamma = np.linspace(0, draw(st.sampled_from([90.0, 180.0])), draw(angle_steps) + 1)
    c = np.linspace(0, 360, draw(angle_steps) + 1)
    intensity = st.floats(0, 1e7, allow_subnormal=False)
    planes = np.array(draw(st.lists(intensity, min_size=gamma.size * (c.size - 1), max_size=gamma.size * (c.size - 1))))
    planes = planes.reshape(c.size - 1, gamma.size)
    text = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=600).map(str.strip)
    keys = st.from_regex(r"_[A-Z0-9]{1,17}", fullmatch=True)
    keywords = KEYWORDS | draw(st.dictionaries(keys, text, max_size=4))
    return Distribution(gamma, c, np.concatenate([planes, planes[:1]]), keywords)


@settings(max_examples=60, deadline=None)
@given(distributions(), st.sampled_from([Edition.E2002, Edition.E2019]))
def test_what_is_written_reads_back_bit_for_bit(d: Distribution, edition: Edition) -> None:
    data = render_lm63(d, generation=FileGeneration.SIMULATED, edition=edition, digits=17)
    back = parse_lm63(data)
    assert back.oddities == ()
    assert back.edition is edition
    assert np.array_equal(back.distribution.gamma_deg, d.gamma_deg)
    assert np.array_equal(back.distribution.c_deg, d.c_deg)
    assert np.array_equal(back.distribution.candela, d.candela)
    folded = {key: value.replace("\n", "") for key, value in back.distribution.keywords.items()}
    # long values are broken at [MORE], where a blank at the break is lost
    assert {k: v.replace(" ", "") for k, v in folded.items()} == {k: v.replace(" ", "") for k, v in d.keywords.items()}
    assert all(len(line) <= 254 for line in data.decode("ascii").split("\r\n"))
    assert data.count(b"\r\n") == data.count(b"\n")


@pytest.mark.parametrize("generation", list(FileGeneration))
def test_the_generation_type_is_a_bit_string(generation: FileGeneration) -> None:
    data = render_lm63(lopsided(), generation=generation)
    record = data.decode().split("\r\n")[data.decode().split("\r\n").index("TILT=NONE") + 2]
    assert record.split()[1] == generation.value
    assert len(record.split()[1]) == 7
    assert parse_lm63(data).generation is generation


def test_a_reformatted_generation_type_is_understood_and_noted() -> None:
    data = render_lm63(lopsided(), generation=FileGeneration.MEASURED_INTERPOLATED).replace(b"1.01000", b"1.01")
    back = parse_lm63(data)
    assert back.generation is FileGeneration.MEASURED_INTERPOLATED
    assert "1.01" in str(back.oddities[0])


def test_measured_types() -> None:
    assert FileGeneration.measured() == "1.00000"
    assert FileGeneration.measured(interpolated=True) == "1.01000"
    assert FileGeneration.measured(accredited=True, interpolated=True, scaled=True) == "1.11100"


def test_the_open_report_grid_is_refused_with_all_reasons(tmp_path: Path) -> None:
    d = lopsided(row=None)
    d = Distribution(d.gamma_deg, d.c_deg, d.candela, {"TEST": "1", "LUMENS": "x", "_note": "y", "_CITY": "Zürich"})
    with pytest.raises(DataError) as caught:
        write_lm63(tmp_path / "x.ies", d, generation=FileGeneration.MEASURED)
    for reason in ("ends at 85", "[TESTLAB]", "[ISSUEDATE]", "[MANUFAC]", "[LUMENS]", "[_note]", "ü"):
        assert reason in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_negative_and_open_planes_are_refused() -> None:
    d = lopsided()
    spoilt = d.candela.copy()
    spoilt[3, 2] = -1
    spoilt[-1] *= 2
    with pytest.raises(DataError, match=r"(?s)differs from the plane at 0.*gamma 15, C 67.5"):
        render_lm63(Distribution(d.gamma_deg, d.c_deg, spoilt, KEYWORDS), generation=FileGeneration.MEASURED)
    with pytest.raises(DataError, match="read only"):
        render_lm63(d, generation=FileGeneration.MEASURED, edition=Edition.E1995)


def test_closing() -> None:
    d = lopsided(row=None)
    assert np.all(closed_at_90(d, Row90.ZERO).candela[:, -1] == 0)
    line = closed_at_90(d, Row90.EXTRAPOLATED)
    assert line.candela[:, -1] == pytest.approx(np.maximum(0, 1.5 * d.candela[:, -1] - 0.5 * d.candela[:, -2]))
    assert line.keywords["_ROW90"].startswith("extrapolated")
    assert closed_at_90(line) is line


def test_test_data_round_trip() -> None:
    data = TestData(
        sun_altitude_deg=53.25, sun_azimuth_deg=101.5, global_lx=98765.4, diffuse_lx=12000, sky="clear", distance_m=2.6,
        field="near", start_utc="2010-07-22T13:12:00.000Z",
    )  # fmt: skip
    d = lopsided()
    d = Distribution(d.gamma_deg, d.c_deg, d.candela, KEYWORDS | data.keywords())
    back = parse_lm63(render_lm63(d, generation=FileGeneration.MEASURED)).distribution.keywords
    assert TestData.from_keywords(back) == data
    assert back["NEARFIELD"] == "2.6 2.6 2.6"
    assert back["_HANDEDNESS"].startswith("counter-clockwise")
    with pytest.raises(DataError, match="_SUNALT"):
        TestData.from_keywords({"_SUNALT": "high"})


def test_multiplier_ballast_and_lamp_factor_by_edition() -> None:
    def peak(edition: str) -> float:
        lines = text_of(edition=edition, lamp="1 1000 2 3 2 1 1 0 0 0", ballast="0.5 0.25 10")
        return float(parse(lines).distribution.candela.max())

    assert peak("IESNA:LM-63-2002") == 10  # 10 x 2 x 0.5; the third field is unused
    assert peak("IESNA:LM-63-1995") == 10
    assert peak("IESNA91") == 2.5  # it is the ballast-lamp photometric factor there
    assert peak("") == 2.5


def test_units_and_lumens() -> None:
    feet = parse(text_of(lamp="2 1500 1 3 2 1 1 2 -1 .5"))
    assert feet.opening == Opening(0.6096, -0.3048, 0.1524)
    assert (feet.lamps, feet.lumens_per_lamp) == (2, 1500.0)
    assert parse(text_of()).lumens_per_lamp is None


def test_tilt_include_and_file() -> None:
    lines = text_of(tilt="TILT=INCLUDE\r\n1\r\n3\r\n0 45 90\r\n1 .9 .8")
    tilt = parse(lines).tilt
    assert (tilt.source, tilt.lamp_geometry, list(tilt.angle_deg)) == ("INCLUDE", 1, [0, 45, 90])
    assert list(tilt.factor) == [1, 0.9, 0.8]
    named = parse(text_of(tilt="TILT=LAMP.TLT"))
    assert named.tilt.source == "LAMP.TLT"
    assert any("another file" in o.what for o in named.oddities)
    d = lopsided()
    again = parse_lm63(render_lm63(d, generation=FileGeneration.MEASURED, tilt=tilt)).tilt
    assert np.array_equal(again.factor, tilt.factor)
    with pytest.raises(DataError, match="TILT"):
        render_lm63(d, generation=FileGeneration.MEASURED, tilt=Tilt("LAMP.TLT"))


@pytest.mark.parametrize(
    ("planes", "expected"),
    [
        ("0", {0: 10, 90: 10, 217: 10}),
        ("0 90", {0: 10, 90: 20, 180: 10, 270: 20, 45: 15, 225: 15}),
        ("0 90 180", {0: 10, 90: 20, 180: 30, 270: 20, 135: 25, 225: 25}),
        ("0 180 360", {0: 10, 180: 20, 270: 25}),
        ("90 180 270", {90: 10, 180: 20, 270: 30, 0: 20, 45: 15, 315: 25}),
        ("0 120 240", {0: 10, 120: 20, 240: 30, 300: 20}),  # the missing 360 is the plane at 0
        ("33", {0: 10, 180: 10}),
    ],
)
def test_symmetries(planes: str, expected: dict[float, float]) -> None:
    n = len(planes.split())
    rows = "\r\n".join(f"{10 * (i + 1)} {10 * (i + 1)} 0" for i in range(n))
    d = parse(text_of(lamp=f"1 -1 1 3 {n} 1 2 0 0 0", h=planes, p1=rows, p2="")).distribution
    assert {c: float(d.at(20, c)) for c in expected} == pytest.approx(expected)


@given(st.sampled_from(list(PhotometricType)), st.floats(-90, 90), st.floats(-89, 89))
def test_goniometer_angles_round_trip(kind: PhotometricType, v: float, h: float) -> None:
    if kind is PhotometricType.C:
        v, h = v + 90, h % 360
    vector = type_vector(kind, v, h)
    assert np.linalg.norm(vector) == pytest.approx(1)
    assert type_vector(kind, *type_angles(kind, vector)) == pytest.approx(vector, abs=1e-12)


def test_axes_of_the_three_types() -> None:
    down, north, west = (0, 0, -1), (0, 1, 0), (-1, 0, 0)
    for kind, nadir, horizontal in (("C", (0, 0), (90, 0)), ("B", (0, 0), (90, 0)), ("A", (-90, 0), (0, 0))):
        assert type_vector(PhotometricType[kind], *nadir) == pytest.approx(down, abs=1e-15)
        assert type_vector(PhotometricType[kind], *horizontal) == pytest.approx(north, abs=1e-15)
    # horizontal angles: counter-clockwise from above in C, clockwise in A and B
    assert type_vector(PhotometricType.C, 90, 90) == pytest.approx(west, abs=1e-15)
    assert type_vector(PhotometricType.A, 0, -90) == pytest.approx(west, abs=1e-15)
    assert type_vector(PhotometricType.B, 0, -90) == pytest.approx(west, abs=1e-15)


@pytest.mark.parametrize("kind", [PhotometricType.A, PhotometricType.B])
def test_type_a_and_b_files_become_type_c(kind: PhotometricType) -> None:
    source = lopsided()
    v, h = np.arange(-90, 91, 2.0), np.arange(-90, 91, 2.0)
    table = to_type(kind, source, v, h)
    rows = "\r\n".join(" ".join(f"{x:.9g}" for x in row) for row in table)
    lines = text_of(
        lamp=f"1 -1 1 {v.size} {h.size} {int(kind)} 2 0 0 0",
        v=" ".join(map(str, v)), h=" ".join(map(str, h)), p1=rows, p2="",
    )  # fmt: skip
    back = parse(lines).distribution
    gamma, c = np.meshgrid(np.arange(5, 86, 10.0), [0, 30, 60, 300, 330])  # what both types cover in front
    # two bilinear interpolations of a lobe with 10 and 22.5 degree cells: within 1.5 % of the peak
    assert np.abs(back.at(gamma, c) - source.at(gamma, c)).max() < 15


def test_half_type_b_table_is_mirrored() -> None:
    lines = text_of(lamp="1 -1 1 3 3 2 2 0 0 0", v="-90 0 90", h="0 45 90", p1="0 9 0\r\n0 4 0\r\n0 1 0", p2="")
    d = parse(lines).distribution
    assert d.at(45, 90) == pytest.approx(4, abs=0.1)
    assert d.at(45, 270) == pytest.approx(4, abs=0.1)


def oddity_of(data: bytes) -> str:
    return "; ".join(str(o) for o in parse_lm63(data).oddities)


def test_oddities_name_their_lines() -> None:
    good = ("\r\n".join(text_of()) + "\r\n").encode()
    assert oddity_of(good) == ""
    assert "line 1: lines end with LF" in oddity_of(good.replace(b"\r\n", b"\n"))
    assert "CR only" in oddity_of(good.replace(b"\r\n", b"\r"))
    assert "byte order mark" in oddity_of(b"\xef\xbb\xbf" + good)
    assert "UTF-16" in oddity_of(good.decode().encode("utf-16"))
    assert "Ctrl-Z" in oddity_of(good + b"\x1a")
    assert "line 1: edition written as" in oddity_of(good.replace(b"IESNA:LM", b"IESNA: LM"))
    assert "line 6: the TILT line" in oddity_of(good.replace(b"TILT=NONE", b"TILT= NONE"))
    assert "line 3: characters beyond ASCII" in oddity_of(good.replace(b"here", "hér".encode("latin-1")))
    assert "line 3: keyword [TestLab]" in oddity_of(good.replace(b"[TESTLAB]", b"[TestLab]"))
    assert "line 3: keyword [LAB]" in oddity_of(good.replace(b"[TESTLAB]", b"[LAB]"))
    assert "missing or empty: [MANUFAC]" in oddity_of(good.replace(b"[MANUFAC] us\r\n", b""))
    assert "line 9: the vertical angles end at 85" in oddity_of(good.replace(b"45 90", b"45 85"))
    assert "line 12: the planes C = 0 and C = 360 differ" not in oddity_of(good)
    assert "differ" in oddity_of(good[:-3] + b"1\r\n")
    assert "line 7: the ballast record" in oddity_of(good.replace(b"0 0 0\r\n1 1", b"0 0 0 1 1"))
    assert "text after the last candela" in oddity_of(good + b"END OF DATA 3\r\n")
    assert "line 8: the field for future use" in oddity_of(good.replace(b"1 1 10", b"1 1.1 10"))
    assert "line 11: 1 negative" in oddity_of(good.replace(b"10 5 0\r\n10", b"10 -5 0\r\n10", 1))
    assert "decimal commas" in oddity_of(good.replace(b"10 5 0", b"10,25 5,5 0,0"))


def test_commas() -> None:
    separated = parse(text_of(lamp="1,-1,1,3,2,1,2,0,0,0", v="0, 45, 90", p1="10,5,0"))
    assert separated.oddities == ()
    assert list(separated.distribution.candela[0]) == [10, 5, 0]
    pointed = parse(text_of(p1="10,25 5,5 0,0", p2="10,25 5,5 0,0"))
    assert list(pointed.distribution.candela[0]) == [10.25, 5.5, 0]


def test_keywords_more_and_repeated() -> None:
    lines = text_of(maker="[MANUFAC] us\r\n[MORE] and them\r\n[OTHER] a\r\n[OTHER] b\r\n[_MINE] 1")
    keywords = parse(lines).distribution.keywords
    assert keywords["MANUFAC"] == "us\nand them"
    assert keywords["OTHER"] == "a\nb"
    assert keywords["_MINE"] == "1"


def test_1986_labels() -> None:
    file = parse(text_of(edition="", test="A LUMINAIRE", lab="", date="1x400 W", maker="", ballast="1 1 400"))
    assert file.edition is Edition.E1986
    assert file.labels == ("A LUMINAIRE", "1x400 W")
    assert file.oddities == ()


MALFORMED = {
    "no TILT": (text_of(tilt=""), r"no line starts with TILT="),
    "ends early": (text_of(p2="10 5"), r"line 12: the file ends here, before the 3 \+ 2 angles and 3 x 2 candelas"),
    "ends in header": (text_of(ballast="1", v="", h="", p1="", p2=""), "line 8: the file ends here"),
    "too many": (text_of(p2="10 5 0 7"), "line 12: 1 number.s. more than the 3 x 2"),
    "a word": (text_of(p1="10 five 0"), "line 11: 'five' is not a number"),
    "underscore": (text_of(p1="1_0 5 0"), "line 11: '1_0' is not a number"),
    "nan": (text_of(p2="10 nan 0"), "line 12: 'nan' is not a finite"),
    "inf": (text_of(p2="10 1e999 0"), "line 12: '1e999' is not a finite"),
    "fortran": (text_of(p2="1.0D1 5 0"), r"line 12: '1.0D1'"),
    "counts swapped": (text_of(lamp="1 -1 1 2 3 1 2 0 0 0"), "line 10: the horizontal angles do not increase"),
    "one vertical": (text_of(lamp="1 -1 1 1 2 1 2 0 0 0"), r"line 7: 1 vertical angle"),
    "no horizontal": (text_of(lamp="1 -1 1 3 0 1 2 0 0 0"), "line 7: 0 horizontal"),
    "half an angle": (text_of(lamp="1 -1 1 3.5 2 1 2 0 0 0"), "line 7: the number of vertical angles must be a whole"),
    "huge": (text_of(lamp="1 -1 1 999999999 999999999 1 2 0 0 0"), "line 12: the file ends here"),
    "type 4": (text_of(lamp="1 -1 1 3 2 4 2 0 0 0"), "line 7: the photometric type"),
    "units 3": (text_of(lamp="1 -1 1 3 2 1 3 0 0 0"), "line 7: the units"),
    "no multiplier": (text_of(lamp="1 -1 0 3 2 1 2 0 0 0"), "line 7: the multiplier must be positive"),
    "ballast": (text_of(ballast="-1 1 10"), "line 8: the ballast factor"),
    "v falls": (text_of(v="0 95 90"), "line 9: the vertical angles do not increase .90 after 95"),
    "v doubled": (text_of(v="0 90 90"), "line 9: the vertical angles do not increase"),
    "v beyond": (text_of(v="0 45 190"), "line 9: a type C vertical angle of 190"),
    "v below": (text_of(v="-90 0 90"), "line 9: a type C vertical angle of -90"),
    "h beyond": (text_of(h="0 361"), "line 10: C-planes must lie"),
    "h no symmetry": (text_of(h="0 200"), "line 10: C-planes end at 200"),
    "h start": (text_of(h="10 350"), "line 10: C-planes must start at 0"),
    "tilt count": (text_of(tilt="TILT=INCLUDE\r\n1\r\n0"), "line 8: TILT=INCLUDE announces 0"),
    "tilt falls": (text_of(tilt="TILT=INCLUDE\r\n1\r\n2\r\n90 0\r\n1 1"), "line 9: the tilt angles"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed(name: str) -> None:
    lines, reason = MALFORMED[name]
    with pytest.raises(DataError, match=reason):
        parse(lines)


def test_commas_are_not_guessed() -> None:
    """Read as points this is a whole file, read as separators it is not, and the other way round."""
    pointed = parse(["TILT=NONE", "1 -1 1 2 1 1 2 0 0 0", "1 1 0", "0 90", "0", "1,5 2,5"])
    assert list(pointed.distribution.candela[0]) == [1.5, 2.5]
    separated = parse(["TILT=NONE", "1 -1 1 2 1 1 2 0 0 0", "1 1 0", "0 90", "0", "15,25"])
    assert list(separated.distribution.candela[0]) == [15, 25]


def test_a_shifted_plane_is_refused() -> None:
    """One value lost in a plane and one doubled in the next: the count is right and every number behind is wrong."""
    rows = ["1 2 3", "4 5 6", "7 8", "8 9 9 9", "1 1 1"]
    lines = text_of(lamp="1 -1 1 3 5 1 2 0 0 0", h="0 90 180 270 360", p1="\r\n".join(rows), p2="")
    with pytest.raises(DataError, match="line 14: the candelas of horizontal angle 270 do not start on a new line"):
        parse(lines)


def test_wrapped_planes_are_fine() -> None:
    lines = text_of(lamp="1 -1 1 3 2 1 2 0 0 0", p1="10\r\n5 0", p2="10\r\n5\r\n0")
    assert parse(lines).oddities == ()


def test_zero_bytes_and_nothing() -> None:
    for data in (b"", b"\0" * 40, b"\x89PNG\r\n\x1a\n\0\0", b"\xff\xfea"):
        with pytest.raises(DataError):
            parse_lm63(data)
    with pytest.raises(DataError, match=r"nowhere\.ies"):
        read_lm63("nowhere.ies")


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_file_is_refused_or_read_with_true_numbers(data: st.DataObject) -> None:
    """Delete, double or change bytes of the numbers: never another exception, never a shape that was not announced."""
    good = bytearray("\r\n".join(text_of(p1="10.5 5.25 0", p2="10.5 5.25 0")).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(good) - 1))
        what = data.draw(st.sampled_from(["drop", "double", "change"]))
        if what == "drop":
            del good[at]
        elif what == "double":
            good.insert(at, good[at])
        else:
            good[at] = data.draw(st.integers(0, 255))
    try:
        file = parse_lm63(bytes(good))
    except DataError as error:
        assert "LM-63 data: " in str(error)
    else:
        assert np.isfinite(file.distribution.candela).all()


@pytest.mark.skipif(not REAL.is_dir(), reason="the recordings in shared/data/ies are not here")
@pytest.mark.parametrize(
    ("name", "flux", "shape"),
    [
        # 5300 lm is what the luminaire's own keyword says
        ("Indoor_60W_120G_5300LM_5000K_OVNI.ies", 5300.0, (1, 361)),
        ("ABSOLUTE_LED.ies", None, (37, 19)),
        ("TILT_TEST_SYNTHETIC.ies", None, (1, 5)),
    ],
)
def test_real_files(name: str, flux: float | None, shape: tuple[int, int]) -> None:
    file = read_lm63(REAL / name)
    assert file.table.values.shape == shape
    if flux is not None:
        assert file.distribution.flux() == pytest.approx(flux, rel=5e-4)
    again = parse_lm63(
        render_lm63(
            Distribution(file.distribution.gamma_deg, file.distribution.c_deg, file.distribution.candela, KEYWORDS),
            generation=FileGeneration.UNDEFINED,
        )
    )
    assert again.distribution.flux() == pytest.approx(file.distribution.flux(), rel=1e-6)
