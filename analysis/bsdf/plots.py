"""Pictures of scattering: the outgoing hemisphere seen along the normal, one panel for each direction of incidence.

matplotlib is imported when a picture is made.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from analysis.bsdf.model import Bsdf, Component, Floats
from labdaq.whole_file import write_whole


def hemisphere_image(bsdf: Bsdf, component: Component, incident_xy: Floats, pixels: int = 256) -> Floats:
    """BSDF [1/sr] over the disc of outgoing directions of travel, shape (pixels, pixels); NaN outside.

    Row 0 is y = -1, column 0 is x = -1. The projection is orthographic: equal areas are equal projected solid angles.
    """
    axis = (np.arange(pixels) + 0.5) / pixels * 2.0 - 1.0
    x, y = np.meshgrid(axis, axis)
    xy = np.stack([x, y], axis=-1)
    inside = np.sum(xy**2, axis=-1) < 1.0
    image = np.full((pixels, pixels), np.nan)
    image[inside] = bsdf.evaluate(component, incident_xy, xy[inside])
    return image


def plot_scatter(
    path: Path | str,
    bsdf: Bsdf,
    component: Component,
    theta_deg: Sequence[float] = (0.0, 20.0, 40.0, 60.0),
    phi_deg: float = 0.0,
    title: str = "",
    pixels: int = 256,
) -> None:
    """Save a picture of where light from several directions goes.

    Parameters
    ----------
    path
        The ending chooses the format (``.svg``, ``.png``, ``.pdf``).
    theta_deg, phi_deg
        Directions of travel of the incident light [deg], theta from the normal; a cross marks the straight (or mirror)
        ray of each.
    title
        Above the picture.

    Raises
    ------
    StorageError
        The file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.0 * len(theta_deg) + 0.8, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(theta_deg), squeeze=False)[0]
    phi = np.radians(phi_deg)
    places = [np.sin(np.radians(theta)) * np.array([np.cos(phi), np.sin(phi)]) for theta in theta_deg]
    images = [hemisphere_image(bsdf, component, place, pixels) for place in places]
    top = max((float(np.nanmax(image)) for image in images), default=1.0) or 1.0
    norm = LogNorm(top * 1e-3, top)
    picture = None
    for axis, theta, place, image in zip(axes, theta_deg, places, images, strict=True):
        shown = np.maximum(image, top * 1e-3)
        picture = axis.imshow(shown, origin="lower", extent=(-1, 1, -1, 1), norm=norm, cmap="magma")
        axis.plot(*place, "+", color="white", markersize=7)
        total = float(bsdf.hemispherical(component, place))
        axis.set_title(f"{theta:g}°: {100.0 * total:.1f} %", fontsize=9)
        axis.set_axis_off()
    if picture is not None:
        figure.colorbar(picture, ax=axes, shrink=0.8, label="1/sr")
    figure.suptitle(title or component.value, fontsize=10)
    write_whole(Path(path), figure.savefig)
