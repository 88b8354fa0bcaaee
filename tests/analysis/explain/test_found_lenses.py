"""The lenses that were found go into the explanation, and a prediction takes them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.explain import look, tracing
from analysis.explain.found_lenses import FoundLens, FoundLenses, lenses_of, told
from analysis.explain.look import Likened
from analysis.explain.resimulate import OwnSimulation, simulator_of
from analysis.explain.trace_settings import any_pattern
from analysis.simulate.system import SYSTEMS
from tests.analysis.explain.campaign import TESTS, make_case
from tests.analysis.explain.test_shift_lens import SKEWED, system_with

BOX = "box"


def through_json(lenses: dict[str, Likened]) -> FoundLenses:
    return lenses_of(json.loads(json.dumps(told(lenses))))


@pytest.mark.parametrize("kind", ["top", "box", "tube"])
def test_a_lens_comes_back_as_it_was_found(kind: str) -> None:
    """Prisms to the last digit; a density to what its whole numbers hold."""
    steep = SYSTEMS[kind].with_settings({"entry.orientation_deg": 12.5, "exit.haze": 0.07, "rise_m": 0.0})
    for system in (steep, system_with(kind, SKEWED)):
        was = Likened(system, 4.5, even=True, alike=True)
        back = through_json({"it": was}).of({"it": SYSTEMS[kind]})["it"]
        assert replace(back, system=system) == was
        for place in ("entry", "exit"):
            mine, whole = getattr(back.system, place), getattr(system, place)
            assert replace(mine, kind="clear", shifts=()) == replace(whole, kind="clear", shifts=())
            if whole.shifts:
                shares = [np.array(x.shifts) / np.sum(x.shifts) for x in (mine, whole)]
                assert np.sum(np.abs(shares[0] - shares[1])) < 1e-3
        assert back.system.wall == SYSTEMS[kind].wall and back.system.aperture == SYSTEMS[kind].aperture


def test_systems_without_a_known_lens_are_left_out() -> None:
    found = through_json({"box": Likened(SYSTEMS["box"])})
    assert set(found.of(SYSTEMS)) == {"box"}


@pytest.mark.parametrize(
    "broken",
    [
        {"it": 1},
        {"it": {}},
        {"it": {"settings": {}, "spread_deg": 0, "even": False, "alike": False}},
        ["it"],
    ],
)
def test_what_is_no_lens_is_refused(broken: Any) -> None:
    with pytest.raises((ValueError, KeyError, TypeError, AttributeError)):
        lenses_of(broken)


def test_settings_that_make_no_lens_are_refused() -> None:
    whole = told({"it": Likened(system_with("top", SKEWED))})
    for key, value in (("kind", "magic"), ("haze", 2.0), ("shifts", ["1 2", "3"])):
        settings = whole["it"]["settings"]
        entry = settings["entry"] | {key: value}
        with pytest.raises(ValueError, match="entry"):
            lenses_of({"it": whole["it"] | {"settings": settings | {"entry": entry}}})


@pytest.fixture
def few_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (tracing, look):
        monkeypatch.setattr(module, "SAMPLES", 512)
    monkeypatch.setattr(tracing, "RAYS", 4_000)
    monkeypatch.setattr(tracing, "MORE_RAYS", 4_000)


@pytest.mark.timeout(300)  # where nothing is compiled yet, that takes most of it
@pytest.mark.usefixtures("few_rays")
def test_a_prediction_traces_the_lenses_that_were_found(tmp_path: Path) -> None:
    """One sun shows no density: the one that the fitted case had is taken, and below other systems their own."""
    case = make_case(tmp_path / "case", tests=(TESTS[1], TESTS[5]))
    density = system_with(BOX, SKEWED)
    known = FoundLenses({BOX: _found(density)})

    def made(lenses: FoundLenses | None) -> OwnSimulation:
        simulator = simulator_of(case, {"lens-orientation"}, lenses)
        assert simulator is not None
        return simulator

    alone, told_before = made(None), made(known)
    assert not any_pattern(alone.traced_systems()[BOX].system)
    taken = told_before.traced_systems()
    assert taken[BOX].system.entry.shifts == density.entry.shifts and taken[BOX].alike
    assert set(taken) == set(alone.traced_systems()) and not any_pattern(taken["tube"].system)
    ways = {path.label for path in told_before.paths("lens-orientation")}
    assert "lens patterns mirrored, east to west" in ways
    assert "lens patterns mirrored, east to west" not in {path.label for path in alone.paths("lens-orientation")}


def _found(system: Any) -> FoundLens:
    settings = {name: getattr(system, name) for name in ("entry", "exit", "rise_m", "boot_height_m")}
    return FoundLens(settings, alike=True)
