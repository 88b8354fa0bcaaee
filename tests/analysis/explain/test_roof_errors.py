"""What every roof has wrong: heads that lean a little, and air that is not the air of the prediction."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.cases.model import Floats
from analysis.explain.air_error import air_error_effects
from analysis.explain.mount_error import LEVEL_DEG, mount_errors
from analysis.explain.scene import Scene
from tests.analysis.explain.test_mechanisms import acted


def relative(scene: Scene, changed: Floats) -> Floats:
    """Change of each reading on the stretched scale."""
    r = scene.readings
    return np.asarray((changed - r.simulated) / np.hypot(r.simulated, r.floor) * np.abs(r.measured) / r.scale)


@pytest.mark.parametrize("whose", ["velux", "konica", "every roof meter"])
@pytest.mark.parametrize("towards", ["north", "east"])
def test_an_effect_is_the_beam_on_a_head_that_leans(roof: Scene, whose: str, towards: str) -> None:
    lean = (LEVEL_DEG, 0.0) if towards == "north" else (0.0, LEVEL_DEG)
    wanted = relative(roof, acted(roof, "meter-tilt", whose, *lean))
    effects = mount_errors(roof.readings)
    off = np.abs(effects - wanted[:, None]).max(axis=0)
    assert off.min() < 0.25 * np.abs(wanted).max(), "but for what little the sky's part changes"


def test_three_effects_of_each_head_and_of_what_was_predicted(roof: Scene) -> None:
    assert mount_errors(roof.readings).shape == (len(roof.readings), 9)


def test_an_arm_and_a_roof_without_parts_have_none(arm: Scene, roof: Scene) -> None:
    assert mount_errors(arm.readings).shape[1] == 0
    no_sun = replace(roof.readings, sun=np.full(len(roof.readings), np.nan))
    assert mount_errors(no_sun).shape[1] == 0


def test_the_air_of_a_single_day_is_allowed_for(roof: Scene) -> None:
    both = air_error_effects(roof)
    first = np.array([t.start.date() == roof.readings.case.tests[0].start.date() for t in roof.readings.case.tests])
    one = air_error_effects(roof.only(first[roof.readings.test]))
    assert 0 < one.shape[1] < both.shape[1]
    assert np.all(np.any(one != 0.0, axis=0))
