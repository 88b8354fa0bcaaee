"""The sky of a recorded session."""

from dataclasses import asdict

from analysis.hdr.merge import merge
from analysis.process.camera import camera_of, check_as_recorded, lens_of, merge_recipe, with_told_times
from analysis.process.roof import diffuse_channels, global_channels, meter, site_of, window_of, zenith_channels
from analysis.sky.calibrate import METER_DISC_HALF_ANGLE_DEG
from analysis.sky.process import SkyRecipe, SkyResult, SkyTest, calibrated_sky
from analysis.sky.unwrap import unwrap
from labdaq.session import Session
from labdaq.station import Station

PIXELS = 512
"""Along a side of the map: about 0.35 degrees a pixel, the resolution of a picture of 640 x 480."""


def sky_of(session: Session, station: Station, pixels: int = PIXELS) -> tuple[SkyResult | None, list[str]]:
    """Make the session's sky map and sun; ``None`` and what is missing for it, where something is.

    Raises `DataError` for pictures or readings that are there but cannot be used, e.g. a truncated file.
    """
    window = window_of(session, station)
    total = meter(session, global_channels(station), window)
    diffuse = meter(session, diffuse_channels(station), window)
    missing = [] if session.photos() else ["no exposure of the camera"]
    missing += [] if total else ["no usable reading of the global illuminance during the test"]
    missing += [] if diffuse else ["no usable reading of the diffuse illuminance during the test"]
    if missing or window is None or total is None or diffuse is None:
        return None, missing
    camera = camera_of(station)
    exposures = with_told_times(session)
    picture = merge(exposures, merge_recipe(camera))
    check_as_recorded(session)
    lens, flags = lens_of(camera, picture)
    zenith = meter(session, zenith_channels(station), window)
    disc_deg = station.shading_disc.half_angle_deg if station.shading_disc else METER_DISC_HALF_ANGLE_DEG
    test = SkyTest(exposures, window.middle_ns, site_of(station), total, diffuse, zenith, lens)
    recipe = SkyRecipe(pixels=pixels, merge=merge_recipe(camera), meter_half_angle_deg=disc_deg)
    result = calibrated_sky(test, unwrap(picture, lens, pixels), recipe)
    result.record["merge"] = picture.record
    result.record["lens"] = asdict(lens)
    result.record["flags"] = flags + result.record["flags"]
    return result, ([] if zenith else ["no usable reading of the zenith luminance: the map has no independent check"])
