"""Roof meters: illuminance meters that are not level, not cosine-true, or not well calibrated.

On a case that has roof channels they act on those readings. On a case that has only the goniometer they act through the
sun's brightness, which the simulation took from the difference of the roof's global and diffuse readings.
"""

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Reported, Stage, Term, told
from analysis.explain.parameter import Parameter
from analysis.explain.scene import Light, Scene
from analysis.explain.sky_flux import RINGS_DEG
from analysis.explain.thresholds import SEEN_DEG

_ALL = -1
"""In place of a channel's index: all of them."""


def roof_channels(scene: Scene) -> tuple[Branch, ...]:
    """Each meter of the roof; or, where none was recorded, the one behind a goniometer's simulation."""
    r = scene.readings
    if not np.any(scene.is_roof):
        return (Branch("the global illuminance meter"),)
    channels = np.unique(r.channel[scene.is_roof])
    return tuple(Branch(r.case.channels[k].id, int(k)) for k in channels)


def heads(scene: Scene) -> tuple[Branch, ...]:
    """Each meter, and where there are several, all of them alike: heads of one make, on one plate."""
    ways = roof_channels(scene)
    return (*ways, Branch("every roof meter", _ALL)) if len(ways) > 1 else ways


def of_channel(scene: Scene, channel: int) -> NDArray[np.bool_]:
    """Roof rows (N,) of one meter, by its channel's index, or of all meters."""
    mine = scene.is_roof if channel == _ALL else scene.is_roof & (scene.readings.channel == channel)
    return np.asarray(mine)


def why_no_sun(scene: Scene) -> str:
    """Why the beam on each row is not known; empty when it is."""
    r = scene.readings
    if not r.has_parts:
        return "the records do not give the sun and sky parts apart"
    if np.any(np.isnan(r.sun_altitude_at_deg) | np.isnan(r.sun_azimuth_at_deg)):
        return "neither sun angles nor site and times are given"
    if not np.any(scene.is_roof) and not scene.knows_split:
        return "global and diffuse illuminance are not given for every test"
    return ""


def _beam_error(scene: Scene, beam_ratio: Floats, sky_ratio: float) -> Floats:
    """True over assumed beam when the global reading was beam*beam_ratio + diffuse*sky_ratio; per row.

    The simulation took B = G - D; the true beam B0 obeys B0 * beam_ratio + D * sky_ratio = G.
    """
    beam, diffuse = scene.beam_lx[scene.readings.test], scene.readings.diffuse_lx[scene.readings.test]
    true = (beam + diffuse * (1.0 - sky_ratio)) / np.maximum(beam_ratio, 0.2)
    return np.where(beam > 0.02 * diffuse, np.maximum(true, 0.0) / np.maximum(beam, 1e-9), 1.0)


class MeterTilt(Mechanism):
    """The meter is not level, so that the beam falls on it under another angle."""

    id = "meter-tilt"
    stage = Stage.ROOF_METERS
    leaves_out = "An illuminance meter is not level."
    parameters = (
        Parameter(
            "tilt_north_deg", "deg", "tilt of the meter's normal towards north", -12.0, 12.0, 3.0, (-3.0, 0.0, 3.0)
        ),
        Parameter(
            "tilt_east_deg", "deg", "tilt of the meter's normal towards east", -12.0, 12.0, 3.0, (-3.0, 0.0, 3.0)
        ),
    )
    needs = "sun and sky parts apart; sun angles, or site and times"
    source = (
        "beam: cos(theta_tilt)/cos z; sky: (1 + cos tilt)/2 + sin(tilt) cos(azimuth from the sun) times the sunward "
        "flow of Perez' sky; Wang et al. 2016, Atmos. Meas. Tech. 9; Perez et al. 1993, Solar Energy 50; report App. C"
    )
    tie_breaker = "turn the meter's head by 180°"
    kinds = ("goniometer", "roof")

    def why_not(self, scene: Scene) -> str:
        """The tilt shows against the sun's direction."""
        return why_no_sun(scene)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter, and all together."""
        return heads(scene)

    def absurd(self, p: Floats, branch: Branch) -> bool:
        """Whether anybody would see that it is not level."""
        return float(np.linalg.norm(p)) > SEEN_DEG

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Change the beam's projection on the tilted meter."""
        north, east = np.radians(p[0]), np.radians(p[1])
        tilt = float(np.hypot(north, east))
        zenith = np.minimum(scene.sun_zenith_at, np.radians(88.0))
        azimuth = np.radians(scene.readings.sun_azimuth_at_deg)
        towards = (north * np.cos(azimuth) + east * np.sin(azimuth)) / tilt if tilt > 0 else 0.0 * azimuth
        beam = np.maximum(np.cos(tilt) + np.tan(zenith) * np.sin(tilt) * towards, 0.0)
        even = (1.0 + np.cos(tilt)) / 2.0
        if branch.value is None:
            light.sun_factor = light.sun_factor * _beam_error(scene, beam, even)
            return
        sky = np.maximum(even + np.sin(tilt) * towards * scene.sky_flux.sunward, 0.0)
        acts = of_channel(scene, branch.value)
        light.sun_factor = np.where(acts, light.sun_factor * beam, light.sun_factor)
        light.sky_factor = np.where(acts, light.sky_factor * sky, light.sky_factor)

    def report(self, p: Floats, sd: Floats, term: Term) -> Reported:
        """Components, and the tilt with its direction."""
        tilt = float(np.hypot(p[0], p[1]))
        along = float(np.hypot(p[0] * sd[0], p[1] * sd[1]) / max(tilt, 1e-6))
        across = float(np.hypot(p[1] * sd[0], p[0] * sd[1]) / max(tilt, 1e-6) ** 2)
        return {
            **super().report(p, sd, term),
            "tilt_deg": told(tilt, along, "deg"),
            "azimuth_deg": told(
                float(np.degrees(np.arctan2(p[1], p[0])) % 360.0), min(np.degrees(across), 180.0), "deg"
            ),
        }

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how far and which way."""
        tilt, towards = np.hypot(p[0], p[1]), np.degrees(np.arctan2(p[1], p[0])) % 360
        return f"{branch.label} is tilted by {tilt:.1f}° towards azimuth {towards:.0f}°: it is not level."


class MeterGain(Mechanism):
    """The meter's calibration factor is wrong."""

    id = "meter-gain"
    stage = Stage.ROOF_METERS
    leaves_out = "An illuminance meter's calibration factor is wrong."
    parameters = (Parameter("error", "1", "relative error of the meter's reading", -0.6, 1.5, 0.06, (-0.04, 0.04)),)
    source = "y = E (1 + g)"
    tie_breaker = "exchange the two meters, or read both in front of one lamp"
    kinds = ("goniometer", "roof")

    def why_not(self, scene: Scene) -> str:
        """On a goniometer it acts through the split of the parts."""
        return "" if scene.kinds != ("goniometer",) or scene.knows_split else why_no_sun(scene)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each illuminance meter."""
        return roof_channels(scene)

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Behind a goniometer's simulation: the beam was taken from a wrong global reading."""
        if branch.value is None:
            factor = 1.0 + p[0]
            light.sun_factor = light.sun_factor * _beam_error(scene, np.full(len(scene.readings), factor), factor)

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """Scale the meter's own rows."""
        if branch.value is None:
            return values
        return np.where(scene.readings.channel == branch.value, values * (1.0 + p[0]), values)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return f"{branch.label} reads {p[0]:+.1%}: its calibration factor is wrong."


class MeterCosine(Mechanism):
    """The meter's cosine response is wrong for a low sun."""

    id = "meter-cosine"
    stage = Stage.ROOF_METERS
    leaves_out = "An illuminance meter's cosine response is wrong."
    parameters = (
        Parameter(
            "error_at_60deg", "1", "relative error for light from 60° off the normal", -0.5, 0.5, 0.04, (-0.03, 0.03)
        ),
        Parameter("steepness", "1", "power of the growth beyond", 0.4, 6.0, 1.2, (0.8, 2.5), centre=1.3),
    )
    needs = "sun and sky parts apart; sun angles, or site and times"
    source = (
        "beam (1 + c h(z)), h = ((1 - cos z)/(1 - cos 60°))^k; sky (1 + c mean of h over Perez' sky); CIE/ISO 19476 f2"
    )
    tie_breaker = "a lamp turned round the meter's head"
    kinds = ("goniometer", "roof")

    def why_not(self, scene: Scene) -> str:
        """The error depends on the sun's angle."""
        return why_no_sun(scene)

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """Each meter, with a diffuser that is wrong or a rim that shades it."""
        ways = heads(scene)
        return (*ways, *(Branch(f"{way.label}, rim", ("rim", way.value)) for way in ways))

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """Weight beam and sky by the response."""
        rim = isinstance(branch.value, tuple)
        channel = branch.value[1] if rim else branch.value
        beam = np.maximum(1.0 + p[0] * _off_normal(scene.sun_zenith_at, rim) ** p[1], 0.05)
        rings = _off_normal(np.radians(RINGS_DEG), rim) ** p[1]
        if channel is None:
            even = np.sin(2.0 * np.radians(RINGS_DEG))
            sky = max(1.0 + p[0] * float(even @ rings / even.sum()), 0.05)
            light.sun_factor = light.sun_factor * _beam_error(scene, beam, sky)
            return
        skies = np.maximum(1.0 + p[0] * (scene.sky_flux.rings @ rings), 0.05)
        acts = of_channel(scene, channel)
        light.sun_factor = np.where(acts, light.sun_factor * beam, light.sun_factor)
        light.sky_factor = np.where(acts, light.sky_factor * skies, light.sky_factor)

    def statement(self, p: Floats, branch: Branch) -> str:
        """Say how much."""
        return f"{branch.label} reads light from 60° off its normal {p[0]:+.1%}: its cosine response is wrong."


def _off_normal(zenith_rad: Floats, rim: bool) -> Floats:
    """How far off the normal light comes, 1 at 60°: as a diffuser's response falls, or as a rim's shadow grows."""
    if rim:
        return np.asarray(np.tan(np.minimum(zenith_rad, np.radians(85.0))) / np.sqrt(3.0))
    return np.asarray(2.0 * (1.0 - np.cos(np.minimum(zenith_rad, np.radians(88.0)))))
