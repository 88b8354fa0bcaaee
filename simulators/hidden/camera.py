"""A fisheye camera that measures luminance from bracketed exposures: what its chain makes of the sky.

Direction to place on the sensor, fall-off, light scattered in the lens, filters that are not V(lambda), a shutter
that is not what it says, a response that is not a straight line, and the merge that trusts them all.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdaq.directions import sky_vector
from simulators.hidden.symmetry import SkyNodes

Floats = NDArray[np.float64]

EXPOSURES_S = tuple(2.0**-k for k in range(16))
"""Nominal exposures of a bracket [s]: 1, 1/2, ... 1/32768, behind a neutral filter."""
MARKED_S = (
    1.0, 0.5, 0.25, 1 / 8, 1 / 15, 1 / 30, 1 / 60, 1 / 125, 1 / 250, 1 / 500, 1 / 1000, 1 / 2000, 1 / 4000, 1 / 8000,
    1 / 16000, 1 / 32000,
)  # fmt: skip
"""What is engraved for the same."""

POINT_CDM2 = 5000.0
"""Luminance at which a luminance meter fixed the camera's scale [cd/m²]."""


@dataclass(frozen=True)
class CameraFaults:
    """How a camera differs from the one its calibration believes in.

    Attributes
    ----------
    falloff, falloff_power
        Loss of light at 90 degrees off the axis, and its course: 1 - falloff (θ / 90°)^power; power 0 stands for
        cos^n θ of the half angle with the same loss.
    glare, glare_power
        Share of the light that the lens scatters, and how its spread falls with the angle: (1 + ψ / 2°)^-power; 0
        is even over the hemisphere.
    sees_sun
        Whether the sun's disc shines on the lens (no shading disc).
    tint
        Relative excess of the reading for the bluest sky over that for a white one.
    shutter, shutter_form, shutter_seed
        Error of the exposures: ``marked`` (the engraved times are believed, this share of the way), ``wander``
        (each by a random relative error of this rms), ``lazy`` (each longer by this times 1/8000 s over its own).
    projection, shift
        Share of the way from equidistant to equisolid-angle; and displacement of the centre [deg], towards azimuth 90.
    curve
        The response was found from the brackets themselves, which leaves an exponent open (Grossberg and Nayar 2003,
        doi:10.1109/TPAMI.2003.1240119): luminance comes out as its power 1 + curve, right at `POINT_CDM2`.
    clock_s
        The camera's clock shows this much less than the true time [s].
    ghost, ghost_deg
        Luminance of the sun's ghost image opposite the centre, as a share of the mean sky's per 100 klx of sun, and
        its width [deg].
    dust
        Spots: (altitude, azimuth, rms width [deg], share of light taken) each.
    tilt_of_field
        Sensitivity rises by this share from one rim to the other, towards azimuth `tilt_azimuth_deg`.
    fog
        A band of haze on the horizon, as a share of the mean sky luminance, 10 degrees high: seen by the camera alone.
    """

    falloff: float = 0.0
    falloff_power: float = 2.0
    glare: float = 0.0
    glare_power: float = 2.0
    sees_sun: bool = False
    tint: float = 0.0
    shutter: float = 0.0
    shutter_form: str = "wander"
    shutter_seed: int = 0
    projection: float = 0.0
    shift: float = 0.0
    curve: float = 0.0
    clock_s: float = 0.0
    ghost: float = 0.0
    ghost_deg: float = 8.0
    dust: tuple[tuple[float, float, float, float], ...] = ()
    tilt_of_field: float = 0.0
    tilt_azimuth_deg: float = 0.0
    fog: float = 0.0


Look = Callable[[Floats], Floats]
"""Luminance [cd/m²] towards unit vectors (..., 3)."""


@dataclass(frozen=True)
class Scene:
    """The sky before the camera at one instant.

    Attributes
    ----------
    nodes, luminance
        Directions over the sky and their luminance [cd/m²], for light scattered from elsewhere.
    look
        Luminance towards any unit vectors (..., 3) [cd/m²].
    sun, normal_lx
        Unit vector towards the sun, and its illuminance [lx].
    overcast
        0 for a blue sky, 1 for a white one.
    """

    nodes: SkyNodes
    luminance: Floats
    look: Look
    sun: Floats
    normal_lx: float
    overcast: float


def seen_direction(directions: Floats, faults: CameraFaults) -> Floats:
    """Where a pixel truly looks that is believed to look along unit vectors (..., 3).

    The picture is read as equidistant: r = f θ. The lens is r = f' [(1 - p) θ + p 2 sin(θ / 2)], with the rim
    calibrated.
    """
    theta = np.arccos(np.clip(directions[..., 2], -1.0, 1.0))
    rim = (1.0 - faults.projection) * math.pi / 2.0 + faults.projection * 2.0 * math.sin(math.pi / 4.0)
    fine = np.linspace(0.0, 1.75, 2001)
    radius = ((1.0 - faults.projection) * fine + faults.projection * 2.0 * np.sin(fine / 2.0)) / rim * math.pi / 2.0
    true = np.interp(theta, radius, fine)
    sine = np.sqrt(np.sum(directions[..., :2] ** 2, axis=-1, keepdims=True))
    across = np.divide(directions[..., :2], sine, out=np.zeros_like(directions[..., :2]), where=sine > 1e-12)
    place = across * true[..., None] + np.radians(faults.shift) * np.array([1.0, 0.0])
    angle = np.linalg.norm(place, axis=-1, keepdims=True)
    unit = np.divide(place, angle, out=np.zeros_like(place), where=angle > 1e-12)
    return np.concatenate([unit * np.sin(angle), np.cos(angle)], axis=-1)


def falloff(directions: Floats, faults: CameraFaults) -> Floats:
    """Share of light that reaches the sensor, 1 on the axis."""
    theta = np.arccos(np.clip(directions[..., 2], -1.0, 1.0)) / (math.pi / 2.0)
    if faults.falloff_power == 0.0:
        n = math.log(max(1e-3, 1.0 - faults.falloff)) / math.log(math.cos(math.pi / 4.0))
        return np.cos(np.minimum(theta, 1.1) * math.pi / 4.0) ** n
    return np.asarray(np.maximum(0.02, 1.0 - faults.falloff * theta**faults.falloff_power))


def scattered(directions: Floats, scene: Scene, faults: CameraFaults) -> Floats:
    """Luminance [cd/m²] added by light that the lens scatters from all over the picture."""
    nodes, power = scene.nodes, faults.glare_power
    grid = nodes.directions
    sources = scene.luminance * nodes.solid_angle * falloff(grid, faults)
    spread = _spread(directions @ grid.T, power)
    # what a source scatters falls somewhere in the picture: each kernel has unit sum over the hemisphere
    whole = _spread_sum(power)
    value = spread @ sources / whole
    if faults.sees_sun:
        value = value + scene.normal_lx * 0.2 * _spread(directions @ scene.sun, power) / whole
    return np.asarray(faults.glare * value)


def _spread(cosine: Floats, power: float) -> Floats:
    return (1.0 + np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) / 2.0) ** -power


def _spread_sum(power: float) -> float:
    angle = np.radians(np.linspace(0.0, 90.0, 1801))
    kernel = (1.0 + np.degrees(angle) / 2.0) ** -power
    return float(2.0 * math.pi * np.trapezoid(kernel * np.sin(angle), angle))


def tinted(directions: Floats, scene: Scene, tint: float) -> Floats:
    """Ratio of what the camera's filters see to what V(lambda) sees, 1 for a white sky, from spectra.

    The sky's spectrum is sunlight times wavelength^-a, with a from 0 (cloud, about the sun, horizon) to 4 (deep
    blue, 90° from the sun). V is Wyman, Sloan and Shirley's fit (2013, JCGT 2(2)); the camera's luminance leans to
    the blue in proportion to ``tint``.
    """
    wave = np.linspace(400.0, 700.0, 61)
    v = 1.056 * _bump(wave, 599.8, 37.9, 31.0) + 0.362 * _bump(wave, 442.0, 16.0, 26.7)  # x, for contrast
    y = 0.821 * _bump(wave, 568.8, 46.9, 40.5) + 0.286 * _bump(wave, 530.9, 16.3, 31.1)
    blue = _bump(wave, 460.0, 25.0, 30.0)
    sunlight = wave**-5.0 / np.expm1(14_387_768.8 / (wave * 5800.0))
    sunlight = sunlight / sunlight.max()
    strength = np.linspace(0.0, 4.0, 21)
    skies = sunlight[None] * (wave[None] / 550.0) ** -strength[:, None]
    filters = y + _lean(tint, y, blue, v) * (blue - 0.4 * v)
    response = (skies @ filters) / (skies @ y)
    response /= response[0]
    return np.asarray(np.interp(blueness(directions, scene), strength, response))


def _lean(tint: float, y: Floats, blue: Floats, red: Floats) -> float:
    """How far the filters lean so that the bluest sky reads ``tint`` too high."""
    wave = np.linspace(400.0, 700.0, 61)
    sunlight = wave**-5.0 / np.expm1(14_387_768.8 / (wave * 5800.0))
    sky = sunlight * (wave / 550.0) ** -4.0
    extra = blue - 0.4 * red
    a, b = sky @ extra / (sky @ y), sunlight @ extra / (sunlight @ y)
    # (1 + k a) / (1 + k b) = 1 + tint
    return float(tint / (a - (1.0 + tint) * b))


def _bump(wave: Floats, middle: float, left: float, right: float) -> Floats:
    width = np.where(wave < middle, left, right)
    return np.exp(-0.5 * ((wave - middle) / width) ** 2)


def blueness(directions: Floats, scene: Scene) -> Floats:
    """Exponent of the sky's spectrum: 4 for clean blue sky, 0 for cloud."""
    angle = np.degrees(np.arccos(np.clip(directions @ scene.sun, -1.0, 1.0)))
    about_sun = 1.0 - np.exp(-angle / 35.0)
    horizon = 1.0 - 0.7 * np.exp(-np.degrees(np.arcsin(np.clip(directions[..., 2], 0.0, 1.0))) / 12.0)
    return np.asarray(4.0 * (1.0 - scene.overcast) * about_sun * horizon)


def true_exposures(faults: CameraFaults) -> Floats:
    """True over believed exposure of every frame (16,), 1 for a true shutter."""
    nominal = np.array(EXPOSURES_S)
    if faults.shutter_form == "marked":
        return np.asarray((nominal / np.array(MARKED_S)) ** faults.shutter)
    if faults.shutter_form == "wander":
        return np.exp(faults.shutter * np.random.default_rng(faults.shutter_seed).normal(size=len(nominal)))
    return 1.0 + faults.shutter * (1.0 / 8000.0) / nominal * 0.1


def merged(luminance: Floats, faults: CameraFaults) -> Floats:
    """Luminance [cd/m²] that the merge of the bracket gives for true luminance at the sensor.

    A pixel holds 4095 counts; the frames that show it between 5 % and 90 % count, weighted to the middle.
    """
    full = 60_000.0  # cd/m² that fills a pixel in 1/8192 s
    exposures = np.array(EXPOSURES_S)
    counts = luminance[..., None] / full * 8192.0 * exposures * true_exposures(faults)
    counts = np.clip(counts, 0.0, 1.0)
    weight = np.where((counts > 0.05) & (counts < 0.9), np.minimum(counts, 1.0 - counts), 0.0)
    none = weight.sum(axis=-1) <= 0.0  # too bright for the shortest frame, or too dark for the longest
    last = np.where(counts[..., -1] >= 0.9, len(exposures) - 1, 0)
    weight[none] = (np.arange(len(exposures)) == last[none][..., None]).astype(float)
    values = counts / exposures / 8192.0 * full
    value = np.sum(weight * values, axis=-1) / np.sum(weight, axis=-1)
    return np.asarray(value * (np.maximum(value, 1.0) / POINT_CDM2) ** faults.curve)


def photograph(directions: Floats, scene: Scene, faults: CameraFaults) -> Floats:
    """Luminance [cd/m²] that the camera reports for believed unit vectors (n, 3), without noise."""
    where = seen_direction(directions, faults)
    value = scene.look(where) * falloff(where, faults)
    mean = float(np.sum(scene.luminance * scene.nodes.solid_angle) / (2.0 * math.pi))
    if faults.fog:
        value = value + faults.fog * mean * np.exp(-np.degrees(np.arcsin(np.clip(where[..., 2], 0.0, 1.0))) / 10.0)
    if faults.glare:
        value = (1.0 - faults.glare) * value + scattered(where, scene, faults)
    if faults.ghost:
        opposite = scene.sun * np.array([-1.0, -1.0, 1.0])
        angle = np.degrees(np.arccos(np.clip(where @ opposite, -1.0, 1.0)))
        value = value + faults.ghost * mean * scene.normal_lx / 1e5 * np.exp(-0.5 * (angle / faults.ghost_deg) ** 2)
    for altitude, azimuth, width, share in faults.dust:
        angle = np.degrees(np.arccos(np.clip(directions @ sky_vector(altitude, azimuth), -1.0, 1.0)))
        value = value * (1.0 - share * np.exp(-0.5 * (angle / width) ** 2))
    if faults.tint:
        value = value * tinted(where, scene, faults.tint)
    if faults.tilt_of_field:
        value = value * (1.0 + 0.5 * faults.tilt_of_field * (directions @ sky_vector(0.0, faults.tilt_azimuth_deg)))
    return merged(value, faults)
