"""A session's exposures and its camera's lens."""

import hashlib
import math
from typing import Final

from analysis.hdr.fisheye import Lens, find_circle
from analysis.hdr.merged import Exposure, Merged, Recipe
from analysis.hdr.response import Response
from labdaq.clock import NS
from labdaq.equipment import Camera, Fisheye
from labdaq.errors import ConfigError, DataError, Problems
from labdaq.session import Session
from labdaq.station import Station

_RESPONSES: Final = {"srgb": Response.srgb, "linear": Response.linear}


def exposures_of(session: Session) -> list[Exposure]:
    """The session's pictures with their times: those in the files (Exif); see `Exposure`.

    Times that a file does not tell are taken from the journal by `with_told_times`.
    """
    return [Exposure(session.path / photo.file, None, photo.mono_ns / NS) for photo in session.photos()]


def with_told_times(session: Session) -> list[Exposure]:
    """The session's pictures; where a file has no exposure time, the camera's account or else the one set is used."""
    from analysis.hdr.exif import read_exif

    found = []
    for photo, exposure in zip(session.photos(), exposures_of(session), strict=True):
        told = read_exif(exposure.path).exposure_s
        time_s = None if told is not None else photo.exposure_s or photo.nominal_exposure_s
        found.append(Exposure(exposure.path, time_s, exposure.when_s))
    return found


def check_as_recorded(session: Session) -> None:
    """Raise `DataError` naming every picture that is not the one the journal tells of."""
    problems = Problems(session.path.name)
    for photo in session.photos():
        content = (session.path / photo.file).read_bytes()
        if hashlib.sha256(content).hexdigest() != photo.sha256:
            problems.add(photo.file, "is not what was recorded")
    problems.raise_if_any(DataError, "`labdaq session verify` looks at the whole session")


def camera_of(station: Station) -> Camera:
    """The station's camera; a default one where the station file has none."""
    for entry in station.instrument:
        if isinstance(entry, Camera):
            return entry
    return Camera(name="camera", port="usb")


def merge_recipe(camera: Camera) -> Recipe:
    """How the camera's pictures are merged; raw files are linear, whatever ``response`` says."""
    known = _RESPONSES.get(camera.response)
    return Recipe(response=known() if known else None)


def lens_of(camera: Camera, picture: Merged) -> tuple[Lens, list[str]]:
    """The lens in the coordinates of the camera's pictures, and flags for what was not known.

    ``lens-assumed``: the picture's circle was taken for the lens's edge, because no focal length is given.

    Raises `ConfigError` for a lens that cannot be, and `DataError` when no circle can be seen.
    """
    glass = camera.lens
    height, width = (side * picture.pixel_step for side in picture.signal.shape)
    flags = []
    if camera.image_focal_px is None:
        try:
            row, column, radius = (x * picture.pixel_step for x in find_circle(picture.signal))
        except ValueError as error:
            raise DataError(
                f"the camera's circle cannot be found in its pictures: {error}",
                "give image_focal_px and [instrument.lens] in the station file",
            ) from error
        flags.append("lens-assumed")
    else:
        row, column, radius = height / 2.0, width / 2.0, _edge_radius(glass, camera.image_focal_px)
    if glass.centre_px is not None:
        row, column = glass.centre_px
    try:
        lens = Lens(
            row,
            column,
            radius,
            glass.edge_deg,
            glass.projection,
            glass.coefficients,
            glass.up_azimuth_deg,
            glass.east_at_right,
            glass.vignetting,
        )
    except ValueError as error:
        raise ConfigError(f"camera '{camera.name}': lens: {error}", "correct the station file") from error
    return lens, flags


def _edge_radius(glass: Fisheye, focal_px: float) -> float:
    """Distance from the centre at which the lens's edge is seen [pixel]: the slope on the axis is the focal length."""
    edge = math.radians(glass.edge_deg)
    if glass.projection == "equisolid":
        return 2.0 * focal_px * math.sin(edge / 2.0)
    first = glass.coefficients[0] if glass.projection == "polynomial" and glass.coefficients else 1.0
    return focal_px * edge / first
