"""Each mechanism against the same effect worked out in another way (`effects`, or written here)."""

import dataclasses
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from analysis.explain import retrace
from analysis.explain.mechanisms.base import FORM_OF_SIZE, IMAGES_OF_SIZE, Branch, Term, predict
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings, sun_at
from analysis.explain.scene import Scene
from analysis.sky.perez import PerezSky
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import TESTS, Floats, Rows, Truth, light, make_case, rows_of
from tests.analysis.explain.roof import (
    ROOF_TESTS,
    SKY_TESTS,
    beam_and_sky,
    luminance,
    picture_points,
    sky_case,
    sun_of,
)

ROWS = rows_of(TESTS)
BASE = light(ROWS)
MIDDLE = float(np.exp(np.mean(np.log(BASE))))
MEAN_LX = float(np.mean([t.global_lx for t in TESTS]))


def term(scene: Scene, mechanism: str, way: str = "") -> Term:
    """A mechanism acting in the way of that label."""
    ways = {t.branch.label: t for t in terms_of(BY_ID[mechanism], scene)}
    assert way in ways, f"{mechanism} acts in {list(ways)}"
    return ways[way]


def acted(scene: Scene, mechanism: str, way: str, *theta: float) -> Floats:
    return predict(scene, (term(scene, mechanism, way),), np.array(theta))


def flatter(rows: Rows) -> Floats:
    """What a response makes of the light that tells four fifths of the brightest, and ever less below."""
    return light(rows) / (1.0 + 0.25 * light(rows) / BASE.max())


SENSORS = "the goniometer's sensors"
LATE = effects.gradual(0.2, MIDDLE * np.exp(0.4), 1.3)
# The last number is the largest error allowed, relative to the reading (to a fiftieth of the test's top in the dark).
# Closed forms are exact. Where fields are read between the nodes of a grid of 2.5° x 5°, linear interpolation errs by
# (step² / 8) x curvature: up to 1 % on images 16° wide; near the horizon, where intensity falls as a power, by 5 %.
# The room's tolerance is that of the truth's patches, 40 cm wide where sensors hang 20 cm below them; a blur of the
# outgoing image treats light near the horizon otherwise than a blur of the source does. How ranges change over is drawn
# out in two ways.
ON_THE_ARM = [
    ("gamma-offset", "", (1.5,), effects.gamma_offset(1.5), 0.05),
    ("gamma-offset", "", (-1.5,), effects.gamma_offset(-1.5), 0.05),
    ("c-offset", "", (6.0,), effects.c_offset(6.0), 0.01),
    ("c-handedness", "zero in the north", (4.0,), effects.handedness(4.0), 0.01),
    ("c-handedness", "zero in the south", (0.0,), effects.handedness(180.0), 0.01),
    ("c-handedness", "zero in the north, box only", (4.0,), effects.handedness(4.0, ("box",)), 0.01),
    ("channel-swap", "gonio.g45 and gonio.g55", (), effects.swap(45.0, 55.0), 0.005),
    ("near-field", "closed form", (1.0,), effects.near_field, 0.02),
    ("dark-offset", SENSORS, (30.0,), effects.offset(30.0), 1e-6),
    ("dark-offset", "each sensor its own", effects.OFFSETS, effects.offsets(effects.OFFSETS), 1e-6),
    ("nonlinearity", SENSORS, (0.05,), effects.power(0.05, MIDDLE), 1e-6),
    ("nonlinearity", f"{SENSORS}, bent", (-0.3,), effects.bend(-0.3, BASE.max()), 1e-6),
    (
        "nonlinearity",
        f"{SENSORS}, bent less and less",
        (-0.2,),
        lambda rows: light(rows) / (1.0 + 0.25 * light(rows) / BASE.max()),
        1e-6,
    ),
    ("nonlinearity", f"{SENSORS}, by ranges", (0.05, 0.5), effects.ranges(0.05, MIDDLE * np.exp(0.5)), 0.008),
    ("nonlinearity", f"{SENSORS}, from one response to another", (0.2, 0.4, 1.3), LATE, 1e-6),
    ("saturation", f"{SENSORS}, rounded", (0.8, 5.0), effects.rounded(BASE.max() / 0.8, 5.0), 1e-6),
    ("saturation", f"{SENSORS}, gradual", (0.3,), effects.dead_time(BASE.max() / 0.3), 1e-6),
    ("saturation", f"{SENSORS}, clipped", (1.5,), effects.cut(BASE.max() / 1.5), 1e-6),
    ("saturation", f"{SENSORS}, knee", (2.0, 0.3), effects.knee(BASE.max() / 2.0, 0.3), 1e-6),
    ("channel-gain", "gonio.g65", (0.1,), effects.gain(65.0, 0.1), 1e-6),
    ("cosine-response", "", (0.1,), effects.cosine(0.1), 1e-6),
    ("cosine-response", "grazing light", (-0.3,), effects.grazing(-0.3), 1e-6),
    ("sky-sun-ratio", "", (0.15,), effects.split(0.15), 0.002),
    ("sky-sun-ratio", "a share of the beam", (0.08,), effects.cone(0.08), 0.002),
    ("sky-sun-ratio", "the beam alone", (-0.2,), effects.beam(-0.2), 0.002),
    ("lens-haze", "entry lens", (0.1,), effects.entry_haze(0.1), 0.002),
    ("lens-haze", "exit lens", (0.1,), effects.exit_haze(0.1), 0.003),
    ("lens-haze", "entry lens, box only", (0.1,), effects.only("box", effects.entry_haze(0.1)), 0.002),
    ("lens-haze", "exit lens, tube only", (0.1,), effects.only("tube", effects.exit_haze(0.1)), 0.003),
    ("soiling", "every system", (0.12,), effects.dirt(0.12), 0.002),
    ("soiling", "tube", (0.12,), effects.only("tube", effects.dirt(0.12)), 0.002),
    ("soiling", "every system, scattering", (0.12, 0.5), effects.scattering_dirt(0.12, 0.5), 0.003),
    ("soiling", "box, scattering", (0.2, 0.3), effects.only("box", effects.scattering_dirt(0.2, 0.3)), 0.003),
    ("soiling", "every system, both faces", (0.03,), effects.dirt_below(0.03), 0.01),
    ("soiling", "tube, both faces", (0.03,), effects.only("tube", effects.dirt_below(0.03)), 0.01),
    ("soiling", "box, domed", (0.12,), effects.only("box", effects.domed(0.12)), 1e-6),
    ("circumsolar-aureole", "images spread", (0.4, 6.5), effects.aureole(0.4, 6.5), 0.04),
    ("stray-light", "constant", (4.0,), effects.offset(4.0 * 2.6**2), 1e-6),
    ("stray-light", "following the daylight", (4.0,), effects.leak(4e5 / MEAN_LX), 1e-6),
    ("stray-light", "constant, from one side", (4.0, 200.0, 0.4), effects.lamp(4.0, 200.0, 0.4), 1e-6),
    ("stray-light", "following the daylight, from one side", (4.0, 90.0, 1.0), effects.gap(4e5 / MEAN_LX, 90.0), 1e-6),
    ("room-interreflection", "", (0.08, 0.03), effects.room(0.08, 0.03), 0.006),
    ("room-interreflection", "", (0.3, 0.2), effects.room(0.3, 0.2), 0.05),
]


@pytest.mark.parametrize(("mechanism", "way", "theta", "truth", "allowed"), ON_THE_ARM)
def test_the_arm_reads_what_the_effect_gives(
    arm: Scene, mechanism: str, way: str, theta: tuple[float, ...], truth: Truth, allowed: float
) -> None:
    made, exact = acted(arm, mechanism, way, *theta), truth(ROWS)
    top = np.array([exact[ROWS.test == k].max() for k in range(len(TESTS))])[ROWS.test]
    scale = np.hypot(exact, 0.02 * top)
    off, effect = np.abs(made - exact) / scale, np.abs(BASE - exact) / scale
    assert off.max() < allowed
    assert np.sqrt(np.mean(off**2)) < 0.15 * np.sqrt(np.mean(effect**2)), "the form is hardly better than nothing"


def test_effects_act_together_in_the_order_of_the_chain(arm: Scene) -> None:
    """A turned arm, then one dull sensor, then an offset, in whatever order they are named."""
    terms = (term(arm, "dark-offset", SENSORS), term(arm, "channel-gain", "gonio.g25"), term(arm, "c-offset"))
    made = predict(arm, terms, np.array([40.0, -0.2, 5.0]))
    turned = light(ROWS, None, ROWS.c_deg + 5.0)
    exact = turned * np.where(ROWS.gamma_deg == 25.0, 0.8, 1.0) + 40.0
    # the offset belongs to the sensor as the gain does; whichever comes first, they differ by the gain of the offset
    assert np.max(np.abs(made - exact) / exact) < 0.2 * 40.0 / exact.min() + 0.01
    elsewhere = ROWS.gamma_deg != 25.0
    assert np.max(np.abs(made - exact)[elsewhere] / exact[elsewhere]) < 0.01


# the roof

ALTITUDE, AZIMUTH = sun_of(ROOF_TESTS, 60.0)
BEAM, SKY = beam_and_sky(ALTITUDE)


def _skies() -> tuple[Floats, Floats, Floats]:
    """Perez' skies of the tests on a plain grid: directions (M, 3), solid angles (M,), luminance (T, M) [cd/m²]."""
    zenith, round_ = np.meshgrid(np.radians(np.arange(0.5, 90.0)), np.radians(np.arange(1.0, 360.0, 2.0)))
    v = np.stack([np.sin(zenith) * np.sin(round_), np.sin(zenith) * np.cos(round_), np.cos(zenith)], axis=-1)
    solid = np.sin(zenith) * np.radians(1.0) * np.radians(2.0)
    skies = [
        PerezSky.from_illuminances(b / np.sin(np.radians(h)), s, h, z).luminance(v.reshape(-1, 3))
        for b, s, h, z in zip(BEAM, SKY, np.maximum(ALTITUDE, 3.0), AZIMUTH, strict=True)
    ]
    return v.reshape(-1, 3), solid.ravel(), np.stack(skies)


def _tilted(north_deg: float, east_deg: float) -> Floats:
    """Beam on a plane by vectors; the sky's light on it summed over a grid of directions."""
    tilt, towards = np.hypot(north_deg, east_deg), np.arctan2(east_deg, north_deg)
    s = np.sin(np.radians(tilt))
    normal = np.array([s * np.sin(towards), s * np.cos(towards), np.cos(np.radians(tilt))])
    a, z = np.radians(ALTITUDE), np.radians(AZIMUTH)
    sun = np.stack([np.cos(a) * np.sin(z), np.cos(a) * np.cos(z), np.sin(a)], axis=1)
    v, solid, skies = _skies()
    caught = skies @ (np.maximum(v @ normal, 0.0) * solid) / (skies @ (v[:, 2] * solid))
    return np.asarray(BEAM * np.maximum(sun @ normal, 0.0) / np.sin(a) + SKY * caught)


def _cosine(error: float, steepness: float) -> Floats:
    """The law at the sun; over the sky its mean by luminance, cosine and solid angle, on a grid of directions."""
    v, solid, skies = _skies()
    law = (2.0 * (1.0 - v[:, 2])) ** steepness
    mean = skies @ (law * v[:, 2] * solid) / (skies @ (v[:, 2] * solid))
    at_sun = (2.0 * (1.0 - np.sin(np.radians(ALTITUDE)))) ** steepness
    return BEAM * (1.0 + error * at_sun) + SKY * (1.0 + error * mean)


def _shaded(error: float) -> Floats:
    """A rim's shadow, as long as the tangent of the sun's angle from the zenith, up to 85°."""
    v, solid, skies = _skies()
    along = np.tan(np.minimum(np.arccos(v[:, 2]), np.radians(85.0))) / np.tan(np.radians(60.0))
    mean = skies @ (along * v[:, 2] * solid) / (skies @ (v[:, 2] * solid))
    at_sun = np.tan(np.radians(np.minimum(90.0 - ALTITUDE, 85.0))) / np.tan(np.radians(60.0))
    return BEAM * (1.0 + error * at_sun) + SKY * (1.0 + error * mean)


def _flattened(share: float) -> Floats:
    """A dead time that takes ``share`` of the brightest reading to first order."""
    return (BEAM + SKY) / (1.0 + share * (BEAM + SKY) / (BEAM + SKY).max())


def _late(minutes: float) -> Floats:
    """The invented day's own beam and sky later."""
    return np.asarray(sum(beam_and_sky(sun_of(ROOF_TESTS, 60.0 + 60.0 * minutes)[0])))


@pytest.mark.parametrize(
    ("mechanism", "way", "theta", "exact", "allowed"),
    [
        ("meter-tilt", "velux", (2.0, -3.0), _tilted(2.0, -3.0), 4e-3),  # skies are worked out in steps of 2°
        ("meter-gain", "velux", (0.04,), 1.04 * (BEAM + SKY), 1e-9),
        ("meter-cosine", "velux", (-0.05, 1.0), _cosine(-0.05, 1.0), 4e-3),
        ("meter-cosine", "velux", (-0.05, 2.7), _cosine(-0.05, 2.7), 4e-3),
        (
            "meter-range-limit",
            "velux, knee",
            (0.9, 4.0),
            ((BEAM + SKY) ** -4.0 + ((BEAM + SKY).max() / 0.9) ** -4.0) ** -0.25,
            1e-9,
        ),
        ("meter-cosine", "velux, rim", (-0.05, 1.0), _shaded(-0.05), 4e-3),
        ("meter-range-limit", "velux", (0.2,), np.minimum(BEAM + SKY, (BEAM + SKY).max() / 1.2), 1e-9),
        (
            "meter-range-limit",
            "velux, gradual",
            (0.1,),
            (BEAM + SKY) / (1 + 0.1 * (BEAM + SKY) / (BEAM + SKY).max()),
            1e-9,
        ),
        ("clock-offset", "", (12.0,), _late(12.0), 0.03),  # the invented sky brightens otherwise than as a root
    ],
)
def test_the_roof_reads_what_the_effect_gives(
    roof: Scene, mechanism: str, way: str, theta: tuple[float, ...], exact: Floats, allowed: float
) -> None:
    ways = [t for t in terms_of(BY_ID[mechanism], roof) if t.tests is None and t.branch.label == way]
    assert len(ways) == 1
    made = predict(roof, (ways[0],), np.array(theta))
    count = len(ROOF_TESTS)
    up = ALTITUDE > 4.0  # lower, the forms stop at 88° from the zenith
    assert made[:count][up] == pytest.approx(exact[up], rel=allowed)
    if mechanism != "clock-offset":
        assert made[count:] == pytest.approx(BEAM + SKY), "the other meter is another meter"


@pytest.mark.parametrize("minutes", [-20.0, 20.0])
def test_a_roof_that_has_another_clock_saw_another_share_of_sun(arm: Scene, minutes: float) -> None:
    """By that clock illuminances are of a sun that stood lower or higher; by the room's they are the arm's own."""
    own, roofs = arm.dark_light(), arm.dark_light()
    image = "the image follows the sun"
    for seen, way in ((own, image), (roofs, f"{image}, by the roof's clock")):
        term(arm, "clock-offset", way).illuminate(arm, seen, np.array([minutes]))
    assert roofs.sun == pytest.approx(own.sun)
    assert np.all(own.sun_factor == 1.0)
    r = arm.readings
    middles = np.array([r.utc_ns[r.test == k].mean() for k in range(len(r.case.tests))], dtype=np.int64)
    now, later = (sun_at(r.case, middles + np.int64(late * 60e9))[0] for late in (0.0, minutes))
    height = np.sin(np.radians(later)) / np.sin(np.radians(now))
    assert np.min(np.abs(height - 1.0)) > 0.001
    share = roofs.sun_factor / roofs.sky_factor
    assert np.all((share - 1.0) * (height[r.test] - 1.0) > 0.0)
    assert share == pytest.approx(height[r.test], rel=0.1)  # the air takes more of a low beam, and the sky dims with it


def test_under_an_overcast_sky_what_is_taken_from_the_sky_is_the_suns(tmp_path: Path) -> None:
    """A beam of a hundredth of the diffuse light becomes many times itself; of none that was read nothing is made."""
    for share, factor in ((0.01, 1.0 + 0.2 / 0.01), (0.001, 1.0)):
        dull = dataclasses.replace(TESTS[0], global_lx=9000.0 * (1.0 + share), diffuse_lx=9000.0, sky="overcast")
        scene = Scene(Readings.of(make_case(tmp_path / str(share), tests=(dull, *TESTS[1:3]))))
        light = scene.dark_light()
        term(scene, "sky-sun-ratio", "").illuminate(scene, light, np.array([-0.2]))
        rows = scene.readings.test == 0
        assert light.sun_factor[rows] == pytest.approx(factor, rel=2e-2)
        assert light.sky_factor[rows] == pytest.approx(0.8)


def test_what_a_disc_hides_wrongly_is_none_of_an_overcast_sky(tmp_path: Path) -> None:
    """Where the sun shone the split is as it is under all skies."""
    dull = dataclasses.replace(TESTS[0], global_lx=9090.0, diffuse_lx=9000.0, sky="overcast")
    scene = Scene(Readings.of(make_case(tmp_path, tests=(dull, *TESTS[1:3]))))
    under_all, where_it_shone = scene.dark_light(), scene.dark_light()
    ways = {t.branch.label: t for t in terms_of(BY_ID["sky-sun-ratio"], scene)}
    ways[""].illuminate(scene, under_all, np.array([0.1]))
    ways["where the sun shone"].illuminate(scene, where_it_shone, np.array([0.1]))
    overcast = scene.readings.test == 0
    for part in ("sun_factor", "sky_factor"):
        assert getattr(where_it_shone, part)[overcast] == pytest.approx(1.0)
        assert getattr(where_it_shone, part)[~overcast] == pytest.approx(getattr(under_all, part)[~overcast])
    assert under_all.sky_factor[overcast] == pytest.approx(1.1)


def test_a_disc_that_is_too_narrow_lets_beam_on_the_shaded_meter(roof: Scene) -> None:
    """The second meter is shaded: what it reads more is a share of the beam that the first sees at that moment."""
    count, r = len(ROOF_TESTS), roof.readings
    seen = np.repeat([1.0, 0.0], count)
    shaded = Scene(dataclasses.replace(r, simulated=r.sky + seen * r.sun, sun=seen * r.sun))
    made = acted(shaded, "sky-sun-ratio", "through the shading disc", 0.04)
    assert made[count:] == pytest.approx(SKY + 0.04 * BEAM)
    assert made[:count] == pytest.approx(BEAM + SKY), "the open meter sees both"
    assert [t.branch.label for t in terms_of(BY_ID["sky-sun-ratio"], roof)] == [""], "no meter is shaded"


# the camera

ZENITH, ROUND = picture_points()
RIM = np.tile(ZENITH, len(SKY_TESTS)) / 90.0
CLEARNESS = [1.0 + (t.global_lx - t.diffuse_lx) / np.sin(np.radians(t.sun[0])) / t.diffuse_lx for t in SKY_TESTS]
OPEN = [
    np.sqrt(share * min(np.log(e) / np.log(6.2), 1.0)) for share, e in zip((1.0, 1.0, 0.5, 0.0), CLEARNESS, strict=True)
]


@pytest.mark.parametrize(
    ("mechanism", "way", "theta", "factor"),
    [
        ("vignetting", "square law", (0.3,), 1.0 - 0.3 * RIM**2),
        ("vignetting", "fourth-power law", (0.3,), 1.0 - 0.3 * RIM**4),
        ("vignetting", "cube law", (0.3,), 1.0 - 0.3 * RIM**3),
        ("channel-gain", "sky", (0.05,), 1.05),
        ("spectral-mismatch", "by sky class", (0.2,), 1.0 + 0.2 * np.repeat(OPEN, len(ZENITH))),
    ],
)
def test_the_picture_shows_what_the_effect_gives(
    picture: Scene, mechanism: str, way: str, theta: tuple[float, ...], factor: Floats
) -> None:
    assert acted(picture, mechanism, way, *theta) == pytest.approx(picture.readings.simulated * factor, rel=2e-3)


def test_blueness_goes_with_the_colour_temperature_that_a_luminance_has(picture: Scene) -> None:
    luminance = picture.readings.simulated
    kelvin = 1e6 / (-180.956 + 78.648 * np.log10(luminance))
    white, blue = 6191.0, 16_000.0
    blueness = (1.0 / white - 1.0 / kelvin) / (1.0 / white - 1.0 / blue)
    made = acted(picture, "spectral-mismatch", "by the luminance of each direction", 0.2) / luminance - 1.0
    inside = (luminance > 500.0) & (blueness > 0.0) & (blueness < 1.2)
    assert inside.sum() > 50
    assert made[inside] == pytest.approx((0.2 * np.repeat(OPEN, len(ZENITH)) * blueness)[inside], abs=1e-6)
    assert np.all(made[blueness < 0.0] == 0.0)


@pytest.mark.parametrize(
    ("way", "power"), [("", None), ("growing to the rim", 1), ("at the rim", 3)], ids=["half way", "rim", "cube"]
)
def test_a_wrong_projection_reads_the_sky_beside(picture: Scene, way: str, power: int | None) -> None:
    shift = 2.0 * (np.sin(2.0 * np.radians(ZENITH)) if power is None else (ZENITH / 90.0) ** power)
    exact = np.concatenate([luminance(t, ZENITH + shift, ROUND) for t in SKY_TESTS])
    made = np.log(acted(picture, "projection-error", way, 2.0) / picture.readings.simulated)
    exact = np.log(exact / picture.readings.simulated)
    assert np.corrcoef(made, exact)[0, 1] > 0.7
    high = slice(40, 120)  # forty places 20° apart show the glow of a high sun; beside a low one they are too few
    assert np.sqrt(np.mean((made - exact)[high] ** 2)) < (0.6 if power == 3 else 0.5) * np.sqrt(
        np.mean(exact[high] ** 2)
    )


@pytest.mark.parametrize(("way", "share"), [("", 0.866), ("growing to the rim", 0.667), ("at the rim", 0.296)])
def test_a_projection_tells_its_shift_at_60_degrees(picture: Scene, way: str, share: float) -> None:
    term = next(t for t in terms_of(BY_ID["projection-error"], picture) if t.branch.label == way)
    told = term.mechanism.report(np.array([-3.0]), np.array([0.5]), term)["shift_at_60_deg"]
    assert (told["value"], told["uncertainty"]) == pytest.approx((-3.0 * share, 0.5 * share), rel=2e-3)


def test_a_late_camera_sees_the_glow_moved(picture: Scene) -> None:
    exact = []
    for t in SKY_TESTS:
        later = dataclasses.replace(t, start=t.start + timedelta(minutes=25))
        exact.append(np.log(luminance(later, ZENITH, ROUND) / luminance(t, ZENITH, ROUND)))
    made = np.log(acted(picture, "clock-offset", "", 25.0) / picture.readings.simulated)
    for k in (1, 2):  # beside the first, low sun forty places are too few; the last sky is overcast: nothing moves
        seen, wanted = made[40 * k : 40 * k + 40], exact[k]
        assert np.std(seen - seen.mean() - wanted + wanted.mean()) < 0.35 * np.std(wanted)


def test_a_late_camera_as_the_prediction_is_taken_off_it(tmp_path: Path) -> None:
    meter = Scene(Readings.of(sky_case(tmp_path / "meter", kind="luminance-meter")))
    camera = Scene(Readings.of(sky_case(tmp_path / "camera")))
    base = camera.readings.simulated
    one, other = (acted(s, "clock-offset", "", 20.0) / base for s in (camera, meter))
    assert one * other == pytest.approx(1.0)
    assert np.ptp(one) > 0.05


def test_a_meter_may_be_right_at_any_level(roof: Scene) -> None:
    (way,) = [t for t in terms_of(BY_ID["nonlinearity"], roof) if t.branch.label == "velux"]
    level = way.branch.facts["level"]
    made = predict(roof, (way,), np.array([-0.1, np.log(30_000.0 / level)]))[: len(ROOF_TESTS)]
    assert made == pytest.approx((BEAM + SKY) * ((BEAM + SKY) / 30_000.0) ** -0.1)


@pytest.mark.parametrize(("of_case", "open_share"), [(True, FORM_OF_SIZE), (False, IMAGES_OF_SIZE)])
def test_prisms_of_another_lens_leave_open_how_far_they_are_not_isotropic(
    arm: Scene, of_case: bool, open_share: float
) -> None:
    one = np.ones((2, 1, 1, 1))
    mechanism = BY_ID["lens-anisotropy"]
    way = retrace.Path("a pattern", mechanism.parameters[0], np.array([0.0, 1.0]), one, one, of_case=of_case)
    assert mechanism.size_error_in(arm, Branch(way.label, way)) == open_share
