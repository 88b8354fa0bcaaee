"""A prediction's lens as a density of shifts, where no prisms of one shape look like it."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.cases.model import Floats
from analysis.explain import likeness
from analysis.explain.densities import densities
from analysis.explain.fields import C_DEG, GAMMA_DEG
from analysis.explain.found_lenses import lenses_of, told
from analysis.explain.likeness import likened
from analysis.explain.look import Likened, Look, Predicted, look_at
from analysis.explain.shift_lens import patternless, shift_lens
from analysis.explain.trace_settings import (
    ANY_TURNS_DEG,
    STRETCHED,
    TRACED_AXES_DEG,
    any_pattern,
    on_top,
    settings_of,
)
from analysis.simulate.changes import changed
from analysis.simulate.components import Lens
from analysis.simulate.daylight import Daylight, daylight, sun_source
from analysis.simulate.lens_shift import SIDE, cells
from analysis.simulate.system import SYSTEMS, System
from analysis.simulate.tracer import Settings, trace

pytestmark = pytest.mark.timeout(300)  # where nothing is compiled yet, that takes most of it
DAYS = [daylight(h, a, 80_000.0 * np.sin(np.radians(h)), 9_000.0, "perez") for h, a in ((28, 95), (44, 140), (63, 200))]

SUNS = ((20, 80), (33, 110), (47, 150), (58, 190), (66, 230))


def lobes(*shares: tuple[float, float, float], cells_wide: float = 2.5) -> Lens:
    """A lens with a few lobes: share, and shift east and north."""
    density = np.zeros((SIDE, SIDE))
    for share, x, y in shares:
        density[np.argmin(np.abs(cells() - x)), np.argmin(np.abs(cells() - y))] += share
    return Lens(kind="shift", shifts=tuple(gaussian_filter(density, cells_wide).ravel().tolist()))


SKEWED = lobes((0.5, 0.34, 0.1), (0.3, -0.2, 0.3), (0.2, -0.1, -0.42))


def system_with(kind: str, lens: Lens) -> System:
    """A skylight as a case describes it, with somebody's lens."""
    places = {"top": ("entry",), "box": ("entry", "exit"), "tube": ("exit",)}[kind]
    return SYSTEMS[kind].with_settings({"rise_m": 0.0, "boot_height_m": 0.0}).replace(**dict.fromkeys(places, lens))


def predicted(system: System, seed: int = 5, days: list[Daylight] = DAYS) -> Floats:
    """Somebody's sun part of each test, (T, P, G) [cd]."""
    source = sun_source(days)
    assert source is not None
    tally = trace(system, source, Settings(rays=30_000, samples=2_048, sun_samples=2_048, seed=seed))
    return tally.intensity(GAMMA_DEG[None, :], C_DEG[:, None]).candela


def shown(kind: str, seen: Floats) -> Look:
    """What the prediction shows of a skylight that a case describes."""
    given = Predicted(DAYS, seen, np.zeros_like(seen), 2.6, "far")
    found = look_at(SYSTEMS[kind], given, ThreadPoolExecutor(1))
    assert found is not None
    return found


def whole_likeness(kind: str, seen: Floats) -> dict[str, Likened]:
    """The skylight, likened to the prediction, and what was found of that."""
    return likened({"it": SYSTEMS[kind]}, {"it": Predicted(DAYS, seen, np.zeros_like(seen), 2.6, "far")})


def like(kind: str, seen: Floats) -> System:
    """The skylight, likened to the prediction."""
    return whole_likeness(kind, seen)["it"].system


@cache
def found_lobes(kind: str) -> tuple[Look, System, float]:
    """What shows of a skylight with unequal lobes, its density, and how unlike that is; two tests ask for the top's."""
    seen = shown(kind, predicted(system_with(kind, SKEWED)))
    return seen, *shift_lens(seen)


@pytest.mark.parametrize(
    ("kind", "unlike"),
    [
        ("top", 0.25),
        pytest.param("box", 0.55, marks=pytest.mark.slow),
        pytest.param("tube", 0.2, marks=pytest.mark.slow),
    ],
)
def test_unequal_lobes_are_found(kind: str, unlike: float) -> None:
    """Whatever stands between the lens and the eye: a white well, mirrors on four sides, or a mirror all around."""
    seen, found, left = found_lobes(kind)
    assert left < unlike and left == pytest.approx(seen.beside(seen.light(found)))
    assert left < 0.65 * seen.beside(seen.light(system_with(kind, lobes((1.0, 0.0, 0.0)))))
    assert left < 0.8 * seen.beside(seen.light(patternless(found)))


def turn(system: System) -> Floats:
    """What a turn of the cover changes in each direction, whatever it does to all of them."""
    turned = system.with_settings({"entry.orientation_deg": system.entry.orientation_deg + 12.0})
    lit, bright = (predicted(of)[:, :, :30] for of in (turned, system))
    floor = 0.02 * bright.max(axis=(1, 2), keepdims=True)
    ratio = np.log((lit + floor) / (bright + floor))
    return np.asarray(ratio - ratio.mean(axis=(1, 2), keepdims=True))


@cache
def likened_top() -> dict[str, Likened]:
    """A top with unequal lobes, likened; three tests ask for it."""
    return whole_likeness("top", predicted(system_with("top", SKEWED)))


def by_its_density() -> float:
    """How the change by a turn of it correlates with the true one."""
    told, made = likened_top()["it"].system, system_with("top", SKEWED)
    return float(np.corrcoef(turn(told).ravel(), turn(made).ravel())[0, 1])


def test_a_turn_of_unequal_lobes_is_told_by_the_density() -> None:
    assert any_pattern(likened_top()["it"].system) and by_its_density() > 0.6


def test_what_is_found_of_a_prediction_can_be_told() -> None:
    """Whatever comes out of numbers of arrays is JSON's, too."""
    found = likened_top()
    back = lenses_of(json.loads(json.dumps(told(found)))).of({"it": SYSTEMS["top"]})["it"]
    assert back.system.entry.kind == "shift" and (back.alike, back.even) == (found["it"].alike, found["it"].even)


@pytest.mark.slow
def test_a_turn_of_unequal_lobes_is_not_told_by_prisms(monkeypatch: pytest.MonkeyPatch) -> None:
    by_density, made = by_its_density(), system_with("top", SKEWED)
    monkeypatch.setattr(likeness, "_shifted", lambda *_: {})
    prisms = like("top", predicted(made))
    assert not any_pattern(prisms)
    assert by_density > float(np.corrcoef(turn(prisms).ravel(), turn(made).ravel())[0, 1]) + 0.3


@pytest.mark.slow
def test_prisms_are_kept_where_they_look_more_like_it() -> None:
    steep = SYSTEMS["box"].with_settings({"entry.slope_deg": 36.0, "exit.slope_deg": 36.0})
    assert not any_pattern(like("box", predicted(steep)))


@pytest.mark.slow
def test_a_density_without_a_pattern_is_none_that_could_be_turned() -> None:
    even = system_with("top", lobes((1.0, 0.0, 0.0)))
    assert not any_pattern(like("top", predicted(even)))


DIFFUSING = SYSTEMS["tube"].with_settings({"exit.kind": "diffusing"})


def as_diffusing(seen: Floats) -> System:
    """A tube whose lens a case calls diffusing, likened."""
    return likened({"it": DIFFUSING}, {"it": Predicted(DAYS, seen, np.zeros_like(seen), 2.6, "far")})["it"].system


def test_a_diffusing_lens_that_sends_light_about_its_direction_is_one_without_a_pattern() -> None:
    """What a case calls diffusing is not always a perfect diffuser; below that no wall would show."""
    like_it = as_diffusing(predicted(system_with("tube", lobes((1.0, 0.0, 0.0), cells_wide=6.0))))
    assert densities(like_it) == ["exit"] and not any_pattern(like_it)


@pytest.mark.slow  # test_likeness asks the same of two suns
def test_a_perfect_diffuser_stays_one() -> None:
    assert as_diffusing(predicted(DIFFUSING)) is DIFFUSING


def test_one_sun_tells_no_density() -> None:
    """Of one image any density is as good as the next."""
    seen = predicted(system_with("top", SKEWED))[1:2]
    given = Predicted(DAYS[1:2], seen, np.zeros_like(seen), 2.6, "far")
    assert not any_pattern(likened({"it": SYSTEMS["top"]}, {"it": given})["it"].system)


@pytest.mark.parametrize("kind", [pytest.param("top", marks=pytest.mark.slow), "tube"])
def test_a_lens_that_draws_light_towards_its_normal_is_found(kind: str) -> None:
    drawing = replace(lobes((1.0, 0.0, 0.0), cells_wide=6.0), kept=0.6)
    seen = shown(kind, predicted(system_with(kind, drawing)))
    found, left = shift_lens(seen)
    (place,) = seen.places
    assert getattr(found, place).kept == pytest.approx(0.6, abs=0.15)
    whole = [seen.beside(seen.light(system_with(kind, lobes((1.0, 0.0, 0.0), cells_wide=w)))) for w in (4, 6, 9)]
    assert left < 0.7 * min(whole)


def test_a_lens_that_only_shifts_light_keeps_all_its_direction() -> None:
    _, found, _ = found_lobes("top")
    assert found.entry.kept == 1.0


@pytest.mark.slow
def test_a_pattern_that_holds_under_no_other_sun_is_none() -> None:
    """What few rays happen to do under three suns can be made of a density, but not under the next two."""
    days = [daylight(h, a, 60_000.0 * np.sin(np.radians(h)), 9_000.0, "perez") for h, a in SUNS]
    for lens, patterned in ((lobes((1.0, 0.0, 0.0), cells_wide=5.0), False), (SKEWED, True)):
        seen = predicted(system_with("box", lens), 5, days)
        found = likened({"it": SYSTEMS["box"]}, {"it": Predicted(days, seen, np.zeros_like(seen), 2.6, "far")})["it"]
        assert densities(found.system) == ["entry", "exit"]
        assert any_pattern(found.system) == patterned


@pytest.mark.parametrize("kind", ["top", "box", "tube"])
def test_what_a_lens_without_a_pattern_may_have_lost(kind: str) -> None:
    plain = patternless(system_with(kind, SKEWED))
    lost = [dict(setting) for setting in settings_of(plain) if setting[0][0] == "isotropic"]
    assert [setting.get("rotation_deg", 0.0) for setting in lost] == [0.0, 45.0, 27.0, 63.0]
    for setting in lost:
        assert any_pattern(changed(plain, on_top(plain, setting)))
    stretches = [dict(setting) for setting in settings_of(plain) if setting[0][0] == STRETCHED]
    assert [setting[STRETCHED] for setting in stretches] == list(TRACED_AXES_DEG)
    for setting in stretches:
        made = changed(plain, on_top(plain, setting))
        assert any_pattern(made) and densities(made) == densities(plain)


def test_a_pattern_without_symmetry_is_turned_to_both_sides() -> None:
    settings = settings_of(system_with("top", SKEWED))
    turns = {value for setting in settings for name, value in setting if name == "rotation_deg"}
    assert turns == {*ANY_TURNS_DEG, 180.0}
    assert (("mirrored", True),) in settings and (("isotropic", True),) in settings
