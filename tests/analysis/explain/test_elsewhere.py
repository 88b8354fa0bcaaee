"""What a case's own variant showed, told for cases that bring none."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from analysis.cases import read_case
from analysis.explain.apply import Model, apply_model, read_model
from analysis.explain.elsewhere import elsewhere
from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.mechanisms.goniometer import BROUGHT
from analysis.explain.parameter import Parameter
from analysis.explain.ratios import plain_ratio
from analysis.explain.retrace import Path as Changes
from analysis.explain.retrace import Retraced
from analysis.explain.scene import Scene
from labdaq.errors import DataError
from tests.analysis.explain.campaign import WITHHELD, Floats, columns, light, make_case, rows_of
from tests.analysis.explain.test_case_variants import TURNED, turned, varied
from tests.analysis.explain.test_mechanisms import term
from tests.analysis.explain.untraced import Turning

ENTRY = {"id": "lens-orientation", "way": TURNED, "names": ["rotation_deg"], "theta": [20.0], "sd": [1.0], "facts": {}}


def turned_scene(folder: Path, times: float) -> Scene:
    """A case that brings its lens turned by 20°, and our own simulation, where the change is so many times as large."""
    scene = varied(folder, ("lens-orientation", {"rotation_deg": 20.0}, turned, ""))
    assert scene.retraced is not None
    path = scene.retraced.case_paths["lens-orientation"][0]
    ours = Turning(
        dataclasses.replace(
            path, label="own re-simulation", of_case=False, sun=1.0 + times * (path.sun - 1.0), sky=path.sky
        )
    )
    return dataclasses.replace(scene, retraced=dataclasses.replace(scene.retraced, simulator=ours))


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_our_own_way_is_told_with_the_share_of_it_that_is_seen(tmp_path: Path, times: float) -> None:
    scene = turned_scene(tmp_path / "case", times)
    fit = Fitter(scene).fit((term(scene, "lens-orientation", TURNED),), np.array([20.0]), MIDDLE)
    fit = dataclasses.replace(fit, theta=np.array([20.0]))
    told = elsewhere(scene, fit, 0)
    assert told["names"] == ["rotation_deg"] and told["way"] != TURNED
    if times == 1.0:
        assert (told["way"], told["share"]) == ("own re-simulation", pytest.approx(1.0, abs=0.01))
    ours = dataclasses.replace(term(scene, "lens-orientation", told["way"]), share=told["share"])
    made, shown = (predict(scene, (t,), np.array(x)) for t, x in ((ours, told["theta"]), (fit.terms[0], [20.0])))
    bare = predict(scene, (), np.zeros(0))
    left = np.std(np.log(made / shown)) / np.std(np.log(shown / bare))
    assert left < (0.02 if times == 1.0 else 0.3)


def test_a_near_field_that_the_case_brought_is_told_in_a_form_of_ours(arm: Scene) -> None:
    """Beside what the case brings it has no way of its own, and another case brings none."""
    light = arm.dark_light()
    term(arm, "near-field", "closed form").illuminate(arm, light, np.array([1.0]))
    weight = Parameter("weight", "1", "share", 0.0, 1.0, 1.0, (1.0,))
    far = arm.fields
    near = [np.stack([np.ones_like(a), plain_ratio(b, a)]) for a, b in ((far.sun, light.sun), (far.sky, light.sky))]
    path = Changes("near", weight, np.array([0.0, 1.0]), *near, of_case=True)
    scene = dataclasses.replace(arm, retraced=Retraced({"near-field": (path,)}), lit={})
    fit = Fitter(scene).fit((term(scene, "near-field", BROUGHT),), np.array([1.0]), MIDDLE)
    told = elsewhere(scene, dataclasses.replace(fit, theta=np.array([1.0])), 0)
    assert told == {"way": "closed form", "names": ["weight"], "theta": [1.0], "share": pytest.approx(1.0, abs=0.02)}


def test_another_case_gets_a_near_field_in_the_form_that_was_told(tmp_path: Path) -> None:
    far = {"simulation": {"field": "far"}}
    case = make_case(tmp_path / "case", tests=WITHHELD, measured=False, change=far)
    told: dict[str, object] = {"way": "closed form", "names": ["weight"], "theta": [1.0]}
    own: dict[str, object] = {"id": "near-field", "sd": [0.1], "facts": {}, **told}
    brought = {**own, "way": BROUGHT, "theta": [0.7], "elsewhere": {**told, "share": 1.0}}
    plain, made = (columns(apply_model(Model((entry,)), case), "corrected")[0] for entry in (own, brought))
    assert np.array_equal(made, plain)
    assert np.std(np.log(made / columns(apply_model(Model(), case), "corrected")[0])) > 1e-3


def test_what_no_variant_showed_is_as_it_is(tmp_path: Path) -> None:
    scene = turned_scene(tmp_path / "case", 1.0)
    fit = Fitter(scene).fit((term(scene, "lens-orientation", "own re-simulation"),), np.array([20.0]), MIDDLE)
    assert elsewhere(scene, fit, 0) == {}


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_share_of_a_term_changes_light_by_that_share(tmp_path: Path, share: float) -> None:
    scene = turned_scene(tmp_path / "case", 1.0)
    whole = term(scene, "lens-orientation", TURNED)
    bare = predict(scene, (), np.zeros(0))
    made = predict(scene, (dataclasses.replace(whole, share=share),), np.array([20.0]))
    assert made == pytest.approx(bare + share * (predict(scene, (whole,), np.array([20.0])) - bare), rel=1e-6)


def test_a_share_of_a_response_is_that_share_in_its_tests(arm: Scene) -> None:
    gain = term(arm, "channel-gain", "gonio.g45")
    bare, whole = predict(arm, (), np.zeros(0)), predict(arm, (gain,), np.array([0.2]))
    partly: Term = dataclasses.replace(gain, share=0.25, tests=frozenset({0}))
    made = predict(arm, (partly,), np.array([0.2]))
    here = arm.readings.test == 0
    assert made[here] == pytest.approx((bare + 0.25 * (whole - bare))[here])
    assert made[~here] == pytest.approx(bare[~here])


def _corrected(folder: Path, entry: dict[str, object]) -> Floats:
    make_case(folder, tests=WITHHELD, measured=False)
    return columns(apply_model(Model((entry,)), read_case(folder, need_measured=False)), "corrected")[0]


def test_another_case_gets_so_much_of_our_own_way(tmp_path: Path) -> None:
    """By the variant's setting alone all of it would be taken, which nothing showed."""
    ours = {"way": "turn of the sun's image", "names": ["rotation_deg"], "theta": [7.0]}
    bare = light(rows_of(WITHHELD))
    whole, half, none = (
        _corrected(tmp_path / str(x), {**ENTRY, "elsewhere": {**ours, "share": x}}) for x in (1.0, 0.5, 0.0)
    )
    assert np.std(np.log(whole / bare)) > 0.01
    assert none == pytest.approx(bare, rel=1e-6)
    assert half == pytest.approx((whole + bare) / 2.0, rel=1e-3)


@pytest.mark.parametrize(
    "told",
    [
        3,
        {"way": 1},
        {"way": ""},
        {"way": "", "names": [], "theta": [1.0], "share": 1.0},
        {"way": "", "names": ["a", "b"], "theta": [1.0, 2.0], "share": 1.0},
        {"way": "", "names": ["a"], "theta": [1.0], "share": "all"},
    ],
)
def test_what_is_told_of_other_cases_must_be_whole(tmp_path: Path, told: object) -> None:
    entry = {**ENTRY, "elsewhere": told}
    content = {"format": "labdaq-explanation/1", "verdict": "explained", "model": [entry], "shared_error": {}}
    (tmp_path / "explanation.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match="not an explanation"):
        read_model(tmp_path)
