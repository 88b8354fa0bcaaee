"""The sun against the positions computed for the 32 tests of 2010, and against its own laws."""

import csv
from datetime import datetime

import numpy as np
import pytest

from analysis.sky.sun import GREENWOOD, Site, distance_factor, sun_position
from labdaq.clock import NS, utc_ns_of
from tests.analysis.recordings import recording


def instant(text: str) -> int:
    return utc_ns_of(datetime.fromisoformat(text.replace("Z", "+00:00")))


def test_the_32_tests_of_greenwood() -> None:
    with recording("greenwood-tests.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    sun = sun_position([instant(row["mid_utc"]) for row in rows], GREENWOOD)
    assert len(rows) == 32
    # printed to 0.001°; the apparent ones were made for sea-level pressure, which refracts 2 % more of 0.03°
    np.testing.assert_allclose(sun.geometric_altitude_deg, [float(r["sun_alt_mid"]) for r in rows], atol=6e-4)
    np.testing.assert_allclose(sun.azimuth_deg, [float(r["sun_az_mid"]) for r in rows], atol=6e-4)
    np.testing.assert_allclose(sun.altitude_deg, [float(r["sun_alt_apparent_mid"]) for r in rows], atol=2e-3)


def test_test_18_the_reports_altitude_is_one_of_its_interval_not_its_middle() -> None:
    begin, end = instant("2010-07-22T13:12:00Z"), instant("2010-07-22T13:14:45Z")
    sun = sun_position([begin, (begin + end) // 2, end], GREENWOOD)
    # 30.889, 31.172, 31.456 from pvlib.get_solarposition (reference note); its start and end are in the table
    assert sun.geometric_altitude_deg[0] < 31.3 < sun.geometric_altitude_deg[2]
    assert abs(sun.geometric_altitude_deg[1] - 31.172) < 2e-3
    assert abs(sun.azimuth_deg[1] - 85.6) < 0.05


def test_one_instant_many_and_any_shape_agree() -> None:
    start = instant("2010-07-21T14:15:00Z")
    times = start + NS * np.arange(6).reshape(2, 3)
    many = sun_position(times, GREENWOOD)
    one = sun_position(int(times[1, 2]), GREENWOOD)
    assert many.azimuth_deg.shape == (2, 3)
    assert many.vector.shape == (2, 3, 3)
    assert one.altitude_deg.shape == ()
    assert abs(float(one.altitude_deg) - many.altitude_deg[1, 2]) < 1e-9


def test_laws_of_the_sky() -> None:
    day = instant("2024-03-20T00:00:00Z") + 600 * NS * np.arange(144)
    north, south = sun_position(day, Site(40.0, 10.0)), sun_position(day, Site(-40.0, 10.0))
    # at equinox a southern sun mirrors a northern one: same altitude, azimuth reflected about east-west
    # (the equinox is at 03:06 UTC and declination then grows by 0.4° a day, which parts the two by up to twice that)
    np.testing.assert_allclose(north.geometric_altitude_deg, south.geometric_altitude_deg, atol=0.8)
    noon = int(np.argmax(north.altitude_deg))
    assert abs(north.azimuth_deg[noon] - 180.0) < 3.0
    assert min(south.azimuth_deg[noon], 360.0 - south.azimuth_deg[noon]) < 3.0
    up = north.geometric_altitude_deg > 0.0
    assert np.all(north.altitude_deg[up] > north.geometric_altitude_deg[up])  # refraction lifts


@pytest.mark.parametrize(("date", "factor"), [("2010-01-03", 1.0343), ("2010-07-06", 0.9666), ("2010-10-05", 1.0)])
def test_distance_factor_at_perihelion_aphelion_and_between(date: str, factor: float) -> None:
    # distances 0.98329 and 1.01670 au (Astronomical Almanac); Spencer's series is good to 0.0002 or so
    assert abs(float(distance_factor(instant(f"{date}T12:00:00Z"))) - factor) < 2e-3
