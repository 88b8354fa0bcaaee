"""`labdaq bsdf` from its words to the files."""

import json
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.bsdf import forms
from analysis.bsdf.basis import KLEMS_QUARTER
from analysis.bsdf.convert import to_klems
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component
from analysis.bsdf.prism import PrismSheet, prism_tracer, turned_over
from analysis.bsdf.scatter_file import read_scatter
from analysis.bsdf.tally import klems_of
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.xml_read import read_bsdf
from analysis.bsdf.xml_write import write_bsdf
from labdaq.cli.bsdf import command
from labdaq.cli.simulate import command as simulate
from labdaq.errors import ConfigError, DataError, StorageError


def bsdf(*words: object) -> Result:
    return CliRunner().invoke(command, [str(word) for word in words])


def told(*words: object) -> dict[str, Any]:
    done = bsdf(*words, "--json")
    assert done.exit_code == 0, (done.output, done.exception)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def lobe(path: Path, share: float = 0.5) -> Path:
    """Light goes on evenly, T = R = ``share``."""
    matrix = np.full((KLEMS_QUARTER.size,) * 2, share / np.pi)
    write_bsdf(path, KlemsBsdf(KLEMS_QUARTER, dict.fromkeys(Component, matrix)))
    return path


def test_report_and_picture(tmp_path: Path) -> None:
    file = lobe(tmp_path / "even.xml")
    report = told("report", file, "--plot", tmp_path / "even.png")
    assert report["form"] == "LBNL/Klems Quarter, 41 patches" and report["problems"] == []
    assert report["diffuse"] == {str(part): pytest.approx(0.5) for part in Component}
    assert report["hemispherical"]["Transmission Back"] == [pytest.approx(0.5)] * 9
    assert report["furnace"] == {"front": pytest.approx(1.0), "back": pytest.approx(1.0)}
    assert (tmp_path / "even.png").read_bytes().startswith(b"\x89PNG")
    done = bsdf("report", lobe(tmp_path / "much.xml", 0.6))
    assert "broken: light from the front" in done.output and "0.600" in done.output
    assert bsdf("report", file, "--plot", tmp_path / "even.txt").exit_code == 2


_OTHERS_LIKE_IT = ("klems-half", "klems-2x")
"""Forms that prove nothing that klems-full does not, but for their own patches."""


@pytest.mark.parametrize(
    "form",
    ["klems-full", "tree3", "tree4", *(pytest.param(form, marks=pytest.mark.slow) for form in _OTHERS_LIKE_IT)],
)
def test_conversions_keep_the_light(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str) -> None:
    """An even lobe is the same in any form, but for the noise of tree3, which is traced (1 % of diffuse light)."""
    monkeypatch.setattr(forms, "DEPTH", 4)  # cells twice as wide hold it as well
    made = told("convert", lobe(tmp_path / "even.xml"), "--to", form, "--out", tmp_path / "to.xml", "--rays", 500)
    for values in (made["diffuse"], made["before"]["diffuse"]):
        assert values == {str(part): pytest.approx(0.5, abs=1e-2 if form == "tree3" else 1e-6) for part in Component}
    assert made["rays"] == (500 if form == "tree3" else 0)
    back = read_bsdf(tmp_path / "to.xml").bsdf
    assert isinstance(back, TensorTreeBsdf if form.startswith("tree") else KlemsBsdf)


def test_bad_names_of_files(tmp_path: Path) -> None:
    file = lobe(tmp_path / "even.xml")
    assert bsdf("convert", file, "--to", "tree4", "--out", tmp_path / "a.txt").exit_code == 2
    assert isinstance(
        bsdf("convert", file, "--to", "tree4", "--out", tmp_path / "no" / "a.xml").exception, StorageError
    )
    assert isinstance(bsdf("report", tmp_path / "no.xml").exception, DataError)


def test_a_rounded_sheet_becomes_a_lens(tmp_path: Path) -> None:
    """From its dimensions to photometry; peaks rounded to 1 mm let more light straight through than sharp ones."""
    made = told("sheet", "--out", tmp_path / "sheet.xml", "--to", "klems-quarter", "--rays", 300, "--peak-radius", 1.0,
                "--valley-radius", 0.5, "--dimple", 1.0, 0.3)  # fmt: skip
    assert made["notes"] == [] and 0.5 < made["diffuse"]["Transmission Front"] < 0.9
    (tmp_path / "mine.toml").write_text('base = "top"\nentry.bsdf = "sheet.xml"\n')
    out = tmp_path / "a.ies"
    words = ["--sky", "overcast", "--diffuse", "10000", "--rays", "4000", "--json"]
    done = CliRunner().invoke(simulate, [str(tmp_path / "mine.toml"), "--out", str(out), *words])
    assert done.exit_code == 0, (done.output, done.exception)
    report = json.loads(done.stdout)
    assert report["notes"] == [] and out.is_file()
    # of 10,000 lx on 0.37 m2 the sheet passes some 0.6, and `top` has little of a well
    assert 0.3 < report["flux_lm"] / (10_000 * 0.6096**2) < 0.8


def test_simulate_tells_of_lenses_that_make_light(tmp_path: Path) -> None:
    lobe(tmp_path / "much.xml", 0.55)
    (tmp_path / "mine.toml").write_text('base = "top"\nentry.bsdf = "much.xml"\n')
    words = ["--sky", "overcast", "--diffuse", "10000", "--rays", "2000", "--out", str(tmp_path / "a.ies")]
    done = CliRunner().invoke(simulate, [str(tmp_path / "mine.toml"), *words])
    assert done.exit_code == 0, (done.output, done.exception)
    assert "note: " in done.stderr and "1.1 times" in done.stderr


def test_prisms_up_is_the_sheet_turned_over() -> None:
    sheet = PrismSheet(slope_deg=35.0, orientation_deg=20.0)
    rng = np.random.default_rng(0)
    one, other = (klems_of(t, rng, basis=KLEMS_QUARTER, rays=4000) for t in
                  (prism_tracer(sheet), turned_over(prism_tracer(sheet))))  # fmt: skip
    turned = KLEMS_QUARTER.patch_of(KLEMS_QUARTER.centre_xy * np.array([1.0, -1.0]))
    for part, partner in ((Component.TF, Component.TB), (Component.RB, Component.RF)):
        wanted = one.matrices[part][np.ix_(turned, turned)]
        # 4000 rays a patch: 5 standard deviations of an element that holds a part p of them are 5 sqrt(p / 4000)
        share, miss = wanted * KLEMS_QUARTER.projected[:, None], np.abs(other.matrices[partner] - wanted)
        assert (miss * KLEMS_QUARTER.projected[:, None] < 5.0 * np.sqrt(2.0 * (share + 1e-3) / 4000)).all()


def test_a_sheet_that_cannot_be(tmp_path: Path) -> None:
    done = bsdf("sheet", "--out", tmp_path / "a.xml", "--thickness", 1, "--peak-radius", 9)
    assert isinstance(done.exception, ConfigError)
    with pytest.raises(ConfigError, match=r"(?s)thickness_mm.*peak_radius_mm"):
        raise done.exception


ABG = """
[reflection-front]
theta_deg = [0, 60]
a = 0.02
b = 0.02
g = 1.8
hemispherical = [0.6, 0.8]

[transmission-front]
a = 0.05
b = 0.1
g = 1.5
specular = 0.02
"""


def test_abg_becomes_a_file(tmp_path: Path) -> None:
    """A is scaled to the hemispherical values; with a specular part the lobe is traced."""
    (tmp_path / "paint.toml").write_text(ABG)
    found = read_scatter(tmp_path / "paint.toml", both_sides=True)
    assert set(found.components()) == set(Component)
    sixty = np.array([[0.0, 0.0], [np.sin(np.radians(60.0)), 0.0]])
    assert found.hemispherical(Component.RB, sixty) == pytest.approx([0.6, 0.8], rel=1e-6)
    made = told("import", tmp_path / "paint.toml", "--out", tmp_path / "a.xml", "--to", "klems-quarter", "--rays", 400)
    assert made["rays"] == 400 and set(made["diffuse"]) == {"Transmission Front", "Reflection Front"}
    straight = read_bsdf(tmp_path / "a.xml").bsdf.evaluate(Component.TF, np.zeros(2), np.zeros(2))
    # the lobe is 0.37 /sr there; 0.02 on a patch of sin(9 degrees)^2 pi are 0.26 /sr more; some 30 rays meet it
    assert 0.5 < straight < 0.9
    (tmp_path / "plain.toml").write_text("[reflection-front]\na = 0.05\nb = 0.06\ng = 2.0\n")
    plain = told("import", tmp_path / "plain.toml", "--out", tmp_path / "b.xml", "--to", "klems-quarter")
    assert plain["rays"] == 0
    assert read_bsdf(tmp_path / "b.xml").bsdf.material.name == "plain"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[reflection]\na = 1\n", r"paint\.toml: reflection: is none of the tables"),
        ("[reflection-front]\na = 1\nb = 1\n", r"reflection-front\.g: Field required"),
        ("[reflection-front]\na = 1\nb = 1\ng = 1\nc = 1\n", r"reflection-front\.c: Extra"),
        ("[reflection-front]\na = [1, 2]\nb = 1\ng = 1\n", "a: one number, or one for each of the 1"),
        ("[reflection-front]\na = 1\nb = 0\ng = 1\n", "needs A >= 0, B > 0"),
        ("[reflection-front]\na = 1\nb = 1\ng = 1\nhemispherical = 1.2\n", "hemispherical: lies between"),
        ("", "there are none"),
        ("a = ", r"paint\.toml: Invalid"),
    ],
)
def test_mistakes_of_abg_files(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "paint.toml").write_text(text)
    with pytest.raises(DataError, match=says):
        read_scatter(tmp_path / "paint.toml")


def e2387(component: str, theta_s: tuple[int, ...], phi_s: tuple[int, ...] = (0, 90, 180, 270, 360)) -> str:
    rows = [f"{component},{i},0,{s},{p},{0.1 + i / 1000}" for i, s, p in product((0, 80), theta_s, phi_s)]
    return "# ours\ncomponent,theta_i_deg,phi_i_deg,theta_s_deg,phi_s_deg,bsdf_per_sr\n" + "\n".join(rows) + "\n"


def relative(component: str) -> str:
    angles = product((0, 80), (0, 90, 180), (0, 180))
    rows = [f"{component},{i},{m},{p},{100 - m / 2},{0.5 + i / 800}" for i, m, p in angles]
    return "component,theta_i_deg,theta_m_deg,phi_m_deg,intensity,hemispherical\n" + "\n".join(rows) + "\n"


def test_tables_become_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # values that are even over all ways out need few directions; what conversions keep is asked in test_descriptions
    monkeypatch.setattr(forms, "to_klems", partial(to_klems, incident=1, outgoing=6))
    straight, at_40 = np.zeros(2), np.array([np.sin(np.radians(40.0)), 0.0])
    file = tmp_path / "table.csv"
    for text in (e2387("transmission-front", (90, 135, 180)), e2387("Transmission Front", (180, 90), (0, 90, 180))):
        file.write_text(text)
        found = read_scatter(file)
        assert float(found.evaluate(Component.TF, at_40, straight)) == pytest.approx(0.14)  # between 0.1 and 0.18
        assert found.components() == (Component.TF,)
    assert read_scatter(file, both_sides=True).components() == (Component.TF, Component.TB)
    made = told("import", file, "--out", tmp_path / "a.xml", "--to", "klems-quarter")
    assert made["diffuse"] == {"Transmission Front": pytest.approx(0.14 * np.pi, rel=0.1)}
    file.write_text(relative("reflection-back"))
    found = read_scatter(file)
    assert float(found.hemispherical(Component.RB, at_40)) == pytest.approx(0.55)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,b\n1,2\n", "line 1: the columns are a, b"),
        ("", "columns are none"),
        (e2387("transmission-front", (0, 90)), "theta_s_deg: lies within 90 to 180 degrees in transmission"),
        (e2387("reflection-front", (0, 120)), "theta_s_deg: lies within 0 to 90 degrees in reflection"),
        (e2387("mirror", (0, 90)), "line 3: component: 'mirror' is none of"),
        (e2387("reflection-front", (0, 90)).replace("0.1\n", "much\n", 1), "line 3: bsdf_per_sr: 'much' is not"),
        (e2387("reflection-front", (0, 90)).replace("0,0,90,360,0.1\n", "0,0,90,270,0.1\n"), "lines 11 and 12: .*same"),
        (e2387("reflection-front", (0, 90)).rsplit("\n", 2)[0], "no row for the angles 80, 0, 90, 360"),
        (e2387("reflection-front", (0, 90), (0, 90)), "phi_s: must run from 0 to 360"),
        (relative("reflection-front").replace("0.6\n", "0.7\n", 1), "line 8: hemispherical: 0.7, where another"),
    ],
)  # fmt: skip
def test_mistakes_of_tables(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(DataError, match=says):
        read_scatter(tmp_path / "table.csv")
