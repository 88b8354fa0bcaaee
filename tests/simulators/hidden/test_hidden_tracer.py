"""The tracer against closed forms, against itself with other settings, and against conservation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from labdaq.directions import sky_vector
from simulators.hidden.lens import Lens
from simulators.hidden.maps import Field, smooth
from simulators.hidden.skylight import Skylight, box, top, tube
from simulators.hidden.symmetry import ALL, DIAGONAL, FLIP_X, apply, symmetries
from simulators.hidden.tracer import Answer, trace

NONE = Lens(kind="none")
LOSSLESS = Lens(absorption_per_mm=0.0)


def _swift_smith(ratio: float, zenith_deg: float, reflectance: float) -> float:
    """Transmittance of a mirror tube (Swift and Smith 1995, doi:10.1016/0927-0248(94)00172-X), s = sin u."""
    u = (np.arange(200_000) + 0.5) / 200_000 * math.pi / 2.0
    q = ratio * math.tan(math.radians(zenith_deg)) / np.sin(u)
    n = np.floor(q)
    return float(2.0 * np.mean(np.sin(u) ** 2 * reflectance**n * (1.0 - (1.0 - reflectance) * (q - n))))


@pytest.mark.parametrize("zenith", [20.0, 50.0, 75.0])
def test_mirror_tube_is_swift_and_smiths(zenith: float) -> None:
    bare = tube(cover="flat", entry=NONE, exit=NONE, boot_m=0.0)
    sun = sky_vector(90.0 - zenith, 37.0)
    traced = trace(bare, sun, 60_000, 3, disc_deg=1e-6)
    through = traced.below_lm / (math.cos(math.radians(zenith)) * bare.aperture_m2)
    assert through == pytest.approx(_swift_smith(0.9144 / 0.3556, zenith, 0.98), abs=2e-3)


@pytest.mark.parametrize(
    "skylight",
    [
        top(entry=LOSSLESS, wall_reflectance=1.0),
        box(entry=LOSSLESS, exit=LOSSLESS, wall_reflectance=1.0),
        tube(exit=LOSSLESS, wall_reflectance=1.0, boot_reflectance=1.0),
    ],
)
def test_nothing_is_lost_where_nothing_absorbs(skylight: Skylight) -> None:
    traced = trace(skylight, sky_vector(35.0, 110.0), 40_000, 1)
    # roulette is fair on average only; without absorption it hardly plays
    assert traced.absorbed_lm == pytest.approx(0.0, abs=2e-3 * traced.sent_lm)
    assert traced.below_lm > 0.1 * traced.sent_lm
    assert traced.flux[0].sum(axis=(1, 2)) == pytest.approx([traced.below_lm] * 3, rel=1e-9)


def test_a_nominal_skylight_gives_no_more_than_it_gets() -> None:
    for skylight in (top(), box(), tube()):
        traced = trace(skylight, sky_vector(60.0, 200.0), 20_000, 1)
        assert 0.0 < traced.below_lm < traced.entered_lm < traced.sent_lm
        assert traced.below_lm + traced.above_lm + traced.absorbed_lm <= traced.sent_lm * (1.0 + 1e-9)


def test_tallies_answer_for_other_walls_and_limits() -> None:
    sun = sky_vector(30.0, 70.0)
    dull = trace(replace(box(), wall_reflectance=0.85), sun, 60_000, 5).below_lm
    asked = trace(box(), sun, 60_000, 5, (Answer(), Answer(wall_reflectance=0.85), Answer(max_bounces=2)))
    answered = asked.flux[:, 0].sum(axis=(1, 2))
    assert answered[1] == pytest.approx(dull, rel=0.01)  # same rays; only the roulette differs
    assert answered[2] == pytest.approx(asked.bounces[:3].sum(), rel=1e-9)
    assert answered[2] < answered[0] == pytest.approx(asked.below_lm)


def test_weights_answer_for_haze_and_scatter() -> None:
    sun = sky_vector(45.0, 160.0)
    drawn = replace(box(), wall_scatter=0.1, entry=Lens(haze=0.1), exit=Lens(haze=0.1))
    clear, little = trace(
        drawn, sun, 120_000, 2, (Answer(wall_scatter=0.0, haze=0.0), Answer(wall_scatter=0.03, haze=0.02))
    ).flux[:, 0]
    plain = trace(box(), sun, 120_000, 2).flux[0, 0]
    hazed = trace(replace(box(), wall_scatter=0.03, entry=Lens(haze=0.02), exit=Lens(haze=0.02)), sun, 120_000, 2).flux[
        0, 0
    ]
    # 120,000 rays leave 0.4 % on the flux of weighted rays
    assert clear.sum() == pytest.approx(plain.sum(), rel=0.012)
    assert little.sum() == pytest.approx(hazed.sum(), rel=0.012)


def test_symmetric_suns_give_symmetric_light() -> None:
    sun = sky_vector(50.0, 20.0)
    kept = smooth(trace(box(), sun, 150_000, 1).flux[0])
    for g, mirrored in ((FLIP_X, sun * [-1.0, 1.0, 1.0]), (DIAGONAL, sun[[1, 0, 2]])):
        other = smooth(trace(box(), mirrored, 150_000, 2).flux[0])
        difference = apply(g, kept) - other
        assert np.sqrt(np.mean(difference**2)) < 0.1 * np.sqrt(np.mean(other**2))  # noise of 150,000 rays
        assert np.sqrt(np.mean((kept - other) ** 2)) > 0.4 * np.sqrt(np.mean(other**2))


def test_symmetries_are_those_of_the_lens() -> None:
    assert set(symmetries(box())) == set(ALL)
    assert len(symmetries(box().turned(20.0))) == 4
    assert len(symmetries(box().turned(45.0))) == 8
    assert len(symmetries(box(entry=Lens(slopes_deg=(30.0, 20.0, 27.0, 27.0))))) == 2
    assert len(symmetries(top(length_m=1.2))) == 4


def test_a_turned_lens_on_a_tube_turns_everything() -> None:
    sun = sky_vector(55.0, 80.0)
    turned = Field(smooth(trace(tube().turned(30.0), sun, 200_000, 4).flux[0]))
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    back = np.array([c * sun[0] + s * sun[1], -s * sun[0] + c * sun[1], sun[2]])
    other = Field(smooth(trace(tube(), back, 200_000, 4).flux[0]), turn_deg=30.0)
    from labdaq.directions import vector

    directions = vector(np.repeat([20.0, 35.0, 50.0], 12), np.tile(np.arange(0.0, 360.0, 30.0), 3))
    a, b = turned.intensity(directions), other.intensity(directions)
    assert np.sqrt(np.mean((a - b) ** 2)) < 0.12 * np.sqrt(np.mean(a**2))


def test_the_far_field_of_an_even_aperture_is_lamberts_and_the_near_field_is_exact() -> None:
    from labdaq.directions import vector

    plain = box(exit=Lens(kind="diffusing", transmittance=0.6))
    field = Field(smooth(trace(plain, sky_vector(90.0, 0.0), 400_000, 3).flux[0]))
    gammas = np.array([0.0, 30.0, 60.0, 80.0])
    planes = np.arange(0.0, 360.0, 15.0)
    directions = vector(gammas[:, None], planes[None, :])
    far = field.intensity(directions).mean(axis=1)
    assert far / far[0] == pytest.approx(np.cos(np.radians(gammas)), rel=0.05)
    # exact illuminance of an even square, seen from 2.6 m, over intensity / distance²
    steps = (np.arange(60) + 0.5) / 60 * 0.6096 - 0.3048
    x, y = np.meshgrid(steps, steps)
    for i, gamma in enumerate(gammas[:3]):
        sensor = 2.6 * vector(gamma, 0.0)
        way = np.stack([sensor[0] - x, sensor[1] - y, np.full_like(x, sensor[2])], axis=-1)
        distance = np.linalg.norm(way, axis=-1)
        cosines = (-way[..., 2] / distance) * (way @ (sensor / 2.6)) / distance
        exact = float(np.mean(cosines / distance**2)) * 2.6**2 / math.cos(math.radians(gamma))
        near = field.intensity(directions[i], 2.6).mean() / far[i]
        assert near == pytest.approx(exact, abs=0.02)  # 1 % counting noise on each


def test_rays_are_the_same_for_the_same_seed() -> None:
    sun = sky_vector(40.0, 10.0)
    assert np.array_equal(trace(top(), sun, 3000, 9).flux, trace(top(), sun, 3000, 9).flux)
    assert not np.array_equal(trace(top(), sun, 3000, 9).flux, trace(top(), sun, 3000, 10).flux)
