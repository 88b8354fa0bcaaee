"""Follow rays backwards through a skylight with ``rcontrib`` and add up what they find in the sky."""

import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.simulate.radiance.lenses import DEPTH, bsdf_file, sun_file
from analysis.simulate.radiance.scene import UNITS_PER_M, check, on_panes, scene_text
from analysis.simulate.radiance.tools import radiance
from analysis.simulate.source import Luminance
from analysis.simulate.system import System
from labdaq.directions import sky_vector

Floats = NDArray[np.float64]

_PARAMETERS: Final = (
    *("-ab", "24", "-ad", "1", "-as", "0", "-aa", "0"),
    *("-ss", "1", "-st", "0", "-lr", "-2000", "-lw", "2e-3", "-u+"),
)
"""One sample per event and Russian roulette.

A limit of reflections would cut what a mirror well passes near grazing: 24 lose 0.9 % of a uniform sky through a tube.
"""

STEP_DEG: Final = 0.5
"""Between points of the sky's table, along altitude and azimuth."""

_SKY_CAL: Final = """\
{ Degrees from the horizon, and from north through east }
alt = Asin(Dz) * 180 / PI;
azi = if(turn, turn, turn + 360);
turn = atan2(Dx, Dy) * 180 / PI;
"""


def contributions(
    system: System,
    suns: list[tuple[float, float, float]],
    half_angle_deg: float,
    rays: Floats,
    per_row: int,
    sky: Luminance | int,
    processes: int = 2,
    depth: int = DEPTH,
) -> Floats:
    """Means over each ``per_row`` consecutive rays, shape (rows, columns).

    Parameters
    ----------
    suns, half_angle_deg
        Unit vectors of discs of radiance 1.
    rays : shape (rows * per_row, 6)
        Starting points [m] and directions.
    sky
        Its luminance [cd/m²], which gives one column; or a whole number k for the coefficients of all MF:k patches
        (the first column is the ground). One column for each sun follows.
    depth
        Of the tensor trees of prismatic lenses: their finest cells are a ``2 ** depth``-th of the square.

    Raises `SimulationError` for what the engine cannot do, and when Radiance fails.
    """
    check(system)
    with tempfile.TemporaryDirectory(prefix="labdaq-radiance-") as name:
        folder = Path(name)
        lenses = _lens_files(system, folder, depth)
        text = scene_text(system, lenses, suns, half_angle_deg, sky_data=not isinstance(sky, int))
        if isinstance(sky, int):
            bins = 144 * sky**2 + 2
            wanted = ["-V-", "-e", f"MF:{sky}", "-f", "reinhart.cal", "-bn", str(bins), "-b", "rbin"]
        else:
            (folder / "sky.cal").write_text(_SKY_CAL)
            (folder / "sky.dat").write_text(_sky_data(sky))
            wanted = ["-V+", "-bn", "1", "-b", "0"]
        wanted += ["-m", "skyglow"]
        for k in range(len(suns)):
            wanted += ["-bn", "1", "-b", "0", "-m", f"sun{k}"]
        return _means(folder, text, wanted, rays, per_row, processes)


def sun_contributions(
    system: System,
    sun: tuple[float, float, float],
    half_angle_deg: float,
    rays: Floats,
    per_row: int,
    processes: int = 2,
    depth: int = DEPTH,
) -> Floats:
    """Means of one sun's light alone, through a prismatic cover with the finer cells of `sun_file`; shape (rows,).

    Parameters and errors are those of `contributions`. In trees from which rays to the sky are drawn such cells would
    make Radiance draw from several times as many tables, more than it keeps. ``-dj 0`` asks for the middle of the sun's
    disc; else Radiance takes any place in most of the disc, and a part would fall beside the cell.
    """
    check(system)
    with tempfile.TemporaryDirectory(prefix="labdaq-radiance-") as name:
        folder = Path(name)
        lenses = _lens_files(system, folder, depth)
        if toward := on_panes(system, sun):
            lenses["entry"] = sun_file(system.entry, folder, toward, half_angle_deg, depth)
        text = scene_text(system, lenses, [sun], half_angle_deg)
        wanted = ["-dj", "0", "-V+", "-bn", "1", "-b", "0", "-m", "sun0"]
        return _means(folder, text, wanted, rays, per_row, processes)[:, 0]


def _lens_files(system: System, folder: Path, depth: int) -> dict[str, Path]:
    places = (place for place in ("entry", "exit") if getattr(system, place).kind in ("prismatic", "bsdf"))
    return {place: bsdf_file(getattr(system, place), folder, depth) for place in places}


def _means(folder: Path, scene: str, wanted: list[str], rays: Floats, per_row: int, processes: int) -> Floats:
    """Run ``rcontrib`` in a folder that holds the scene's files; means as `contributions` returns them."""
    (folder / "scene.rad").write_text(scene)
    (folder / "scene.oct").write_bytes(radiance(["oconv", "scene.rad"], b"", folder))
    command = ["rcontrib", "-w", "-h", "-fff", "-n", str(processes), "-c", str(per_row), *_PARAMETERS, *wanted]
    units = rays * np.repeat([UNITS_PER_M, 1.0], 3)
    out = radiance([*command, "scene.oct"], units.astype(np.float32).tobytes(), folder)
    rows = len(rays) // per_row
    return np.frombuffer(out, dtype=np.float32).reshape(rows, -1, 3)[..., 0].astype(np.float64)


def _sky_data(sky: Luminance) -> str:
    """A sky as a Radiance data file over altitude and azimuth."""
    altitude = np.linspace(0.0, 90.0, round(90.0 / STEP_DEG) + 1)
    azimuth = np.linspace(0.0, 360.0, round(360.0 / STEP_DEG) + 1)
    vectors = sky_vector(altitude[:, None], azimuth[None, :])
    vectors[0, :, 2] = 1e-6  # the horizon belongs to the sky
    values = np.asarray(sky(vectors), dtype=np.float64)
    head = f"2\n0 90 {len(altitude)}\n0 360 {len(azimuth)}\n"
    return head + "\n".join(" ".join(f"{value:.6g}" for value in row) for row in values) + "\n"
