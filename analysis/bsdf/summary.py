"""What a BSDF file holds, in numbers and in words."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from analysis.bsdf.convert import to_klems
from analysis.bsdf.forms import Stored, by_angle, diffuse, form_of
from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Incidence
from analysis.bsdf.report import report

_SIDES: tuple[Incidence, Incidence] = ("front", "back")


def summary(bsdf: Stored, theta_deg: Sequence[float]) -> dict[str, Any]:
    """Form, hemispherical values at angles of incidence (mean over azimuths), and the laws, as plain values.

    Trees are averaged over the full Klems basis for the laws.
    """
    parts = bsdf.components()
    theta = np.asarray(theta_deg, dtype=np.float64)
    klems = bsdf if isinstance(bsdf, KlemsBsdf) else to_klems(bsdf, incident=2)
    laws = report(klems)
    material = {name: value for name, value in vars(bsdf.material).items() if value}
    return {
        "form": form_of(bsdf),
        "material": material,
        "laws_on": klems.basis.name,
        "components": [str(part) for part in parts],
        "theta_deg": list(theta_deg),
        "hemispherical": {str(part): by_angle(bsdf, part, theta).tolist() for part in parts},
        "diffuse": {str(part): diffuse(bsdf, part) for part in parts},
        "most_light": {"front": float(laws.total_front.max()), "back": float(laws.total_back.max())},
        "furnace": {"front": float(laws.furnace_front.max()), "back": float(laws.furnace_back.max())},
        "reciprocity": [
            {"component": str(r.component), "partner": str(r.partner), "weighted": r.weighted, "worst": r.worst}
            for r in laws.reciprocity
        ],
        "problems": laws.problems(),
    }


def lines(told: Mapping[str, Any]) -> Iterator[str]:
    """A `summary` in words."""
    yield f"  {told['form']}"
    yield f"  {', '.join(f'{name} {value}' for name, value in told['material'].items())}"
    yield "  angle of incidence " + "".join(f"{angle:>7g}" for angle in told["theta_deg"]) + "  diffuse"
    for part, values in told["hemispherical"].items():
        yield f"  {part:<19}" + "".join(f"{v:7.3f}" for v in values) + f"{told['diffuse'][part]:9.4f}"
    if told["laws_on"] not in told["form"]:
        yield f"  laws: averaged over {told['laws_on']}, where the steps of a tree's cells alone look like breaks"
    for side in _SIDES:
        yield (
            f"  {side}: of no patch's light goes on more than {told['most_light'][side]:.4f}; "
            f"white furnace at most {told['furnace'][side]:.4f}"
        )
    for pair in told["reciprocity"]:
        yield (
            f"  {pair['component']} and {pair['partner']} walked backwards differ by {100.0 * pair['weighted']:.1f} % "
            f"of the light (single elements by up to {100.0 * pair['worst']:.0f} %)"
        )
    yield from (f"  read with patience: {odd}" for odd in told.get("oddities", ()))
    yield from (f"  broken: {problem}" for problem in told["problems"])
    if not told["problems"]:
        yield "  no law is broken (energy within 1 %, reciprocity within 5 %)"
