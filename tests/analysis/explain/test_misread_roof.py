"""What the roof's two meters read wrong in a test is in that test's prediction, and is allowed for."""

import numpy as np
import pytest

from analysis.explain.noise import GAIN_OF_METERS, split_errors
from analysis.explain.scene import Scene


@pytest.mark.parametrize("which", ["global", "diffuse"])
@pytest.mark.parametrize("test", [0, 2])
def test_an_effect_is_what_the_other_reading_would_have_predicted(arm: Scene, which: str, test: int) -> None:
    r = arm.readings
    at_all, diffuse = float(r.global_lx[test]), float(r.diffuse_lx[test])
    other_all = at_all * (1.0 + GAIN_OF_METERS * (which == "global"))
    other_diffuse = diffuse * (1.0 + GAIN_OF_METERS * (which == "diffuse"))
    predicted = r.sun * (other_all - other_diffuse) / (at_all - diffuse) + r.sky * other_diffuse / diffuse
    wrong = np.where(r.test == test, (predicted - r.simulated) / r.scale, 0.0)
    off = np.abs(split_errors(r) - wrong[:, None]).max(axis=0)
    assert off.min() < 0.02 * np.abs(wrong).max()


def test_without_a_beam_there_is_nothing_to_misread(arm: Scene) -> None:
    columns = split_errors(arm.readings)
    sunny = [t for t in range(len(arm.readings.global_lx)) if arm.beam_lx[t] > 0.02 * arm.readings.diffuse_lx[t]]
    assert columns.shape[1] == 2 * len(sunny)
    assert not np.any(split_errors(arm.readings)[~np.isin(arm.readings.test, sunny)])
