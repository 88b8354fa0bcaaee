"""The prismatic sheet through Radiance: an engine that shares no code with ours.

pyradiance's ``generate_bsdf`` is used around four traps, two of which make light from nothing:

1. With the real sizes in metres, rays hit facets where there are none; the white furnace of a 5 mm sheet gives 1.3
   instead of 1. Hence the model is in millimetres (``unit_mm=1``): a BSDF has no scale.
2. Its rays start 1e-6 off the sheet, which is nothing beside coordinates of many millimetres in single precision: the
   first surface is missed. Hence the sampling box is padded.
3. Its usual ray limits (-lr, -lw 3e-6) drop light that goes back and forth in the sheet: T + R is 0.97 on average.
   Hence ``LIMITS``.
4. At the rim light leaves sideways. Hence only the middle cells of a large array are sampled.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.prism import PrismSheet
from analysis.bsdf.report import report
from analysis.bsdf.xml_read import parse_bsdf
from labdaq.errors import ConfigError, SimulationError

LIMITS: Final = ("-lr", "-40", "-lw", "1e-8")
"""Ray limits that follow light until a hundred millionth is left: T + R is 0.9999."""


def prism_scene(sheet: PrismSheet, *, cells: int = 40, unit_mm: float = 1.0, pad: float = 0.01) -> bytes:
    """A Radiance description of cells x cells pyramids as one closed solid of acrylic.

    In the frame of a BSDF: flat side at z = -thickness - pad, peaks at z = -pad, towards the room (+z). Lengths in mm
    are divided by ``unit_mm``, and the transmissivity, which Radiance takes per unit of length, follows.

    Raises
    ------
    ConfigError
        The sheet is rounded, turned or blurred: planes cannot show that.
    """
    if not sheet.perfect or sheet.orientation_deg or sheet.isotropic or sheet.slope_error_deg:
        raise ConfigError("the Radiance model holds perfect pyramids along x and y, without slope errors")
    pitch, thick, height = (x / unit_mm for x in (sheet.pitch_mm, sheet.thickness_mm, sheet.height_mm))
    clear = math.exp(-sheet.absorption_per_mm * unit_mm)
    lines = [f"void dielectric acrylic\n0\n0\n5 {clear:.12g} {clear:.12g} {clear:.12g} {sheet.index:.9g} 0"]
    count = 0

    def polygon(*points: tuple[float, float, float]) -> None:
        nonlocal count
        numbers = " ".join(f"{x:.10g}" for point in points for x in point)
        lines.append(f"acrylic polygon f{count}\n0\n0\n{3 * len(points)} {numbers}")
        count += 1

    half = cells * pitch / 2.0
    low, high = -thick - pad, -height - pad
    for i in range(cells):
        for j in range(cells):
            x0, y0 = -half + i * pitch, -half + j * pitch
            x1, y1 = x0 + pitch, y0 + pitch
            top = ((x0 + x1) / 2.0, (y0 + y1) / 2.0, -pad)
            base = [(x0, y0, high), (x1, y0, high), (x1, y1, high), (x0, y1, high)]
            for k in range(4):  # counter-clockwise seen from outside
                polygon(base[k], base[(k + 1) % 4], top)
    polygon((-half, -half, low), (-half, half, low), (half, half, low), (half, -half, low))
    rim = [(-half, -half), (half, -half), (half, half), (-half, half)]
    for k in range(4):
        (ax, ay), (bx, by) = rim[k], rim[(k + 1) % 4]
        polygon((ax, ay, low), (bx, by, low), (bx, by, high), (ax, ay, high))
    return ("\n".join(lines) + "\n").encode("ascii")


def radiance_klems(
    sheet: PrismSheet,
    *,
    basis: str = "kf",
    samples: int = 500,
    cells: int = 40,
    unit_mm: float = 1.0,
    pad: float = 0.01,
    limits: Sequence[str] = LIMITS,
    processes: int = 1,
) -> KlemsBsdf:
    """Klems matrices of a perfect sheet by Radiance.

    Parameters
    ----------
    basis
        ``kf``, ``kh`` or ``kq``.
    samples
        Rays per incident patch.
    cells
        Pyramids along each side of the model; the middle tenth is sampled.
    unit_mm, pad, limits
        Length of the model's unit, how far off the sheet rays start [units], and Radiance's ray limits; change them
        only to see the traps.
    processes
        Processor cores Radiance may take.

    Raises
    ------
    SimulationError
        More than 1.02 times the light comes out of a patch than goes in.
    """
    import pyradiance  # slow to import
    from pyradiance.genbsdf import SamplingBox

    pitch, thick = sheet.pitch_mm / unit_mm, sheet.thickness_mm / unit_mm
    reach = max(1, cells // 10) * pitch / 2.0
    box = SamplingBox(-reach, reach, -reach, reach, -thick - 2.0 * pad, 0.0)
    found: Any = pyradiance.generate_bsdf(
        prism_scene(sheet, cells=cells, unit_mm=unit_mm, pad=pad),
        basis=basis, nsamp=samples, nproc=processes, dim=box, params=list(limits),
    )  # fmt: skip
    xml = pyradiance.generate_xml(vis_results=found, basis=basis)
    klems = parse_bsdf(xml, "Radiance's BSDF").bsdf
    assert isinstance(klems, KlemsBsdf)
    laws = report(klems)
    most = max(float(laws.total_front.max()), float(laws.total_back.max()))
    if most > 1.02:
        raise SimulationError(f"Radiance gave {most:.3f} times the light back", "check unit_mm and pad")
    return klems
