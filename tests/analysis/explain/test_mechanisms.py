"""Each mechanism against the same effect worked out in another way (`effects`, or written here)."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.mechanisms.base import Term, predict, terms_of
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.readings import Readings
from analysis.explain.retrace import retraced_of
from analysis.explain.scene import Scene
from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, render_lm63
from tests.analysis.explain import effects
from tests.analysis.explain.campaign import NONE, TESTS, Floats, Truth, light, make_case, rows_of, sun_part
from tests.analysis.explain.roof import ROOF_TESTS, SKY_TESTS, beam_and_sky, picture_points, sun_distance, sun_of

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


SENSORS = "the goniometer's sensors"
# The last number is the largest error allowed, relative to the reading (to a fiftieth of the test's top in the dark).
# Closed forms are exact. Where fields are read between the nodes of a grid of 2.5° x 5°, linear interpolation errs by
# (step² / 8) x curvature: up to 1 % on images 16° wide; near the horizon, where intensity falls as a power, by 5 %.
# The room's tolerance is that of taking all bounces but the first as those of a sphere; a blur of the outgoing image
# treats light near the horizon otherwise than a blur of the source does.
ON_THE_ARM = [
    ("gamma-offset", "", (1.5,), effects.gamma_offset(1.5), 0.05),
    ("gamma-offset", "", (-1.5,), effects.gamma_offset(-1.5), 0.05),
    ("c-offset", "", (6.0,), effects.c_offset(6.0), 0.01),
    ("c-handedness", "zero in the north", (4.0,), effects.handedness(4.0), 0.01),
    ("c-handedness", "zero in the south", (0.0,), effects.handedness(180.0), 0.01),
    ("channel-swap", "gonio.g45 and gonio.g55", (), effects.swap(45.0, 55.0), 0.005),
    ("near-field", "closed form", (1.0,), effects.near_field, 0.02),
    ("dark-offset", SENSORS, (30.0,), effects.offset(30.0), 1e-6),
    ("nonlinearity", SENSORS, (0.05,), effects.power(0.05, MIDDLE), 1e-6),
    ("saturation", f"{SENSORS}, gradual", (0.3,), effects.dead_time(BASE.max() / 0.3), 1e-6),
    ("saturation", f"{SENSORS}, clipped", (1.5,), effects.cut(BASE.max() / 1.5), 1e-6),
    ("channel-gain", "gonio.g65", (0.1,), effects.gain(65.0, 0.1), 1e-6),
    ("cosine-response", "", (0.1,), effects.cosine(0.1), 1e-6),
    ("sky-sun-ratio", "", (0.15,), effects.split(0.15), 0.002),
    ("lens-haze", "entry lens", (0.1,), effects.entry_haze(0.1), 0.002),
    ("lens-haze", "exit lens", (0.1,), effects.exit_haze(0.1), 0.003),
    ("soiling", "every system", (0.12,), effects.dirt(0.12), 0.002),
    ("circumsolar-aureole", "", (0.4, 6.5), effects.aureole(0.4, 6.5), 0.04),
    ("stray-light", "constant", (4.0,), effects.offset(4.0 * 2.6**2), 1e-6),
    ("stray-light", "following the daylight", (4.0,), effects.leak(4e5 / MEAN_LX), 1e-6),
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


def test_a_variant_of_the_case_is_reached_in_full(tmp_path: Path) -> None:
    """Half way along the case's own re-simulation lies half of its change; at its end, the variant itself."""
    gamma, c = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.1, 5.0)
    files, change = {}, {}
    for t in TESTS:
        candela = sun_part(t, gamma[None, :], c[:, None] - 20.0)
        candela[-1] = candela[0]
        name = f"simulated/turned-{t.id}.ies"
        keywords = {"TEST": "x", "TESTLAB": "x", "ISSUEDATE": "x", "MANUFAC": "x"}
        files[name] = render_lm63(Distribution(gamma, c, candela, keywords), generation=FileGeneration.SIMULATED)
        change[t.id] = {"sun": name, "sky": f"simulated/{t.id}-sky.ies"}
    variant = {"mechanism": "lens-orientation", "setting": {"rotation_deg": 20.0}, "simulated": change}
    case = make_case(tmp_path / "case", flaws=NONE, change={"variant": [variant]}, more=files)
    scene = Scene(Readings.of(case), retraced_of(case))
    made = acted(scene, "lens-orientation", "case's variants of rotation_deg", 20.0)
    exact = effects.part(ROWS, sun_part, ROWS.gamma_deg, ROWS.c_deg - 20.0) + effects._sky(ROWS)
    # between planes of 5° both images are read linearly (1 %); a ratio is limited where the image was 50 times weaker
    within = effects._sun(ROWS) > 0.02 * effects.part(ROWS, sun_part, ROWS.gamma_deg, ROWS.c_deg - 20.0)
    assert np.max(np.abs(made / exact - 1.0)[within]) < 0.02
    half = acted(scene, "lens-orientation", "case's variants of rotation_deg", 10.0)
    assert half == pytest.approx((made + BASE) / 2.0, rel=1e-9)


# the roof

ALTITUDE, AZIMUTH = sun_of(ROOF_TESTS, 60.0)
BEAM, SKY = beam_and_sky(ALTITUDE)


def _tilted(north_deg: float, east_deg: float) -> Floats:
    """Beam on a plane by vectors; half of the sky's cosine-weighted hemisphere by the view factor of a tilted plane."""
    tilt, towards = np.hypot(north_deg, east_deg), np.arctan2(east_deg, north_deg)
    s = np.sin(np.radians(tilt))
    normal = np.array([s * np.sin(towards), s * np.cos(towards), np.cos(np.radians(tilt))])
    a, z = np.radians(ALTITUDE), np.radians(AZIMUTH)
    sun = np.stack([np.cos(a) * np.sin(z), np.cos(a) * np.cos(z), np.sin(a)], axis=1)
    return np.asarray(BEAM * np.maximum(sun @ normal, 0.0) / np.sin(a) + SKY * (1.0 + normal[2]) / 2.0)


def _cosine(error: float) -> Floats:
    """The gentle law at the sun; over the sky the mean of it, weighted by cosine and solid angle, by steps."""
    z = (np.arange(9000) + 0.5) / 100.0
    weight = np.sin(2.0 * np.radians(z))
    law = 2.0 * (1.0 - np.cos(np.radians(z)))
    mean = float(np.sum(weight * law) / np.sum(weight))
    return BEAM * (1.0 + error * 2.0 * (1.0 - np.sin(np.radians(ALTITUDE)))) + SKY * (1.0 + error * mean)


def _late(minutes: float) -> Floats:
    """The sun's height later, at the same strength of the normal beam."""
    later = sun_of(ROOF_TESTS, 60.0 + 60.0 * minutes)[0]
    return BEAM * np.sin(np.radians(later)) / np.sin(np.radians(ALTITUDE)) + SKY


@pytest.mark.parametrize(
    ("mechanism", "way", "theta", "exact"),
    [
        ("meter-tilt", "velux", (2.0, -3.0), _tilted(2.0, -3.0)),
        ("meter-gain", "velux", (0.04,), 1.04 * (BEAM + SKY)),
        ("meter-cosine", "velux (gentle law)", (-0.05,), _cosine(-0.05)),
        ("meter-range-limit", "velux", (0.2,), np.minimum(BEAM + SKY, (BEAM + SKY).max() / 1.2)),
        ("clock-offset", "", (12.0,), _late(12.0)),
    ],
)
def test_the_roof_reads_what_the_effect_gives(
    roof: Scene, mechanism: str, way: str, theta: tuple[float, ...], exact: Floats
) -> None:
    ways = [t for t in terms_of(BY_ID[mechanism], roof) if t.tests is None and t.branch.label == way]
    assert len(ways) == 1
    made = predict(roof, (ways[0],), np.array(theta))
    count = len(ROOF_TESTS)
    low_sun = ALTITUDE > 3.0  # lower, the forms stop at 88° from the zenith
    assert made[:count][low_sun] == pytest.approx(exact[low_sun], rel=2e-3)
    if mechanism != "clock-offset":
        assert made[count:] == pytest.approx(BEAM + SKY), "the other meter is another meter"


# the camera

ZENITH, ROUND = picture_points()
RIM = np.tile(ZENITH, len(SKY_TESTS)) / 90.0


@pytest.mark.parametrize(
    ("mechanism", "way", "theta", "factor"),
    [
        ("vignetting", "square law", (0.3,), 1.0 - 0.3 * RIM**2),
        ("vignetting", "fourth-power law", (0.3,), 1.0 - 0.3 * RIM**4),
        ("spectral-mismatch", "by sky class", (0.2,), np.repeat([1.2, 1.2, 1.1, 1.0], len(ZENITH))),
        (
            "spectral-mismatch",
            "by distance from the sun",
            (0.2,),
            1.2 - 0.2 * np.exp(-np.concatenate([sun_distance(ZENITH, ROUND, *t.sun) for t in SKY_TESTS]) / 30.0),
        ),
    ],
)
def test_the_picture_shows_what_the_effect_gives(
    picture: Scene, mechanism: str, way: str, theta: tuple[float, ...], factor: Floats
) -> None:
    assert acted(picture, mechanism, way, *theta) == pytest.approx(picture.readings.simulated * factor, rel=2e-3)


def test_a_veil_is_a_share_of_the_mean_luminance(picture: Scene) -> None:
    mean = np.repeat([t.diffuse_lx / np.pi for t in SKY_TESTS], len(ZENITH))
    assert acted(picture, "veiling-glare", "", 0.04) == pytest.approx(picture.readings.simulated + 0.04 * mean)


def test_a_wrong_projection_reads_the_sky_beside(picture: Scene) -> None:
    from tests.analysis.explain.roof import luminance

    shift = 2.0 * np.sin(2.0 * np.radians(ZENITH))
    exact = np.concatenate([luminance(t, ZENITH + shift, ROUND) for t in SKY_TESTS])
    made = acted(picture, "projection-error", "", 2.0)
    base = picture.readings.simulated
    # slopes come from forty places 20° apart: the sign and most of the size, not all of it
    assert np.corrcoef(np.log(made / base), np.log(exact / base))[0, 1] > 0.7
