"""The sun's images some minutes later, where nothing is simulated again."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.cases.model import Floats
from analysis.explain.fields import C_DEG, GAMMA_DEG, Fields
from analysis.explain.images_later import in_tubes, middles, ring_per_height, with_height_and_azimuth, with_the_sun
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings, sun_at
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import make_case

LATE = [-12.0, 7.0, 25.0]


def ring(suns: tuple[Floats, Floats], follows: float = 1.0) -> Floats:
    """What a long mirrored tube makes of suns: a ring about nadir as far as the suns from the zenith; (T, P, G).

    Or a ring that ``follows`` their height by so much only, beneath a lens that draws light together.
    """
    altitude_deg, azimuth_deg = suns
    radius = 12.0 * (1.0 - follows) + follows * (90.0 - altitude_deg)
    from_it = GAMMA_DEG[None, None, :] - radius[:, None, None]
    onwards = np.radians(C_DEG[None, :, None] - (180.0 - azimuth_deg)[:, None, None])
    return np.asarray((2.0 + np.cos(onwards)) * np.exp(-0.5 * (from_it / 9.0) ** 2) + 0.01)


def suns(scene: Scene, minutes: float) -> tuple[Floats, Floats]:
    late = np.int64(round(minutes * 60e9))
    return sun_at(scene.readings.case, middles(scene) + late)


def with_sun(scene: Scene, sun: Floats) -> Scene:
    """The same scene, whose prediction has another sun part."""
    made = dataclasses.replace(scene, memory={}, lit={})
    made.__dict__["fields"] = Fields(sun, scene.fields.sky)
    return made


@pytest.mark.parametrize("follows", [1.0, 0.6])
@pytest.mark.parametrize("minutes", LATE)
def test_a_ring_widens_as_the_sun_sinks_and_turns_with_its_azimuth(arm: Scene, minutes: float, follows: float) -> None:
    """To what cubics leave of a ring 9° wide; turned about the arc of the sun it would be no ring.

    A ring that is hardly wider than that itself lies over its own other side; what lies beyond the horizon is not seen.
    """
    now, later = ring(suns(arm, 0.0), follows), ring(suns(arm, minutes), follows)
    scene, height = with_sun(arm, now), suns(arm, 0.0)[0]
    assert scene.remember(ring_per_height)[in_tubes(arm)] == pytest.approx(follows, abs=0.15)
    wide = in_tubes(arm) & (height < 60.0)
    assert wide.sum() >= 2 and np.max(np.abs(later - now)[wide]) > 0.02
    moved = with_height_and_azimuth(scene, now, minutes)
    assert np.max(np.abs(moved - later)[wide]) < 0.2 * np.max(np.abs(later - now)[wide])
    arc = with_the_sun(scene, now, minutes)[wide] - later[wide]
    assert np.max(np.abs(arc)) > 0.5 * np.max(np.abs(later - now)[wide])


def test_suns_alike_tell_nothing_of_how_a_ring_follows(arm: Scene) -> None:
    same = (np.full_like(part, part[-1]) for part in suns(arm, 0.0))
    scene = with_sun(arm, ring((next(same), next(same))))
    tests = [t.model_copy(update={"sun_altitude_deg": 40.0 + 0.5 * k}) for k, t in enumerate(arm.readings.case.tests)]
    setup = arm.readings.case.setup.model_copy(update={"test": tuple(tests)})
    case = dataclasses.replace(arm.readings.case, setup=setup)
    alike = dataclasses.replace(scene, readings=dataclasses.replace(scene.readings, case=case), memory={})
    alike.__dict__["fields"] = scene.fields
    assert ring_per_height(alike) == pytest.approx(1.0)


def test_no_time_changes_nothing(arm: Scene) -> None:
    now = ring(suns(arm, 0.0))
    assert with_height_and_azimuth(arm, now, 0.0) == pytest.approx(now)


def test_a_clocks_way_by_height_and_azimuth_is_below_tubes_alone(arm: Scene) -> None:
    """Below other wells such a way is as the way without; without tubes there is none."""
    ways = {t.branch.label: t for t in terms_of(BY_ID["clock-offset"], arm)}
    image = "the image follows the sun"
    seen = {}
    for label in (image, f"{image}, below tubes by the sun's height and azimuth"):
        light = arm.dark_light()
        ways[label].illuminate(arm, light, np.array([9.0]))
        seen[label] = light.sun
    plain, below_tubes = seen.values()
    tubes = in_tubes(arm)
    assert np.any(tubes) and not np.all(tubes)
    assert below_tubes[~tubes] == pytest.approx(plain[~tubes])
    assert below_tubes[tubes] == pytest.approx(with_height_and_azimuth(arm, arm.dark_light().sun, 9.0)[tubes])
    assert np.max(np.abs(below_tubes - plain)[tubes]) > 0.01 * np.max(plain)


def test_dull_tubes_throw_no_rings(tmp_path: Path) -> None:
    case = make_case(tmp_path)
    dull = [s.model_copy(update={"wall_finish": "diffuse"}) for s in case.setup.system]
    scene = Scene(Readings.of(dataclasses.replace(case, setup=case.setup.model_copy(update={"system": dull}))))
    assert not np.any(in_tubes(scene))
    assert not any("height" in b.label for b in BY_ID["clock-offset"].branches(scene))
