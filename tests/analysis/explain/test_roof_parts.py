"""Sun and sky part of a roof meter's sums through a day."""

import numpy as np
import pandas as pd
import pytest

from analysis.cases.model import Floats
from analysis.explain.roof_parts import sun_part
from analysis.sky.sun import Site, sun_position
from tests.analysis.explain.roof import beam_and_sky
from tests.analysis.recordings import recording

ALTITUDE = np.concatenate([np.linspace(6.0, 62.0, 57), np.linspace(61.0, 6.0, 56)])
BEAM, SKY = beam_and_sky(ALTITUDE)
NOON = 56
TUCSON = Site(32.2297, -110.9553, 786.0)


def split(predicted: Floats, altitude: Floats = ALTITUDE, at_deg: float = 62.0) -> Floats:
    """The sun part through one day in August whose illuminances are those of noon."""
    n = len(predicted)
    facts = tuple(np.full(n, x) for x in ((BEAM + SKY)[NOON], SKY[NOON], at_deg))
    return sun_part(predicted, np.zeros(n, dtype=np.int64), altitude, np.full(n, 234), facts)


def test_at_the_tests_moment_the_split_is_the_tests() -> None:
    assert split(BEAM + SKY)[NOON] == pytest.approx(BEAM[NOON], rel=0.02)


def test_through_a_recorded_clear_day_the_sun_is_nearer_than_with_one_share_for_all() -> None:
    table = pd.read_csv(recording("radiometers/midc_raw_20181018.txt"))
    day = (table["DOY"].astype(str).str.zfill(3), table["MST"].astype(int).astype(str).str.zfill(4))
    moments = pd.to_datetime(table["Year"].astype(str) + day[0] + day[1], format="%Y%j%H%M") + pd.Timedelta(hours=7)
    height = sun_position(moments.astype("datetime64[ns]").astype(np.int64).to_numpy(), TUCSON).altitude_deg
    up = height > 5.0
    total, sky = (
        110.0 * table[name].to_numpy()[up] for name in ("Global Horiz (platform) [W/m^2]", "Diffuse Horiz [W/m^2]")
    )
    noon = int(np.argmax(height[up]))
    facts = tuple(np.full(len(total), x) for x in (total[noon], sky[noon], float(height.max())))
    sun = sun_part(total, np.zeros(len(total), dtype=np.int64), height[up], np.full(len(total), 291), facts)
    off, off_even = (
        np.sqrt(np.mean((1.0 - x / total - sky / total) ** 2)) for x in (sun, total * (1.0 - sky[noon] / total[noon]))
    )
    assert off < 0.045
    assert off < 0.45 * off_even


def test_under_cloud_the_sky_has_more_and_no_part_more_than_all() -> None:
    clouded = (BEAM + SKY) * np.where(np.arange(len(BEAM)) % 7 < 3, 0.3, 1.0)
    clouded[NOON - 3 : NOON + 4] = (BEAM + SKY)[NOON - 3 : NOON + 4]
    sun = split(clouded)
    assert np.all((sun >= 0.0) & (sun <= clouded))
    hidden = np.flatnonzero(clouded < 0.5 * (BEAM + SKY))
    assert np.all(sun[hidden] / clouded[hidden] < 0.5 * (split(BEAM + SKY) / (BEAM + SKY))[hidden])


def test_a_shaded_meter_sees_no_sun_all_day() -> None:
    assert np.all(split(SKY) == 0.0)


def test_where_the_suns_height_is_not_known_the_share_is_even() -> None:
    sun = split(BEAM + SKY, np.full(len(BEAM), np.nan), np.nan)
    assert np.ptp(sun / (BEAM + SKY)) < 1e-12


def test_without_illuminances_nothing_is_known() -> None:
    n = len(BEAM)
    facts = tuple(np.full(n, np.nan) for _ in range(3))
    assert np.all(np.isnan(sun_part(BEAM, np.zeros(n, dtype=np.int64), ALTITUDE, np.full(n, 234), facts)))
