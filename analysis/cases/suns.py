"""The sun of tests that give a place and a time, but no angles."""

from dataclasses import replace
from typing import Final

import numpy as np

from analysis.cases.model import Case, Test
from labdaq.clock import utc_ns_of

_DECIMALS: Final = 4
"""Beyond these a sun's angle is not known: refraction differs from day to day."""


def with_suns(case: Case) -> Case:
    """The case with the sun's angles in the middle of each test where it leaves them out and they can be computed.

    By NREL's algorithm (`analysis.sky.sun`); a test without start and end has the middle of its records' times.
    """
    if case.setup.site is None or all(_has_its_sun(test) for test in case.tests):
        return case
    tests = tuple(test if _has_its_sun(test) else _lit(case, k) for k, test in enumerate(case.tests))
    return replace(case, setup=case.setup.model_copy(update={"test": tests}))


def _has_its_sun(test: Test) -> bool:
    return test.sun_altitude_deg is not None and test.sun_azimuth_deg is not None


def _lit(case: Case, k: int) -> Test:
    from analysis.sky.sun import Site, sun_position

    test, place = case.tests[k], case.setup.site
    middle_ns = _middle_ns(case, k)
    if middle_ns is None or place is None:
        return test
    seen = sun_position(middle_ns, Site(place.latitude_deg, place.longitude_deg, place.elevation_m))
    altitude, azimuth = (round(float(np.squeeze(a)), _DECIMALS) for a in (seen.altitude_deg, seen.azimuth_deg))
    return test.model_copy(update={"sun_altitude_deg": altitude, "sun_azimuth_deg": azimuth})


def _middle_ns(case: Case, k: int) -> int | None:
    test, r = case.tests[k], case.records
    if test.start is not None and test.end is not None and test.middle is not None:
        return utc_ns_of(test.middle)
    times = r.utc_ns[(r.test == k) & (r.utc_ns >= 0)]
    if len(times):
        return int((times.min() + times.max()) // 2)
    return utc_ns_of(test.middle) if test.middle is not None else None
