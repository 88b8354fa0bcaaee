"""Exposure times as cameras write them, traced back to the dial."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera.exposure import Shutter, from_ratios, from_tenths_of_ms, in_words, nearest
from labdaq.errors import ConfigError

# Property 500D of Coolpix E5000 and E5700, as dumped from real cameras.
COOLPIX = (80000, 40000, 20000, 10000, 5000, 2500, 1250, 662, 333, 167, 80, 40, 20, 10, 5, 2)
DIAL = (
    8,
    4,
    2,
    1,
    1 / 2,
    1 / 4,
    1 / 8,
    1 / 15,
    1 / 30,
    1 / 60,
    1 / 125,
    1 / 250,
    1 / 500,
    1 / 1000,
    1 / 2000,
    1 / 4000,
)
THIRDS = (
    1,
    0.8,
    0.6,
    0.5,
    0.4,
    1 / 3,
    1 / 4,
    1 / 5,
    1 / 6,
    1 / 8,
    1 / 10,
    1 / 13,
    1 / 15,
    1 / 20,
    1 / 25,
    1 / 30,
    1 / 40,
)
HALVES = (
    1,
    0.7,
    0.5,
    1 / 3,
    1 / 4,
    1 / 6,
    1 / 8,
    0.1,
    1 / 15,
    1 / 20,
    1 / 30,
    1 / 45,
    1 / 60,
    1 / 90,
    1 / 125,
    1 / 180,
)


def test_the_sixteen_steps_of_a_coolpix() -> None:
    steps = from_tenths_of_ms(COOLPIX)
    assert tuple(step.raw for step in steps) == COOLPIX
    assert tuple(step.exposure_s for step in steps) == DIAL
    assert steps[-1].exposure_s == 1 / 4000  # written as 2, which would be a fifth too short


@pytest.mark.parametrize("dial", [THIRDS, HALVES, DIAL])
@pytest.mark.parametrize("write", [lambda t: int(t * 1e4 + 1e-6), lambda t: round(t * 1e4)])
def test_dials_cut_off_or_rounded(dial: tuple[float, ...], write: object) -> None:
    numbers = [write(t) for t in dial]  # type: ignore[operator]
    assert [step.exposure_s for step in from_tenths_of_ms(numbers)] == list(dial)


def test_odd_numbers_mean_what_they_say() -> None:
    assert from_tenths_of_ms([10_000, 7_777]) == (Shutter(10_000, 1.0), Shutter(7_777, pytest.approx(0.7777)))


def test_bulb_is_no_exposure_time() -> None:
    assert from_tenths_of_ms([0xFFFFFFFF, 0xFFFFFFFD, 10_000, 0]) == (Shutter(10_000, 1.0),)


@given(st.lists(st.integers(1, 2_000_000), min_size=1, max_size=40))
def test_every_number_keeps_its_step(numbers: list[int]) -> None:
    steps = from_tenths_of_ms(numbers)
    assert [step.raw for step in steps] == sorted(set(numbers), reverse=True)
    # cutting off loses less than one unit, and one camera is off by 0.7 %
    assert all(abs(step.exposure_s / 1e-4 - step.raw) <= max(1.0, 0.011 * step.raw) for step in steps)


def test_nikons_ratios_are_exact() -> None:
    steps = from_ratios([1 << 16 | 4000, 10 << 16 | 13, 30 << 16 | 1, 0xFFFFFFFF, 5, 1 << 16])
    assert [step.exposure_s for step in steps] == [30.0, 10 / 13, 1 / 4000]
    assert steps[0].raw == 0x001E0001


def test_a_wish_finds_its_step() -> None:
    steps = from_tenths_of_ms(COOLPIX)
    assert nearest(steps, 0.00025).raw == 2
    assert nearest(steps, 1 / 15).raw == 662
    assert nearest(steps, 0.0667).raw == 662
    with pytest.raises(ConfigError, match=r"no exposure time of 0\.0002 s") as caught:
        nearest(steps, 0.0002)  # what the camera's number seems to say
    assert "1/4000 s" in caught.value.hint and "8 s" in caught.value.hint


@pytest.mark.parametrize(
    ("exposure_s", "words"),
    [(8.0, "8 s"), (0.5, "0.5 s"), (1 / 3, "1/3 s"), (1 / 8, "1/8 s"), (1 / 4000, "1/4000 s"), (1.3, "1.3 s")],
)
def test_in_words(exposure_s: float, words: str) -> None:
    assert in_words(exposure_s) == words
