"""The scene of a case: readings, predicted fields, and what mechanisms need to know of room and geometry."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Concatenate

import numpy as np
from numpy.typing import NDArray

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.fields import Fields, fields_of
from analysis.explain.file_parts import readings_of
from analysis.explain.readings import GONIOMETER, ROOF, SKY, Readings
from analysis.explain.retrace import Retraced, Simulator
from analysis.explain.sampler import Sampler
from analysis.explain.sky_flux import SkyFlux
from analysis.explain.sky_shape import SkyShape
from analysis.explain.variants import retraced_of
from labdaq import directions

_TRUST = (0.2, 5.0)  # how far a record's own prediction may differ from the field read at its direction

_MOST = 0.98
"""Share of the sum that our own simulation's sky part can have."""


@dataclass
class Light:
    """The predicted light on its way to the readings; mechanisms change it in the order of the chain.

    Attributes
    ----------
    sun_factor, sky_factor : shape (N,)
        Factors on the sun and sky part at each row.
    sun, sky, added : shape (T, P, G) [cd]
        Fields of the parts, and of light that does not come through the aperture.
    gamma_deg, c_deg : shape (N,) [deg]
        Where the sensors really were.
    """

    sun_factor: Floats
    sky_factor: Floats
    sun: Floats
    sky: Floats
    added: Floats
    gamma_deg: Floats
    c_deg: Floats
    moved: bool = False

    def factor_of_tests(self, test: NDArray[np.int64], count: int) -> tuple[Floats, Floats]:
        """Mean factors of each test; shapes (T,), (T,)."""
        n = np.maximum(np.bincount(test, minlength=count), 1)
        sun = np.bincount(test, weights=self.sun_factor, minlength=count) / n
        sky = np.bincount(test, weights=self.sky_factor, minlength=count) / n
        return sun, sky


def scene_of(case: Case, simulator: Simulator | None = None, *, measured_only: bool = True) -> "Scene":
    """The scene of ``case``; where the arm's predictions are not given in parts, ``simulator`` splits them."""
    readings = readings_of(case, measured_only=measured_only)
    retraced = retraced_of(case, simulator)
    whole = (readings.kind == GONIOMETER) & ~(np.isfinite(readings.sun) & np.isfinite(readings.sky))
    part = simulator.sky_part() if simulator is not None and np.any(whole) else None
    if part is None:
        return Scene(readings, retraced)
    there = Sampler(readings.test, np.nan_to_num(readings.gamma_deg), np.nan_to_num(readings.c_deg))(part)
    if not np.all(np.isfinite(there[whole])):  # a system that cannot be traced
        return Scene(readings, retraced)
    sky = np.where(whole, np.minimum(there, _MOST * readings.simulated), readings.sky)
    sun = np.where(whole, readings.simulated - sky, readings.sun)
    return Scene(replace(readings, sun=sun, sky=sky), retraced, part)


@dataclass(frozen=True)
class Scene:
    """Everything the forward models read; built once per explanation.

    Attributes
    ----------
    retraced
        The case's variants and our own re-simulations; ``None`` where neither can be had.
    sky_part : shape (T, P, G) [cd]
        The sky part by our own simulation, where the case gives only the sum of both.
    alone : shape (N,)
        Relative standard deviations by which readings that stand alone err by themselves (`analysis.explain.alone`).
    memory, lit, of_rows
        What was worked out already: arrays (`remember`), the light after the first of several mechanisms
        (`analysis.explain.mechanisms.base`), and arrays whose last axis is the rows' (`remember_rows`).
    """

    readings: Readings
    retraced: Retraced | None = None
    sky_part: Floats | None = None
    alone: Floats | None = None
    memory: dict[tuple[object, ...], Floats] = field(default_factory=dict)
    lit: dict[tuple[tuple[int, bytes], ...], tuple[Light, object]] = field(default_factory=dict)
    of_rows: dict[Callable[["Scene"], Floats], Floats] = field(default_factory=dict)

    def only(self, rows: NDArray[np.bool_]) -> "Scene":
        """The scene of the readings where ``rows`` holds."""
        alone = None if self.alone is None else self.alone[rows]
        known = {work: made[..., rows] for work, made in self.of_rows.items()}
        part = replace(self, readings=self.readings.only(rows), alone=alone, memory={}, lit={}, of_rows=known)
        part.__dict__["fields"] = self.fields  # those of tests without a row are never read
        return part

    def quieted(self, alone: Floats) -> "Scene":
        """The same scene where readings may err by themselves."""
        other = replace(self, alone=alone)
        other.__dict__["fields"] = self.fields
        return other

    def without_variants(self, mechanism: str) -> "Scene":
        """The scene as it would be if the case brought nothing of a mechanism."""
        if self.retraced is None:
            return self
        paths = {name: paths for name, paths in self.retraced.case_paths.items() if name != mechanism}
        other = replace(self, retraced=replace(self.retraced, case_paths=paths), lit={})
        other.__dict__["fields"] = self.fields
        return other

    def remember_rows(self, work: Callable[["Scene"], Floats]) -> Floats:
        """The array (..., N) that ``work`` makes of this scene, each row by itself: made once, of all rows."""
        if work not in self.of_rows:
            self.of_rows[work] = work(self)
        return self.of_rows[work]

    def remember(self, work: Callable[Concatenate["Scene", ...], Floats], *at: float) -> Floats:
        """The array that ``work`` makes of this scene (at these values), made once."""
        if (work, *at) not in self.memory:
            self.memory[work, *at] = work(self, *at)
        return self.memory[work, *at]

    def remember_last(self, work: Callable[Concatenate["Scene", ...], Floats], *at: float) -> Floats:
        """The same, but only the last values' array is kept.

        A search asks at hundreds of values, and often again at the last: beside it, many other mechanisms are tried.
        """
        for key in [k for k in self.memory if k[0] == work and k[1:] != at]:
            del self.memory[key]
        return self.remember(work, *at)

    @cached_property
    def fields(self) -> Fields:
        """Predicted fields of every test."""
        given = fields_of(self.readings)
        if self.sky_part is None:
            return given
        whole = ~np.any(given.sky, axis=(1, 2), keepdims=True)
        sky = np.where(whole, np.minimum(np.nan_to_num(self.sky_part), _MOST * given.sun), given.sky)
        return Fields(given.total - sky, sky)

    @cached_property
    def is_gonio(self) -> NDArray[np.bool_]:
        """Rows of the goniometer; shape (N,)."""
        return np.asarray(self.readings.kind == GONIOMETER)

    @cached_property
    def is_roof(self) -> NDArray[np.bool_]:
        """Rows of illuminance meters on the roof; shape (N,)."""
        return np.asarray(self.readings.kind == ROOF)

    @cached_property
    def is_sky(self) -> NDArray[np.bool_]:
        """Rows of luminance meters and cameras; shape (N,)."""
        return np.asarray(self.readings.kind == SKY)

    @cached_property
    def is_camera(self) -> NDArray[np.bool_]:
        """Those of them that a camera read; shape (N,)."""
        return np.array([c.kind == "camera" for c in self.readings.case.channels])[self.readings.channel]

    @cached_property
    def knows_image(self) -> bool:
        """Whether the sun part is known apart, and where the sun stood in every test."""
        r = self.readings
        return bool(r.has_parts and np.all(np.isfinite(r.altitude_deg)) and np.all(np.isfinite(r.azimuth_deg)))

    @cached_property
    def interpolated(self) -> bool:
        """Whether some test's fields are interpolated from the records, as the case brings no file for it."""
        tests = np.unique(self.readings.test[self.is_gonio])
        return any(self.readings.case.tests[k].simulated is None for k in tests)

    @cached_property
    def sun_vectors(self) -> Floats:
        """Unit vectors to the sun in each test; shape (T, 3)."""
        return directions.sky_vector(self.readings.altitude_deg, self.readings.azimuth_deg)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of channel that occur."""
        return tuple(k for k in (GONIOMETER, ROOF, SKY) if np.any(self.readings.kind == k))

    @cached_property
    def on_the_roof(self) -> bool:
        """Whether illuminance meters were read, and luminances at most beside them."""
        return ROOF in self.kinds and GONIOMETER not in self.kinds

    @property
    def distance_m(self) -> float | None:
        """From the aperture's centre to each sensor of the arm [m], if the case says it."""
        return self.readings.case.setup.distance_m

    @cached_property
    def _nominal(self) -> Sampler:
        return Sampler(self.readings.test, *self._where)

    @cached_property
    def _where(self) -> tuple[Floats, Floats]:
        """Gamma and C of each row [deg], zero where it has none; shapes (N,), (N,)."""
        return np.nan_to_num(self.readings.gamma_deg), np.nan_to_num(self.readings.c_deg)

    @cached_property
    def _in_parts(self) -> NDArray[np.bool_]:
        return np.isfinite(self.readings.sun)

    @cached_property
    def _nominal_parts(self) -> tuple[Floats, Floats]:
        return self._nominal(self.fields.sun), self._nominal(self.fields.sky)

    @cached_property
    def _trust(self) -> Floats:
        """By which factor each record's own prediction is more than the fields at its direction; shape (N,)."""
        base = np.add(*self._nominal_parts)
        return np.clip(np.divide(self.readings.simulated, base, out=np.ones(len(base)), where=base > 0), *_TRUST)

    def dark_light(self) -> Light:
        """The light as the case predicts it, before any mechanism."""
        one, f = np.ones(len(self.readings)), self.fields
        return Light(one, one.copy(), f.sun, f.sky, np.zeros((1, 1, 1)), *self._where)

    def read(self, light: Light) -> Floats:
        """What perfect sensors would read [cd, lx, cd/m²]; shape (N,).

        On goniometer rows the change of the field is added to the record's own prediction, rescaled by the
        ratio of the two where the file and the field disagree a little (rounding, interpolation).
        """
        r = self.readings
        parts = light.sun_factor * r.sun + light.sky_factor * r.sky
        values = np.where(self._in_parts, parts, r.simulated * light.sun_factor)
        if GONIOMETER not in self.kinds:
            return values
        nominal_sun, nominal_sky = self._nominal_parts
        sampler = Sampler(r.test, light.gamma_deg, light.c_deg) if light.moved else self._nominal
        still = not light.moved
        sun = nominal_sun if still and light.sun is self.fields.sun else sampler(light.sun)
        sky = nominal_sky if still and light.sky is self.fields.sky else sampler(light.sky)
        change = (light.sun_factor * sun + light.sky_factor * sky - (nominal_sun + nominal_sky)) * self._trust
        if light.added.size > 1:
            change = change + sampler(light.added)
        return np.where(self.is_gonio, r.simulated + change, values)

    # facts per row

    @cached_property
    def beam_lx(self) -> Floats:
        """Horizontal beam illuminance of each test [lx], global minus diffuse; NaN where unknown; shape (T,)."""
        return np.maximum(self.readings.global_lx - self.readings.diffuse_lx, 0.0)

    @cached_property
    def knows_split(self) -> bool:
        """Whether global and diffuse illuminance are known for every test, and the parts for every row."""
        return self.readings.has_parts and bool(np.all(np.isfinite(self.beam_lx)))

    @cached_property
    def sun_zenith_at(self) -> Floats:
        """Sun zenith angle at each row [rad]; shape (N,)."""
        return np.radians(90.0 - self.readings.sun_altitude_at_deg)

    @cached_property
    def sky_shape(self) -> SkyShape:
        """The smooth skies of the tests, between the directions that were read."""
        return SkyShape.of(self.readings)

    @cached_property
    def sky_flux(self) -> SkyFlux:
        """Where the diffuse light on each roof meter comes from."""
        return SkyFlux.of(self.readings)
