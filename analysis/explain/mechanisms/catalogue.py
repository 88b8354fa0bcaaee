"""The catalogue: every mechanism labdaq knows, in the order of the chain."""

from analysis.explain.mechanisms import (
    camera,
    dirt,
    glare,
    goniometer,
    lens,
    range_limit,
    roof_meters,
    room,
    sensors,
    sun_and_sky,
    timing,
    well,
)
from analysis.explain.mechanisms.base import Mechanism

CATALOGUE: tuple[Mechanism, ...] = (
    sun_and_sky.SkySunRatio(),
    sun_and_sky.CircumsolarAureole(),
    sun_and_sky.CloudDrift(),
    lens.LensHaze(),
    lens.LensAnisotropy(),
    lens.LensOrientation(),
    dirt.Soiling(),
    well.WallReflectance(),
    well.BounceTruncation(),
    well.WallScatter(),
    room.RoomInterreflection(),
    room.StrayLight(),
    goniometer.NearField(),
    goniometer.GammaOffset(),
    goniometer.COffset(),
    goniometer.CHandedness(),
    goniometer.ChannelSwap(),
    sensors.DarkOffset(),
    sensors.Nonlinearity(),
    sensors.Saturation(),
    sensors.CosineResponse(),
    sensors.ChannelGain(),
    timing.ClockOffset(),
    roof_meters.MeterTilt(),
    roof_meters.MeterGain(),
    roof_meters.MeterCosine(),
    range_limit.MeterRangeLimit(),
    camera.Vignetting(),
    glare.VeilingGlare(),
    camera.SpectralMismatch(),
    camera.ExposureError(),
    camera.ProjectionError(),
)

BY_ID: dict[str, Mechanism] = {m.id: m for m in CATALOGUE}
