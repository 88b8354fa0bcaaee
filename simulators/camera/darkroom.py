"""From the world to a picture: what the lens lets through at the middle of an exposure, and the files made of it."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from labdaq import directions
from simulators.camera.files import ExposureData, developed, dng, jpeg, plain_tiff, thumbnail
from simulators.camera.lens import FisheyeLens, View, along, view
from simulators.camera.sensor import Sensor, Words, saturation_luminance
from simulators.camera.shading import ShadingDisc
from simulators.world.observed import SunSeen, World

Floats = NDArray[np.float64]

SUN_HALF_ANGLE_DEG: Final = 0.2665
ZENITH: Final = np.array([0.0, 0.0, 1.0])


class ColourResponse(Protocol):
    """How the three kinds of pixels respond to light of a colour; the hook for spectral mismatch."""

    def __call__(self, towards: Floats, luminance: Floats, sun: SunSeen) -> Floats:
        """Response over luminance of red, green and blue pixels (3, n) to the sky in directions (n, 3)."""
        ...


@dataclass(frozen=True, slots=True)
class Optics:
    """Everything in front of and on the sensor.

    Attributes
    ----------
    lens, disc, sensor
        Its parts; without a ``disc`` (``None``) the sun shines into the lens.
    sensitivity
        True response over the nominal one.
    colour
        Response by colour; ``None``: all pixels respond to luminance alike.
    """

    lens: FisheyeLens = field(default_factory=FisheyeLens)
    disc: ShadingDisc | None = field(default_factory=ShadingDisc)
    sensor: Sensor = field(default_factory=Sensor)
    sensitivity: float = 1.0
    colour: ColourResponse | None = None


@dataclass(frozen=True, slots=True)
class Shot:
    """One exposure, decided when the shutter opens.

    Attributes
    ----------
    number
        Counts from 1; with the seed it fixes the noise.
    middle_utc_ns
        Middle of the exposure.
    seconds
        True time the shutter is open [s].
    width, height
        Picture size.
    formats
        Files to make of it, in order: ``jpeg:<quality>``, ``tiff``, ``dng``.
    data
        What is written into the files.
    """

    number: int
    middle_utc_ns: int
    seconds: float
    width: int
    height: int
    formats: tuple[str, ...]
    data: ExposureData


@dataclass(frozen=True, slots=True)
class PictureFile:
    """One file made of a shot."""

    format: str
    data: bytes
    thumbnail: bytes
    width: int
    height: int


@lru_cache(maxsize=4)
def _view(lens: FisheyeLens, width: int, height: int) -> View:
    return view(lens, width, height)


def luminance_picture(world: World, utc_ns: int, optics: Optics, width: int, height: int) -> Floats:
    """Luminance each pixel receives [cd/m²], shape (H, W), or (3, H, W) with a colour response.

    Sky, sun and disc through the vignetting, plus the veil; what lies outside the circle receives the veil only.
    """
    seen = _view(optics.lens, width, height)
    sun = world.sun(utc_ns)
    luminance = world.sky_luminance(seen.towards, utc_ns)
    if sun.altitude_deg > 0:
        pixels, glare = _sun_in_pixels(seen, sun)
        luminance = np.array(luminance)
        luminance[pixels] += glare
        if optics.disc is not None:
            dark = optics.disc.reflectance / np.pi
            dark *= world.roof_illuminance(ZENITH, utc_ns, max(optics.disc.half_angle_deg, SUN_HALF_ANGLE_DEG))
            luminance[optics.disc.hides(seen.towards, sun)] = dark
    through = luminance * seen.transmission
    if optics.colour is not None:
        through = through * optics.colour(seen.towards, luminance, sun)
    picture = np.zeros((*through.shape[:-1], *seen.inside.shape))
    picture[..., seen.inside] = through
    return picture + optics.lens.veil * float(np.mean(through))


def _sun_in_pixels(seen: View, sun: SunSeen) -> tuple[NDArray[np.intp], Floats]:
    """Which pixels see the sun's disc, and the mean luminance it gives each: its light spread over them by area."""
    towards_sun = directions.sky_vector(sun.altitude_deg, sun.azimuth_deg)
    reach = SUN_HALF_ANGLE_DEG + seen.pixel_deg
    near = np.flatnonzero(along(seen.towards, towards_sun) > np.cos(np.radians(reach)))
    angle = directions.angle_between(seen.towards[near], towards_sun)
    weight = np.clip((reach - angle) / seen.pixel_deg, 0.0, 1.0)
    covered = float(np.sum(weight * seen.solid_angle[near]))
    spread: Floats = sun.normal_illuminance_lx * weight / covered if covered else weight
    return near, spread


def metered_seconds(world: World, utc_ns: int, optics: Optics, f_number: float, iso: float) -> float:
    """Shutter time of automatic exposure [s]: the mean of the picture circle comes to 18 % of saturation."""
    picture = luminance_picture(world, utc_ns, optics, 64, 48)
    mean = float(np.mean(np.minimum(picture[..., _view(optics.lens, 64, 48).inside], 1e5)))
    return 0.18 * saturation_luminance(1.0, f_number, iso) / max(mean, 1e-3)


def develop(world: World, optics: Optics, shot: Shot, seed: int) -> tuple[PictureFile, ...]:
    """Make the files of a shot; the same shot, seed and world give the same bytes."""
    mosaic = expose(world, optics, shot, seed)
    sensor = optics.sensor
    small = thumbnail(mosaic, sensor.black, sensor.white)
    files = []
    for kind in shot.formats:
        if kind == "dng":
            data = dng(mosaic, sensor.black, sensor.white, shot.data)
        elif kind == "tiff":
            data = plain_tiff(developed(mosaic, sensor.black, sensor.white), shot.data)
        else:
            data = jpeg(developed(mosaic, sensor.black, sensor.white), int(kind.partition(":")[2]), shot.data)
        files.append(PictureFile(kind.partition(":")[0], data, small, shot.width, shot.height))
    return tuple(files)


def expose(world: World, optics: Optics, shot: Shot, seed: int) -> Words:
    """The sensor's digital numbers, an RGGB mosaic (H, W)."""
    light = luminance_picture(world, shot.middle_utc_ns, optics, shot.width, shot.height) * optics.sensitivity
    if light.ndim == 3:
        red, green, blue = light
        light = green.copy()
        light[0::2, 0::2] = red[0::2, 0::2]
        light[1::2, 1::2] = blue[1::2, 1::2]
    noise = np.random.default_rng([seed, 5400, shot.number])
    return optics.sensor.expose(light, shot.seconds, float(shot.data.f_number), float(shot.data.iso), noise)
