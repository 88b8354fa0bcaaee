"""The readings that an explanation uses: usable rows of a case, in the laboratory's units."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case
from analysis.cases.model import Floats, Ints
from analysis.cases.units import IN_LAB_UNITS
from analysis.explain.roof_parts import sun_part
from analysis.sky.sun import Site, sun_position
from labdaq.clock import utc_ns_of

GONIOMETER, ROOF, SKY = "goniometer", "roof", "sky"
"""The three kinds of channel: the arm below, an illuminance meter on the roof, a luminance reading of the sky."""

_DAY_NS = 86_400_000_000_000

_DARK, _BRIGHT = 3.0, 30.0
"""Nothing was read where a reading is within so many standard uncertainties of zero and so many were predicted,"""
_DROPS = 0.02
"""if it happens to no more of a channel's readings than this: more are a shadow's, or a range's."""

_KIND = {"goniometer": GONIOMETER, "illuminance-meter": ROOF, "luminance-meter": SKY, "camera": SKY}


@dataclass(frozen=True)
class Readings:
    """Rows of a case as arrays of length N, and facts of its tests as arrays of length T.

    Attributes
    ----------
    row : shape (N,)
        Index into the case's records.
    test, channel : shape (N,)
        Indices into the case's tests and channels.
    utc_ns : shape (N,)
        -1 where unknown.
    gamma_deg, c_deg : shape (N,) [deg]
    measured, noise, simulated, sun, sky : shape (N,) [cd, lx or cd/m²]
        ``noise`` is the standard uncertainty of the reading's noise; the parts are NaN where unknown.
    """

    case: Case
    row: Ints
    test: Ints
    channel: Ints
    utc_ns: Ints
    gamma_deg: Floats
    c_deg: Floats
    measured: Floats
    noise: Floats
    simulated: Floats
    sun: Floats
    sky: Floats

    @classmethod
    def of(cls, case: Case, *, measured_only: bool = True) -> "Readings":
        """Take the rows of ``case`` that have a reading (or all of them, for a prediction), in lx, cd, cd/m².

        Readings that were `dropped` are none.
        """
        records = case.records
        keep = np.isfinite(records.measured) & ~dropped(case) if measured_only else np.ones(len(records), bool)
        factor = np.array([IN_LAB_UNITS[c.unit] for c in case.channels])[records.channel]
        noise = np.nan_to_num(records.uncertainty) * factor
        made = cls(
            case=case,
            row=np.flatnonzero(keep),
            test=records.test[keep],
            channel=records.channel[keep],
            utc_ns=records.utc_ns[keep],
            gamma_deg=records.gamma_deg[keep],
            c_deg=records.c_deg[keep],
            measured=(records.measured * factor)[keep],
            noise=noise[keep],
            simulated=(records.simulated * factor)[keep],
            sun=(records.sun * factor)[keep],
            sky=(records.sky * factor)[keep],
        )
        return made._with_skys_luminances()._with_parts_of_tests()

    def _with_skys_luminances(self) -> "Readings":
        """Luminances without parts that are read beside illuminances are the sky's."""
        bare = (self.kind == SKY) & np.isnan(self.sun) & np.isnan(self.sky)
        if not np.any(self.kind == ROOF) or not np.any(bare):
            return self
        return replace(self, sun=np.where(bare, 0.0, self.sun), sky=np.where(bare, self.simulated, self.sky))

    def _with_parts_of_tests(self) -> "Readings":
        """Roof rows without parts get those that their test's global and diffuse illuminance tell."""
        fill = (self.kind == ROOF) & np.isnan(self.sun)
        if not np.any(fill):
            return self
        rows = self.only(fill)
        tests = tuple(facts[rows.test] for facts in (self.global_lx, self.diffuse_lx, self.altitude_deg))
        days = (rows.utc_ns // _DAY_NS).astype("datetime64[D]")
        day_of_year = (days - days.astype("datetime64[Y]")).astype(np.int64) + 1
        series = rows.test * len(self.case.channels) + rows.channel
        sun, sky = self.sun.copy(), self.sky.copy()
        sun[fill] = sun_part(rows.simulated, series, rows.sun_altitude_at_deg, day_of_year, tests)
        sky[fill] = rows.simulated - sun[fill]
        return replace(self, sun=sun, sky=sky)

    def __len__(self) -> int:
        return len(self.row)

    def only(self, keep: NDArray[np.bool_]) -> "Readings":
        """The rows where ``keep`` holds."""
        arrays = {n: getattr(self, n)[keep] for n in self.__dataclass_fields__ if n != "case"}
        return Readings(case=self.case, **arrays)

    @cached_property
    def kind(self) -> NDArray[np.str_]:
        """Kind of each row's channel; shape (N,)."""
        return np.array([_KIND[c.kind] for c in self.case.channels])[self.channel]

    @cached_property
    def unit_factor(self) -> Floats:
        """What one unit of each row's channel is in the laboratory's unit; shape (N,)."""
        return np.array([IN_LAB_UNITS[c.unit] for c in self.case.channels])[self.channel]

    @cached_property
    def has_parts(self) -> bool:
        """Whether every row's sun and sky parts are known apart."""
        return bool(np.all(np.isfinite(self.sun) & np.isfinite(self.sky)))

    @cached_property
    def has_times(self) -> bool:
        """Whether every row has a time."""
        return bool(np.all(self.utc_ns >= 0))

    @cached_property
    def floor(self) -> Floats:
        """Level below which deviations are counted in absolute terms: twice the noise, or a thousandth of the
        test's top; of what is predicted, where nothing was measured."""
        top = np.zeros(len(self.case.tests))
        np.maximum.at(top, self.test, np.abs(np.where(np.isfinite(self.measured), self.measured, self.simulated)))
        return np.maximum(np.maximum(2.0 * self.noise, 1e-3 * top[self.test]), 1e-12)

    def stretched(self, values: Floats) -> Floats:
        """``values`` on a scale that is logarithmic well above the floor and linear below it: asinh(v / floor).

        A difference on this scale is a relative deviation. (Dividing by the reading instead would favour models
        that are too dark, dividing by the model those that are too bright.)
        """
        return np.arcsinh(values / self.floor)

    def free_of_gains(self, change: Floats) -> Floats:
        """Changes (N,) on the stretched scale without what all readings of a test have in common."""
        mean = np.bincount(self.test, weights=change) / np.maximum(np.bincount(self.test), 1)
        return np.asarray(change - mean[self.test])

    @cached_property
    def scale(self) -> Floats:
        """Change of a reading that is one on the stretched scale: sqrt(reading² + floor²); shape (N,)."""
        return np.hypot(self.measured, self.floor)

    # facts of the tests, shape (T,)

    @cached_property
    def system(self) -> Ints:
        """Index of each test's system among the distinct names the tests give; shape (T,)."""
        names = [t.system or "" for t in self.case.tests]
        distinct = list(dict.fromkeys(names))
        return np.array([distinct.index(n) for n in names], dtype=np.int64)

    @cached_property
    def altitude_deg(self) -> Floats:
        """Sun altitude in the middle of each test [deg]; NaN where unknown; shape (T,)."""
        return self._sun_angles[0]

    @cached_property
    def azimuth_deg(self) -> Floats:
        """Sun azimuth in the middle of each test [deg]; NaN where unknown; shape (T,)."""
        return self._sun_angles[1]

    @cached_property
    def _sun_angles(self) -> tuple[Floats, Floats]:
        altitude = np.array([np.nan if t.sun_altitude_deg is None else t.sun_altitude_deg for t in self.case.tests])
        azimuth = np.array([np.nan if t.sun_azimuth_deg is None else t.sun_azimuth_deg for t in self.case.tests])
        unknown = np.isnan(altitude) | np.isnan(azimuth)
        times = [t.middle for t in self.case.tests]
        site = self.case.setup.site
        for k in np.flatnonzero(unknown):
            moment = times[k]
            if site is not None and moment is not None:
                altitude[k], azimuth[k] = sun_at(self.case, np.array([utc_ns_of(moment)]))[:, 0]
        return altitude, azimuth

    @cached_property
    def global_lx(self) -> Floats:
        """Global horizontal illuminance of each test [lx]; NaN where unknown; shape (T,)."""
        return np.array(
            [np.nan if t.global_illuminance_lx is None else t.global_illuminance_lx for t in self.case.tests]
        )

    @cached_property
    def diffuse_lx(self) -> Floats:
        """Diffuse horizontal illuminance of each test [lx]; NaN where unknown; shape (T,)."""
        return np.array(
            [np.nan if t.diffuse_illuminance_lx is None else t.diffuse_illuminance_lx for t in self.case.tests]
        )

    @cached_property
    def sun_altitude_at_deg(self) -> Floats:
        """Sun altitude at each row [deg], from site and time, else the test's; shape (N,)."""
        return self._sun_at_rows[0]

    @cached_property
    def sun_azimuth_at_deg(self) -> Floats:
        """Sun azimuth at each row [deg], from site and time, else the test's; shape (N,)."""
        return self._sun_at_rows[1]

    @cached_property
    def solar_h(self) -> Floats:
        """Mean solar time of each reading [h], 0 to 24; of Greenwich where the case gives no site; (N,)."""
        site = self.case.setup.site
        return np.asarray((self.utc_ns / 3.6e12 + (site.longitude_deg / 15.0 if site is not None else 0.0)) % 24.0)

    @cached_property
    def _sun_at_rows(self) -> tuple[Floats, Floats]:
        if self.has_times and self.case.setup.site is not None:
            altitude, azimuth = sun_at(self.case, self.utc_ns)
            return altitude, azimuth
        return self.altitude_deg[self.test], self.azimuth_deg[self.test]


def sun_at(case: Case, utc_ns: Ints) -> Floats:
    """Sun altitude and azimuth [deg], shape (2, N), at the case's site."""
    place = case.setup.site
    assert place is not None
    site = Site(place.latitude_deg, place.longitude_deg, place.elevation_m)
    return _sun_at(np.asarray(utc_ns, dtype=np.int64).tobytes(), site)


@lru_cache(maxsize=256)
def _sun_at(utc_ns: bytes, site: Site) -> Floats:
    """The same, read-only; one and the same clock is asked for again and again."""
    seen = sun_position(np.frombuffer(utc_ns, dtype=np.int64), site)
    made = np.stack([seen.altitude_deg, seen.azimuth_deg])
    made.flags.writeable = False
    return made


def dropped(case: Case) -> NDArray[np.bool_]:
    """Rows (N,) where an instrument under the sky gave nothing in broad daylight, now and then.

    A camera has no valid exposure there, a logger wrote before the meter had answered. That is no law of the light.
    """
    r = case.records
    under_the_sky = np.array([_KIND[c.kind] != GONIOMETER for c in case.channels])[r.channel]
    nothing = under_the_sky & (r.measured <= _DARK * r.uncertainty) & (r.simulated > _BRIGHT * r.uncertainty)
    count = len(case.channels)
    often = np.bincount(r.channel[nothing], minlength=count) > _DROPS * np.bincount(r.channel, minlength=count)
    return np.asarray(nothing & ~often[r.channel])
