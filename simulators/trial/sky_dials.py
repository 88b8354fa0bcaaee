"""Dials for the camera's cases: lens, glare, filters, shutter, projection, response."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from labdaq.directions import sky_vector
from simulators.hidden.camera import CameraFaults, falloff, seen_direction, true_exposures
from simulators.trial.dials import Parameters
from simulators.trial.sky import SkyDial, SkyStation, SkyWorld

Maker = Callable[[np.random.Generator, SkyStation], SkyDial | None]


def _camera(change: Callable[[CameraFaults, float], CameraFaults]) -> Callable[[SkyWorld, float], SkyWorld]:
    return lambda world, x: replace(world, camera=change(world.camera, x))


def _sign(rng: np.random.Generator, plus: float = 0.5) -> float:
    return 1.0 if rng.random() < plus else -1.0


def _offaxis(station: SkyStation) -> bool:
    """Whether directions at several angles from the zenith are compared."""
    return any(len(t.altitudes_deg) >= 3 and np.ptp(t.altitudes_deg) > 20.0 for t in station.campaign.tests)


def vignetting(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """The fisheye's light fall-off was not calibrated."""
    if not _offaxis(station):
        return None
    power, most = float(rng.choice([0.0, 2.0, 3.0, 4.0])), 0.7

    def fall(c: CameraFaults, x: float) -> CameraFaults:
        return replace(c, falloff=most * x, falloff_power=power)

    def report(x: float) -> Parameters:
        at = {a: 1.0 - float(falloff(sky_vector(90.0 - a, 0.0), fall(CameraFaults(), x))) for a in (45.0, 84.0)}
        return {
            "loss_at_90": (most * x, "1"),
            "loss_at_45": (at[45.0], "1"),
            "loss_at_84": (at[84.0], "1"),
            "power": (power, "1"),
        }

    return SkyDial("vignetting", "lens", _camera(fall), report, notes={"form": f"power {power:g}"})


def glare(rng: np.random.Generator, station: SkyStation) -> SkyDial:
    """The lens scatters light over the picture."""
    power = float(rng.choice([0.0, 1.0, 1.5, 2.0]))
    sun = station.campaign.sees_sun

    def veil(c: CameraFaults, x: float) -> CameraFaults:
        return replace(c, glare=0.25 * x, glare_power=power, sees_sun=sun)

    notes: dict[str, object] = {"form": f"power {power:g}", "sees_sun": sun}
    return SkyDial("veiling-glare", "glare", _camera(veil), lambda x: {"share": (0.25 * x, "1")}, notes=notes)


def tint(rng: np.random.Generator, station: SkyStation) -> SkyDial:
    """The filters see blue sky brighter, or darker, than V(lambda) does."""
    most = 0.6 * _sign(rng, 0.7)
    apply = _camera(lambda c, x: replace(c, tint=most * x))
    return SkyDial("spectral-mismatch", "sensor", apply, lambda x: {"excess_on_blue": (most * x, "1")})


def shutter(rng: np.random.Generator, station: SkyStation) -> SkyDial:
    """Exposures are not what they are believed to be."""
    form, seed = str(rng.choice(["marked", "wander", "wander", "lazy"])), int(rng.integers(1 << 30))
    most = {"marked": 1.0, "wander": 0.25, "lazy": 0.6}[form]

    def off(c: CameraFaults, x: float) -> CameraFaults:
        return replace(c, shutter=most * x, shutter_form=form, shutter_seed=seed)

    def report(x: float) -> Parameters:
        ratios = true_exposures(off(CameraFaults(), x))
        return {"rms": (float(np.std(np.log(ratios))), "1"), "mean": (float(np.mean(np.log(ratios))), "1")}

    choices = (1.0,) if form == "marked" else ()
    return SkyDial("exposure-error", "shutter", _camera(off), report, choices, notes={"form": form})


def projection(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """The lens is not equidistant, or its centre is not where it is believed."""
    if not _offaxis(station):
        return None
    if rng.random() < 0.65:
        apply = _camera(lambda c, x: replace(c, projection=x))

        def report(x: float) -> Parameters:
            seen = seen_direction(sky_vector(30.0, 0.0), CameraFaults(projection=x))
            shift = math.degrees(math.acos(seen[2])) - 60.0
            return {"equisolid_share": (x, "1"), "shift_at_60_deg": (shift, "deg")}

        return SkyDial("projection-error", "projection", apply, report, notes={"form": "equisolid"})
    most = 12.0 * _sign(rng)
    apply = _camera(lambda c, x: replace(c, shift=most * x))
    return SkyDial(
        "projection-error",
        "projection",
        apply,
        lambda x: {"centre_east_deg": (most * x, "deg")},
        notes={"form": "centre"},
    )


def clock(rng: np.random.Generator, station: SkyStation) -> SkyDial:
    """The camera's clock is off, so that its sky is another time's."""
    most = 7200.0 * _sign(rng)
    apply = _camera(lambda c, x: replace(c, clock_s=most * x))

    def report(x: float) -> Parameters:
        return {"offset_s": (most * x, "s"), "offset_min": (most * x / 60.0, "min")}

    return SkyDial("clock-offset", "time", apply, report)


def curve(rng: np.random.Generator, station: SkyStation) -> SkyDial:
    """The response is believed to be straight."""
    most = 0.4 * _sign(rng)
    apply = _camera(lambda c, x: replace(c, curve=most * x))
    return SkyDial("nonlinearity", "response", apply, lambda x: {"exponent": (1.0 + most * x, "1")})


def ghost(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """The sun's ghost image stands opposite the centre (outside the catalogue)."""
    if not _offaxis(station):
        return None
    width = float(rng.uniform(6, 14))
    apply = _camera(lambda c, x: replace(c, ghost=3.0 * x, ghost_deg=width))
    return SkyDial("ghost", "lens", apply, lambda x: {"share": (3.0 * x, "1")}, inside=False)


def dust(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """Dust or drops on the dome at some places (outside the catalogue)."""
    if not _offaxis(station):
        return None
    spots = [(float(rng.uniform(10, 75)), float(rng.uniform(0, 360)), float(rng.uniform(7, 14))) for _ in range(2)]

    def dirty(c: CameraFaults, x: float) -> CameraFaults:
        return replace(c, dust=tuple((a, z, w, 0.9 * x) for a, z, w in spots))

    return SkyDial("dust", "lens", _camera(dirty), lambda x: {"share": (0.9 * x, "1")}, inside=False)


def pixel_response(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """The sensor's sensitivity rises from one rim to the other (outside the catalogue)."""
    if not _offaxis(station):
        return None
    towards = float(rng.uniform(0, 360))
    apply = _camera(lambda c, x: replace(c, tilt_of_field=0.8 * x, tilt_azimuth_deg=towards))
    return SkyDial("pixel-response", "sensor", apply, lambda x: {"share": (0.8 * x, "1")}, inside=False)


def fog(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """A fogged rim of the dome brightens the horizon (outside the catalogue)."""
    if not _offaxis(station):
        return None
    apply = _camera(lambda c, x: replace(c, fog=2.0 * x))
    return SkyDial("haze-band", "lens", apply, lambda x: {"share": (2.0 * x, "1")}, inside=False)


def motion(rng: np.random.Generator, station: SkyStation) -> SkyDial | None:
    """Camera and meter do not look at the same moment, and clouds move (outside the catalogue)."""
    if not any(t.drift for t in station.campaign.tests):
        return None
    return SkyDial(
        "cloud-motion",
        "time",
        lambda world, x: replace(world, motion_s=600.0 * x),
        lambda x: {"rms_s": (600.0 * x, "s")},
        inside=False,
    )


INSIDE: Final[dict[str, Maker]] = {
    "vignetting": vignetting,
    "veiling-glare": glare,
    "spectral-mismatch": tint,
    "exposure-error": shutter,
    "projection-error": projection,
    "clock-offset": clock,
    "nonlinearity": curve,
}
OUTSIDE: Final[dict[str, Maker]] = {
    "ghost": ghost,
    "dust": dust,
    "pixel-response": pixel_response,
    "haze-band": fog,
    "cloud-motion": motion,
}
