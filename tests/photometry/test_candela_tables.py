"""Candela tables of other programs: every form gives the same distribution, and mistakes are named."""

from pathlib import Path

import numpy as np
import pytest

from analysis.photometry.any_file import read_distribution
from analysis.photometry.candela_table import parse_candela_table
from labdaq.errors import DataError

GAMMA, C = np.array([0.0, 30.0, 60.0, 90.0]), np.array([0.0, 90.0, 180.0, 270.0])
CANDELA = 100.0 * np.cos(np.radians(GAMMA)) * np.array([1.0, 2.0, 3.0, 4.0])[:, None] + 1.0


def grid(between: str, corner: str, *, closed: bool = False) -> str:
    c = [*C, 360.0] if closed else list(C)
    rows = [between.join([corner, *(f"{a:g}" for a in c)]).strip(" ")]
    for k, gamma in enumerate(GAMMA):
        values = [*CANDELA[:, k], CANDELA[0, k]] if closed else list(CANDELA[:, k])
        rows.append(between.join(f"{v:.9g}" for v in (gamma, *values)))
    return "# a comment\n" + "\n".join(rows) + "\n"


def turned() -> str:
    rows = ["C/gamma " + " ".join(f"{g:g}" for g in GAMMA)]
    rows += [" ".join(f"{v:.9g}" for v in (c, *row)) for c, row in zip(C, CANDELA, strict=True)]
    return "\n".join(rows)


def listed(names: str, azimuth: bool = False) -> str:
    rows = [names]
    for c, row in zip(C, CANDELA, strict=True):
        angle = (360.0 - c) % 360.0 if azimuth else c
        rows += [f"{g:g},{angle:g},{v:.9g}" for g, v in zip(GAMMA, row, strict=True)]
    return "\n".join([rows[0], *rows[:0:-1]])  # in another order


@pytest.mark.parametrize(
    "text",
    [
        grid(" ", ""),
        grid("\t", "gamma"),
        grid(",", ""),
        grid(";", "Gamma / C", closed=True),
        turned(),
        listed("gamma_deg,c_deg,candela"),
        listed("Vertical Angle,Horizontal Angle,Intensity"),
        listed("theta,azimuth,cd", azimuth=True),
    ],
)
def test_every_form_gives_the_same_distribution(text: str) -> None:
    made = parse_candela_table(text)
    assert np.array_equal(made.gamma_deg, GAMMA) and np.array_equal(made.c_deg, [*C, 360.0])
    assert np.allclose(made.candela[:-1], CANDELA, rtol=1e-8)


@pytest.mark.parametrize("corner", ["", "x", "cd", "candela", "cd/klm", "gamma", "Gamma\\C", "intensity"])
def test_only_a_corner_that_says_c_has_c_down(corner: str) -> None:
    made = parse_candela_table(f"{corner},0,45,90\n0,5,5,5\n45,1,2,3\n90,0,0,0\n")
    assert made.at(45.0, 90.0) == pytest.approx(3.0)


@pytest.mark.parametrize("corner", ["C", "c_deg", "C-plane", "C\\gamma", "C / gamma", "phi", "Horizontal Angle"])
def test_a_corner_that_says_c_has_c_down(corner: str) -> None:
    made = parse_candela_table(f"{corner},0,45,90\n0,5,1,0\n45,5,2,0\n90,5,3,0\n")
    assert made.at(45.0, 90.0) == pytest.approx(3.0)


def test_a_compass_grid_runs_the_other_way() -> None:
    made = parse_candela_table("gamma/azimuth 0 90 180 270\n0 1 1 1 1\n45 10 20 30 40\n")
    assert made.at(45.0, 270.0) == pytest.approx(20.0)  # east
    assert made.at(45.0, 90.0) == pytest.approx(40.0)


def test_quarters_and_single_planes_are_unfolded() -> None:
    quarter = parse_candela_table("x 0 45 90\n0 5 5 5\n60 1 2 3\n")
    assert quarter.at(60.0, 315.0) == pytest.approx(2.0) and quarter.at(60.0, 180.0) == pytest.approx(1.0)
    single = parse_candela_table("gamma 0\n0 5\n60 1\n")
    assert single.at(60.0, 123.0) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("gamma 0 90\n", "no table"),
        ("gamma 0 90 180 270\n0 1 2 3 4\n30 1 2 3\n", "line 3: 4 values"),
        ("gamma 0 90 180 270\n0 1 2 x 4\n30 1 2 3 4\n", "line 2: 'x'"),
        ("gamma 0 90 180 270\n30 1 2 3 4\n0 1 2 3 4\n", "line 3: the angles down do not increase"),
        ("gamma 0 90 180 270\n0 1 2 3 4\n30 1 2 -3 4\n", "negative"),
        ("gamma 0 90 180 270\n0 1 2 nan 4\n30 1 2 3 4\n", "line 2: 'nan'"),
        ("gamma 10 90 180 270\n0 1 2 3 4\n30 1 2 3 4\n", "C-planes must start at 0"),
        ("gamma,c,cd\n0,0,1\n0,90,1\n30,0,1\n", "nothing at gamma 30, C 90"),
        ("gamma,c,cd\n0,0,1\n0,90\n", "line 3: 2 values"),
        ("gamma 0 90 45 270\n0 1 2 3 4\n30 1 2 3 4\n", "line 1: the angles across do not increase"),
        ("gamma,c,cd\n0,0,1\n30,0,-2\n", "line 3: -2 cd, a negative intensity"),
        ("gamma,c,cd\n0,0,1\n30,0,5\n30,0,6\n", "line 4: gamma 30, C 0 again, after line 3"),
    ],
)
def test_mistakes_are_named(text: str, says: str) -> None:
    with pytest.raises(DataError, match=says):
        parse_candela_table(text)


def test_files_are_told_by_their_suffix(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(grid(",", ""))
    assert read_distribution(tmp_path / "a.csv").at(30.0, 90.0) == pytest.approx(CANDELA[1, 1])
    for name in ("a.ies", "a.ldt"):
        (tmp_path / name).write_text("nothing of the kind\n")
        with pytest.raises(DataError, match=name):
            read_distribution(tmp_path / name)
    with pytest.raises(DataError, match="cannot be read"):
        read_distribution(tmp_path / "none.txt")
