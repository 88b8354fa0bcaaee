"""One test's sky: from exposures and roof readings to a calibrated map and the sun.

The chain of the Greenwood report's chapter 5: merge, unwrap, mask the shading disc, fill with a matched Perez sky,
scale to the diffuse illuminance, take the sun from global less diffuse; then the zenith meter is compared with the
result, of which it is independent. Every decision is in the record.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.hdr.fisheye import Lens, find_circle
from analysis.hdr.merge import merge
from analysis.hdr.merged import Exposure, Merged, Recipe
from analysis.sky.calibrate import (
    METER_DISC_HALF_ANGLE_DEG,
    PEREZ_CIRCUMSOLAR,
    Reading,
    Sun,
    calibrate,
    sun_of,
)
from analysis.sky.filler import fill
from analysis.sky.map import SkyMap
from analysis.sky.mask import find_disc
from analysis.sky.perez import PerezSky
from analysis.sky.sun import Site, distance_factor, sun_position
from analysis.sky.unwrap import Unwrapped, unwrap
from analysis.sky.zenith import check_zenith
from labdaq.clock import utc_text
from labdaq.errors import DataError

Floats = NDArray[np.float64]

STEADY: Final = 0.05
"""A sky whose readings scatter by more than this share (standard deviation) changed during the test."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of one roof meter over a test; only those that may be used.

    Attributes
    ----------
    utc_ns : shape (k,) [ns]
    value : shape (k,) [lx or cd/m²]
    uncertainty : shape (k,)
        Standard uncertainties, taken as common to all readings (calibration), so that averaging does not lessen them.
    """

    utc_ns: NDArray[np.int64]
    value: Floats
    uncertainty: Floats

    @classmethod
    def of(cls, utc_ns: ArrayLike, value: ArrayLike, uncertainty: ArrayLike = 0.0) -> "Readings":
        """Make readings of anything array-like; ``uncertainty`` may be one number for all.

        Raises `DataError` when there is none, or one is not finite.
        """
        times, values = np.atleast_1d(np.asarray(utc_ns, np.int64)), np.atleast_1d(np.asarray(value, np.float64))
        sds = np.broadcast_to(np.asarray(uncertainty, np.float64), values.shape)
        if values.size == 0 or times.shape != values.shape:
            raise DataError(
                f"a roof meter has {values.size} readings at {times.size} times; it needs one of each at least"
            )
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(sds))):
            raise DataError("a roof reading is not a finite number; leave out what is missing or beyond the range")
        return cls(times, values, sds)

    @property
    def mean(self) -> Reading:
        """Mean over the test, with the meter's uncertainty and that of the mean of a varying sky."""
        spread = float(np.std(self.value, ddof=1) / np.sqrt(len(self.value))) if len(self.value) > 1 else 0.0
        return Reading(float(np.mean(self.value)), float(np.hypot(spread, np.mean(self.uncertainty))))

    @property
    def scatter(self) -> float:
        """Standard deviation over the test, over the mean."""
        return float(np.std(self.value) / abs(np.mean(self.value))) if np.mean(self.value) else 0.0


@dataclass(frozen=True, eq=False)
class SkyTest:
    """What was recorded on the roof during one test.

    Attributes
    ----------
    exposures
        The camera's bracket.
    utc_ns
        Middle of the test [ns]: the sun is placed there.
    site
    global_, diffuse
        Horizontal illuminance [lx], without and with the shading disc.
    zenith
        Luminance meter at the zenith [cd/m²]; ``None`` without one.
    lens
        The camera's; ``None`` finds the picture's circle and takes an equidistant lens that sees 180°, north up.
    """

    exposures: Sequence[Exposure]
    utc_ns: int
    site: Site
    global_: Readings
    diffuse: Readings
    zenith: Readings | None = None
    lens: Lens | None = None


@dataclass(frozen=True)
class SkyRecipe:
    """How a sky is made of a test.

    Attributes
    ----------
    pixels
        Along a side of the map.
    merge
        How the exposures are merged.
    filler
        ``membrane`` or ``single``, see `analysis.sky.filler.fill`.
    meter_half_angle_deg, circumsolar, spread
        See `analysis.sky.calibrate.calibrate`; ``circumsolar=0.10, spread="sky", filler="single"`` is the report's way.
    """

    pixels: int = 512
    merge: Recipe = field(default_factory=Recipe)
    filler: str = "membrane"
    meter_half_angle_deg: float = METER_DISC_HALF_ANGLE_DEG
    circumsolar: float | None = None
    spread: str = "cone"


@dataclass(frozen=True, eq=False)
class SkyResult:
    """A test's sky.

    Attributes
    ----------
    sky
        Calibrated and filled [cd/m²], without the sun's disc.
    seen
        Calibrated; what the disc hid is unknown.
    sun
    relative_sd : shape (n, n)
        Of each seen pixel from the merge's noise alone; the scale's is in the record.
    record
        Every decision and figure; JSON-able.
    """

    sky: SkyMap
    seen: SkyMap
    sun: Sun
    relative_sd: Floats
    record: dict[str, Any]


def process_sky(test: SkyTest, recipe: SkyRecipe | None = None) -> SkyResult:
    """Make the sky and the sun of a test.

    Raises `DataError` when exposures cannot be merged, readings cannot be used, or the sun is below the horizon.
    """
    recipe = recipe or SkyRecipe()
    picture = merge(test.exposures, recipe.merge)
    lens, lens_flags = (test.lens, []) if test.lens else (_lens_of(picture), ["lens-assumed"])
    flat = unwrap(picture, lens, recipe.pixels)
    result = calibrated_sky(test, flat, recipe)
    result.record["merge"] = picture.record
    result.record["lens"] = asdict(lens)
    result.record["flags"] = lens_flags + result.record["flags"]
    return result


def calibrated_sky(test: SkyTest, flat: Unwrapped, recipe: SkyRecipe | None = None) -> SkyResult:
    """The part of `process_sky` after the merge, for a relative sky map that is already there."""
    recipe = recipe or SkyRecipe()
    place = sun_position(test.utc_ns, test.site)
    altitude, azimuth = float(place.altitude_deg), float(place.azimuth_deg)
    distance = float(distance_factor(test.utc_ns))
    global_, diffuse = test.global_.mean, test.diffuse.mean
    if altitude <= 0.0:
        raise DataError(
            f"the sun is {-altitude:.1f}° below the horizon at {utc_text(test.utc_ns)}", "check the times and the site"
        )
    if diffuse.value <= 0.0:
        raise DataError(f"the mean diffuse illuminance is {diffuse.value:g} lx; a daylight sky gives some")
    beam = max(0.0, global_.value - diffuse.value * (1.0 + PEREZ_CIRCUMSOLAR[1])) / float(np.sin(np.radians(altitude)))
    model = PerezSky.from_illuminances(beam, diffuse.value * (1.0 + PEREZ_CIRCUMSOLAR[1]), altitude, azimuth, distance)
    disc = find_disc(flat.sky, place.vector, recipe.meter_half_angle_deg)
    filled, filling = fill(flat.sky, disc, model, recipe.filler)
    sky, scaling = calibrate(
        filled,
        place.vector,
        diffuse,
        meter_half_angle_deg=recipe.meter_half_angle_deg,
        circumsolar=recipe.circumsolar,
        spread=recipe.spread,
    )
    sun = sun_of(sky, altitude, azimuth, global_, diffuse, distance)
    hidden = disc.mask | ~flat.sky.known
    record: dict[str, Any] = {
        "utc": utc_text(test.utc_ns),
        "site": asdict(test.site),
        "pixels": recipe.pixels,
        "readings": {name: _reading_record(r) for name, r in (("global", test.global_), ("diffuse", test.diffuse))},
        "disc": disc.record(),
        "filler": filling,
        "calibration": scaling,
        "sun": asdict(sun),
        "noise_relative_sd": float(np.median(flat.relative_sd[flat.sky.known])),
        "saturated": _saturated(sky, flat, hidden),
        "zenith": None,
    }
    flags = [*disc.flags, *filling["flags"], *sun.flags]
    if test.zenith is not None:
        noise = float(flat.relative_sd[recipe.pixels // 2, recipe.pixels // 2])
        check = check_zenith(sky, test.zenith.mean, hidden, scaling["relative_sd"], noise)
        record["readings"]["zenith"] = _reading_record(test.zenith)
        record["zenith"] = check.record()
        flags += check.flags
    if record["saturated"]["share_of_diffuse"] > 0.001:
        flags.append("sky-saturated")
    if max(test.global_.scatter, test.diffuse.scatter) > STEADY:
        flags.append("sky-unsteady")
    record["flags"] = flags
    seen = SkyMap.of(sky.luminance, ~hidden, {"kind": "seen"})
    return SkyResult(sky.noted(recipe=record), seen, sun, flat.relative_sd, record)


def _lens_of(picture: Merged) -> Lens:
    """An equidistant lens that fits the picture's lit circle."""
    try:
        row, column, radius = find_circle(picture.signal)
    except ValueError as error:
        raise DataError(f"the camera's circle cannot be found in its pictures: {error}", "describe the lens") from error
    step = picture.pixel_step
    return Lens(row * step, column * step, radius * step)


def _reading_record(readings: Readings) -> dict[str, Any]:
    mean = readings.mean
    return {
        "count": len(readings.value),
        "mean": mean.value,
        "sd_of_mean": mean.uncertainty,
        "scatter": readings.scatter,
    }


def _saturated(sky: SkyMap, flat: Unwrapped, hidden: NDArray[np.bool_]) -> dict[str, Any]:
    """How much of the sky is only a lower bound."""
    where = flat.saturated & ~hidden
    total = sky.horizontal_illuminance()
    return {
        "pixels": int(np.count_nonzero(where)),
        "share_of_diffuse": sky.horizontal_illuminance(where) / total if total > 0.0 else 0.0,
    }
