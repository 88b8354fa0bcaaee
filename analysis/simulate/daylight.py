"""The daylight of one test: a sun and a sky, by illuminances, by a model, or by a measured map."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.source import Luminance, Source, horizontal_illuminance, skies, suns
from labdaq.errors import DataError

Floats = NDArray[np.float64]

_IES: Final = ("ies-clear", "ies-partly-cloudy", "ies-overcast")

MODELS: Final = ("perez", "clear", "partly-cloudy", "overcast", "uniform", "cie:1 .. cie:15", *_IES)
"""Names that `daylight` takes for a sky; clear and partly-cloudy mean Perez' sky for the illuminances given, those of
the IES are the ones of its RP-21."""


@dataclass(frozen=True)
class Daylight:
    """What shone on the roof.

    Attributes
    ----------
    name
        Of the test.
    sun_altitude_deg, sun_azimuth_deg
        Apparent position [deg]; azimuth from north through east.
    beam_lx
        Illuminance of the sun's beam on the horizontal [lx]; 0 for a hidden sun.
    sky
        Luminance [cd/m²] towards unit vectors (..., 3), without the sun's disc.
    """

    name: str
    sun_altitude_deg: float
    sun_azimuth_deg: float
    beam_lx: float
    sky: Luminance

    @property
    def normal_lx(self) -> float:
        """Illuminance of the beam on a plane that faces the sun [lx]."""
        return self.beam_lx / math.sin(math.radians(self.sun_altitude_deg)) if self.beam_lx > 0.0 else 0.0

    @property
    def diffuse_lx(self) -> float:
        """Horizontal illuminance of the sky [lx], integrated as the tracer does."""
        return horizontal_illuminance(self.sky)


def daylight(
    sun_altitude_deg: float,
    sun_azimuth_deg: float,
    global_lx: float,
    diffuse_lx: float,
    sky: str | Luminance = "perez",
    name: str = "",
) -> Daylight:
    """Daylight of known illuminances: the beam is global minus diffuse, the sky is scaled to the diffuse illuminance.

    ``sky`` is one of `MODELS` or a luminance function. Raises `DataError` for illuminances or a sun that cannot be.
    """
    for what, value in (("global", global_lx), ("diffuse", diffuse_lx)):
        if not (math.isfinite(value) and value >= 0.0):
            raise DataError(f"{name or 'daylight'}: the {what} illuminance is {value}, not a number from 0 lx up")
    beam = global_lx - diffuse_lx
    if beam < -0.02 * diffuse_lx:
        raise DataError(
            f"{name or 'daylight'}: the diffuse illuminance {diffuse_lx:g} lx exceeds the global {global_lx:g} lx",
            "check which meter was shaded",
        )
    beam = max(beam, 0.0)
    if beam > 0.0 and sun_altitude_deg <= 0.0:
        raise DataError(f"{name or 'daylight'}: a beam of {beam:g} lx from a sun at {sun_altitude_deg:g} degrees")
    shape = sky_model(sky, sun_altitude_deg, sun_azimuth_deg, beam, diffuse_lx) if isinstance(sky, str) else sky
    return Daylight(name, sun_altitude_deg, sun_azimuth_deg, beam, scaled_to(shape, diffuse_lx))


def sky_model(
    sky: str, sun_altitude_deg: float, sun_azimuth_deg: float, beam_lx: float, diffuse_lx: float
) -> Luminance:
    """Luminance of a named sky; see `MODELS`. Raises `DataError` for another name."""
    if sky == "uniform":
        return lambda v: np.where(v[..., 2] >= 0.0, 1.0, 0.0)
    if sky == "overcast":
        # CIE standard overcast sky: L / Lz = (1 + 2 sin of altitude) / 3 (Moon & Spencer 1942)
        return lambda v: np.where(v[..., 2] >= 0.0, 1.0 + 2.0 * v[..., 2], 0.0)
    if sky in ("perez", "clear", "partly-cloudy"):
        from analysis.sky.perez import PerezSky

        altitude = max(sun_altitude_deg, 1.0)
        normal = beam_lx / math.sin(math.radians(altitude))
        return PerezSky.from_illuminances(normal, max(diffuse_lx, 1.0), altitude, sun_azimuth_deg).luminance
    standard = sky.startswith("cie:") and sky[4:].isdigit() and 1 <= int(sky[4:]) <= 15
    if standard or sky in _IES:
        from analysis.sky.standard import StandardSky

        kind = int(sky[4:]) if standard else sky
        return StandardSky.of_diffuse(kind, max(diffuse_lx, 1.0), sun_altitude_deg, sun_azimuth_deg).luminance
    raise DataError(f"there is no sky {sky!r}", f"use {', '.join(MODELS)}, or a map's file")


def follows_sun(sky: str) -> bool:
    """Whether a named sky is brighter about the sun, wherever that is; an unknown name counts as one that is.

    Independent of it are the uniform sky, the overcast ones, and the CIE types whose indicatrix is 1 (group 1 of ISO
    15469:2004: types 1, 3 and 5).
    """
    if sky in ("uniform", "overcast", "ies-overcast"):
        return False
    from analysis.sky.standard import CIE_TYPES

    kind = int(sky[4:]) if sky.startswith("cie:") and sky[4:].isdigit() else 0
    if kind not in CIE_TYPES:
        return True
    _, _, c, _, e = CIE_TYPES[kind]
    return c != 0.0 or e != 0.0


def sky_map(path: Path) -> Luminance:
    """Luminance of a measured sky from a Radiance picture or a map file (see `analysis.sky.map`)."""
    from analysis.sky.map import SkyMap

    found = SkyMap.load(path) if path.suffix == ".npz" else SkyMap.from_picture(path)
    return found.at


def scaled_to(sky: Luminance, diffuse_lx: float) -> Luminance:
    """The sky times a factor, so that it throws ``diffuse_lx`` on the horizontal; `DataError` if it is black."""
    total = horizontal_illuminance(sky)
    if not total > 0.0:
        if diffuse_lx == 0.0:
            return sky
        raise DataError("the sky is black or undefined, but the diffuse illuminance is not 0")
    factor = diffuse_lx / total
    return lambda v: factor * np.asarray(sky(v), dtype=np.float64)


def sun_source(tests: list[Daylight], aureole_deg: float = 0.0) -> Source | None:
    """The suns of several tests, one member each; None when no test has a beam.

    A hidden sun stays a member, with no light, at 45 degrees where it is below the horizon.
    """
    if not any(test.beam_lx > 0.0 for test in tests):
        return None
    altitude = [test.sun_altitude_deg if test.sun_altitude_deg > 0.0 else 45.0 for test in tests]
    return suns(
        altitude, [test.sun_azimuth_deg for test in tests], [t.normal_lx for t in tests], aureole_deg=aureole_deg
    )


def sky_source(tests: list[Daylight]) -> Source:
    """The skies of several tests, one member each."""
    return skies([test.sky for test in tests])
