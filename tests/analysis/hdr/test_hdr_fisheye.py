"""Lens geometry: there and back, the right way round, and beyond the horizon."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.hdr.fisheye import Lens, find_circle
from labdaq.directions import angle_between, sky_vector

LENSES = [
    Lens(500.0, 640.0, 450.0),
    Lens(500.0, 640.0, 450.0, 93.0, "equisolid", up_azimuth_deg=33.0),
    Lens(510.0, 630.0, 470.0, 91.5, "polynomial", (1.08, -0.05, -0.03), up_azimuth_deg=200.0, east_at_right=True),
]


@pytest.mark.parametrize("lens", LENSES)
@given(altitude=st.floats(-1.0, 90.0), azimuth=st.floats(0.0, 360.0))
def test_place_and_direction_are_inverse(lens: Lens, altitude: float, azimuth: float) -> None:
    d = sky_vector(altitude, azimuth)
    row, column = lens.place(d)
    # theta is looked up in a table of 4000 steps
    assert float(angle_between(lens.direction(row, column), d)) < 1e-4


def test_north_up_east_left() -> None:
    lens = LENSES[0]
    for azimuth, (row, column) in {0.0: (50, 640), 90.0: (500, 190), 180.0: (950, 640), 270.0: (500, 1090)}.items():
        y, x = lens.place(sky_vector(0.0, azimuth))
        assert (round(float(y)), round(float(x))) == (row, column)
    mirrored = Lens(500.0, 640.0, 450.0, east_at_right=True)
    assert round(float(mirrored.place(sky_vector(0.0, 90.0))[1])) == 1090
    turned = Lens(500.0, 640.0, 450.0, up_azimuth_deg=90.0)  # east at the top: north is then at the right
    assert [round(float(v)) for v in turned.place(sky_vector(0.0, 90.0))] == [50, 640]
    assert [round(float(v)) for v in turned.place(sky_vector(0.0, 0.0))] == [500, 1090]


def test_shapes() -> None:
    equidistant, equisolid = Lens(0, 0, 1000.0), Lens(0, 0, 1000.0, 90.0, "equisolid")
    assert float(equidistant.radius(45.0)) == pytest.approx(500.0)
    assert float(equisolid.radius(60.0)) == pytest.approx(1000.0 * np.sin(np.radians(30.0)) / np.sin(np.radians(45.0)))
    # taking one for the other: up to 3.8°, at 52° from the axis
    theta = np.linspace(0.0, 90.0, 901)
    off = equidistant.theta(equisolid.radius(theta)) - theta
    assert np.max(np.abs(off)) == pytest.approx(3.8, abs=0.1)
    assert theta[np.argmax(np.abs(off))] == pytest.approx(52.0, abs=3.0)


def test_it_goes_on_beyond_90_degrees() -> None:
    # OpenCV's fisheye model puts 90.1° at -784 pixels
    lens = Lens(500.0, 500.0, 450.0, 93.0)
    radii = lens.radius(np.linspace(80.0, 93.0, 100))
    assert np.all(np.diff(radii) > 0.0)
    assert float(lens.theta(lens.radius(92.0))) == pytest.approx(92.0, abs=1e-3)


def test_vignetting_is_a_falloff() -> None:
    lens = Lens(0, 0, 500.0, vignetting=(0.1755458928191, -0.528613562104476))  # Canon 5D II, 8 mm, f/5.6
    assert float(lens.falloff(0.0)) == 1.0
    assert float(lens.falloff(90.0)) == pytest.approx(0.647, abs=0.001)  # 35 % lost at the rim


@pytest.mark.parametrize(
    "words",
    [
        {"projection": "orthographic"},
        {"radius_px": 0.0},
        {"edge_deg": 200.0},
        {"projection": "polynomial", "coefficients": (1.0, -0.6)},
        {"vignetting": (-1.2,)},
    ],
)
def test_impossible_lenses_are_refused(words: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"lens|coefficients"):
        Lens(**{"centre_row": 1.0, "centre_column": 1.0, "radius_px": 10.0, **words})  # type: ignore[arg-type]


@pytest.mark.parametrize("trees", [False, True])
def test_the_circle_is_found(trees: bool) -> None:
    lens = Lens(412.3, 505.7, 371.0)
    rows, columns = np.mgrid[0:800, 0:1000] + 0.5
    d = lens.direction(rows, columns)
    r = np.hypot(rows - 412.3, columns - 505.7)
    sky = np.where(r < 371.0, 3000.0 + 4000.0 * np.clip(d[..., 0], 0.0, 1.0), 15.0)
    if trees:  # dark up to 6° over a third of the horizon
        azimuth = np.degrees(np.arctan2(d[..., 0], d[..., 1])) % 360.0
        sky = np.where((d[..., 2] < np.sin(np.radians(6.0))) & (azimuth < 120.0) & (r < 371.0), 60.0, sky)
    rng = np.random.default_rng(0)
    row, column, radius = find_circle((sky * (1 + 0.05 * rng.standard_normal(sky.shape))).astype(np.float32))
    # half a pixel of the search along the rays; trees pull it in where they stand
    tolerance = 3.0 if trees else 0.7
    assert (row, column, radius) == pytest.approx((412.3, 505.7, 371.0), abs=tolerance)


def test_no_circle_is_said() -> None:
    for picture in (np.zeros((100, 100)), np.full((100, 100), 50.0)):
        with pytest.raises(ValueError, match="circle"):
            find_circle(picture.astype(np.float32))
