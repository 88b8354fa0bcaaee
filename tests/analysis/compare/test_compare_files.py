"""Measured and simulated files become a case."""

from pathlib import Path

import numpy as np
import pytest

from analysis.compare.from_files import case_from_files
from analysis.compare.listing import Listing, read_listing
from analysis.photometry.testdata import TestData
from labdaq.config import parse
from labdaq.errors import ConfigError, DataError
from tests.analysis.compare.light import GAMMAS, PLANES, distribution, lobe, on_arm, sky_part, write_ies

beam = lobe(35.0, 90.0, 4000.0)
LIST = """
format = "labdaq-comparison/1"
title = "a campaign"
noise = { percent = 0.5, cd = 2.0 }
[goniometer]
distance_m = 2.6
[simulation]
engine = "closed form"
[[test]]
id = "T 18/a"
system = "box"
measured = "measured/T18.ies"
simulated = { sun = "sun.ies", sky = "sky.ies" }
[[test]]
id = "T19"
system = "unknown"
sky = "overcast"
measured = "T19.csv"
simulated = { total = "sky.ies" }
[[variant]]
mechanism = "lens-orientation"
setting = { rotation_deg = 90.0 }
simulated = { "T 18/a" = { sun = "turned.ies", sky = "sky.ies" } }
[[rival]]
name = "Other engine"
simulated = { "T 18/a" = { total = "turned.ies" }, T19 = { total = "sky.ies" } }
"""
TABLE = """\
gamma_deg,c_deg,lux,time,uncertainty
0,0,118.3,2010-07-22T13:12:00Z,
45,22.5,80,2010-07-22T13:12:09Z,0.5
45,405,,,
"""


def _both(gamma: np.ndarray, c: np.ndarray) -> np.ndarray:
    return beam(gamma, c) + sky_part(gamma, c)


def _files(folder: Path) -> Path:
    told = TestData(
        sun_altitude_deg=31.2, sun_azimuth_deg=85.6, global_lx=45_000, diffuse_lx=17_000, sky="clear", field="near",
        start_utc="2010-07-22T13:12:00Z", end_utc="2010-07-22T13:14:45Z", distance_m=2.6,
    )  # fmt: skip
    write_ies(folder / "measured" / "T18.ies", on_arm(_both), **told.keywords())
    write_ies(folder / "sun.ies", distribution(beam))
    write_ies(folder / "turned.ies", distribution(lobe(35.0, 180.0, 4000.0)))
    write_ies(folder / "sky.ies", distribution(sky_part))
    (folder / "T19.csv").write_text(TABLE)
    (folder / "list.toml").write_text(LIST)
    return folder


def test_a_list_becomes_a_case(tmp_path: Path) -> None:
    folder = _files(tmp_path / "in")
    draft = case_from_files(read_listing(folder / "list.toml"), folder)
    case = draft.write(tmp_path / "case")
    first, second = case.tests
    r = case.records.where(case.records.test == 0)
    assert len(r) == 1 + 9 * 16  # the nadir once, nothing at 90
    assert set(r.gamma_deg) == set(GAMMAS)
    assert set(r.c_deg) == set(PLANES)
    np.testing.assert_allclose(r.measured, _both(r.gamma_deg, r.c_deg), rtol=1e-12)
    np.testing.assert_allclose(r.uncertainty, np.hypot(0.005 * r.measured, 2.0))
    np.testing.assert_allclose(r.sun, distribution(beam).at(r.gamma_deg, r.c_deg))
    assert r.has_parts.all()
    assert first.global_illuminance_lx == 45_000
    assert first.sun_azimuth_deg == 85.6
    assert first.start is not None
    assert first.start.isoformat() == "2010-07-22T13:12:00+00:00"
    assert second.sky == "overcast"
    t19 = case.records.where(case.records.test == 1)
    np.testing.assert_allclose(t19.measured[:2], np.array([118.3, 80.0]) * 2.6**2)
    assert np.isnan(t19.measured[2])
    assert t19.c_deg.tolist() == [0.0, 22.5, 45.0]
    assert t19.uncertainty[1] == pytest.approx(0.5 * 2.6**2)
    assert t19.uncertainty[0] == pytest.approx(np.hypot(0.005 * 118.3 * 2.6**2, 2.0))
    assert t19.utc_ns[2] == -1
    assert not t19.has_parts.any()
    # the report's box is described by its name; a name nobody knows is not
    assert [s.id for s in case.setup.system] == ["box"]
    # files are taken over as they are
    assert first.simulated is not None
    assert first.simulated.sun == "simulated/T-18-a-sun.ies"
    assert (case.folder / first.simulated.sun).read_bytes() == (folder / "sun.ies").read_bytes()
    parts = case.setup.variant[0].simulated["T 18/a"]
    assert parts.sun is not None
    assert case.distribution(parts.sun).at(35.0, 180.0) > 3000
    rival = (case.setup.model_extra or {})["rival"][0]
    assert rival["name"] == "Other engine"
    assert (case.folder / rival["simulated"]["T19"]["total"]).is_file()


def test_the_gammas_of_the_goniometer_are_taken(tmp_path: Path) -> None:
    folder = _files(tmp_path)
    text = LIST.replace("distance_m = 2.6", "distance_m = 2.6\ngammas_deg = [0, 45]")
    draft = case_from_files(parse(text, Listing, "x"), folder)
    assert set(draft.records.gamma_deg[draft.records.test == 0]) == {0.0, 45.0}
    text = LIST.replace("distance_m = 2.6", "distance_m = 2.6\ngammas_deg = [0, 50]")
    with pytest.raises(DataError, match=r"T18\.ies: holds no gamma 50"):
        case_from_files(parse(text, Listing, "x"), folder)


LIST_MISTAKES = {
    "parts apart from one another": ('sun = "sun.ies", sky', "sky", ["give sun and sky, or total"]),
    "test twice": ('id = "T19"', 'id = "T 18/a"', ["'T 18/a' is given twice"]),
    "a variant for no test": (
        'simulated = { "T 18/a" = { sun',
        "simulated = { T20 = { sun",
        ["variant", "no test 'T20'"],
    ),
    "no file at all": ('measured = "T19.csv"\n', "", ["test[T19].measured", "is missing"]),
    "an unknown key": ("noise =", "noize =", ["noize", "did you mean 'noise'"]),
}


@pytest.mark.parametrize("name", LIST_MISTAKES)
def test_a_mistake_in_the_list_is_named(name: str) -> None:
    old, new, words = LIST_MISTAKES[name]
    assert old in LIST
    with pytest.raises(ConfigError) as caught:
        parse(LIST.replace(old, new, 1), Listing, "list.toml")
    for word in ("list.toml", *words):
        assert word in caught.value.message


TABLE_MISTAKES = {
    "an unknown column": ("lux", "luxe", ["header", "unknown column 'luxe'"]),
    "a column twice": ("lux", "c_deg", ["'c_deg' is given twice"]),
    "no angle": ("gamma_deg,c_deg", "time,c_deg", ["column 'gamma_deg' is missing"]),
    "not a number": ("118.3", "118,3", ["row 2", "6 fields"]),
    "NaN": ("118.3", "nan", ["row 2, column lux", "'nan' is not a finite number"]),
    "no direction": ("45,405,,", ",405,,", ["row 4, column gamma_deg"]),
    "an angle beyond the zenith": ("45,405", "245,405", ["row 4, column gamma_deg", "outside 0 to 180"]),
    "a time without zone": ("13:12:00Z", "13:12:00", ["row 2, column time"]),
    "negative uncertainty": ("0.5", "-0.5", ["row 3, column uncertainty", "negative"]),
    "empty": (TABLE, "", ["column 'gamma_deg' is missing"]),
    "no rows": (TABLE.split("\n", 1)[1], "", ["there are no readings"]),
}


@pytest.mark.parametrize("name", TABLE_MISTAKES)
def test_a_mistake_in_a_table_of_readings_is_named(name: str, tmp_path: Path) -> None:
    old, new, words = TABLE_MISTAKES[name]
    assert old in TABLE
    folder = _files(tmp_path)
    (folder / "T19.csv").write_text(TABLE.replace(old, new, 1))
    with pytest.raises(DataError) as caught:
        case_from_files(parse(LIST, Listing, "list.toml"), folder)
    for word in ("test 'T19'", "T19.csv", *words):
        assert word in caught.value.message


def test_lux_needs_a_distance(tmp_path: Path) -> None:
    text = LIST.replace("[goniometer]\ndistance_m = 2.6\n", "")
    with pytest.raises(DataError, match="lux needs the goniometer's distance_m"):
        case_from_files(parse(text, Listing, "list.toml"), _files(tmp_path))


def test_all_files_that_cannot_be_used_are_named_at_once(tmp_path: Path) -> None:
    folder = _files(tmp_path)
    (folder / "sky.ies").unlink()
    (folder / "turned.ies").write_text("TILT=NONE\n1 -1 1")
    with pytest.raises(DataError) as caught:
        case_from_files(parse(LIST, Listing, "list.toml"), folder)
    lines = caught.value.message.splitlines()
    assert len(lines) == 5
    assert "test 'T 18/a': " in lines[0]
    assert "sky.ies: cannot be read" in lines[0]
    assert lines[2].startswith("variant 1, test 'T 18/a'")
    assert "turned.ies" in lines[2]
    assert lines[3].startswith("rival 1")


def test_keywords_that_are_no_test_data_are_told(tmp_path: Path) -> None:
    folder = _files(tmp_path)
    write_ies(folder / "measured" / "T18.ies", on_arm(_both), _SUNALT="high")
    with pytest.raises(DataError, match=r"T18\.ies: test data in the keywords: keyword \[_SUNALT\]"):
        case_from_files(parse(LIST, Listing, "list.toml"), folder)


@pytest.mark.parametrize("kind", ["grid.txt", "list.csv", "other.ldt"])
def test_simulations_of_other_programs_are_read_like_ies(tmp_path: Path, kind: str) -> None:
    """The same distribution as LM-63, as a table and as EULUMDAT gives the same predictions."""
    from analysis.photometry.eulumdat_write import write_eulumdat

    folder = _files(tmp_path / "in")
    part = distribution(sky_part)
    if kind == "other.ldt":
        write_eulumdat(folder / kind, part)
    elif kind == "grid.txt":
        rows = [
            ["gamma", *part.c_deg],
            *([g, *column] for g, column in zip(part.gamma_deg, part.candela.T, strict=True)),
        ]
        (folder / kind).write_text("\n".join(" ".join(str(value) for value in row) for row in rows))
    else:
        lines = [f"{g},{c},{v}" for c, row in zip(part.c_deg, part.candela, strict=True)
                 for g, v in zip(part.gamma_deg, row, strict=True)]  # fmt: skip
        (folder / kind).write_text("\n".join(["gamma_deg,c_deg,candela", *lines]))
    text = (folder / "list.toml").read_text()
    (folder / "other.toml").write_text(text.replace('"sky.ies"', f'"{kind}"'))
    cases = [
        case_from_files(read_listing(folder / name), folder).write(tmp_path / name)
        for name in ("list.toml", "other.toml")
    ]
    one, two = (case.records.simulated for case in cases)
    tolerance = 2e-3 if kind == "other.ldt" else 1e-9  # EULUMDAT holds cd per klm with a few digits
    np.testing.assert_allclose(two, one, rtol=tolerance, atol=tolerance * np.nanmax(one))
    assert (cases[1].folder / "simulated" / "T19-total.ies").is_file()
