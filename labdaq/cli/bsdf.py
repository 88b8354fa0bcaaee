"""``labdaq bsdf``: look at BSDF files, convert them, and make them of sheets and of measured scattering."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from analysis.bsdf.forms import Made
    from analysis.bsdf.model import Component

_F = TypeVar("_F", bound=Callable[..., Any])
_PATH = click.Path(path_type=Path)
_FORMS = ("klems-full", "klems-half", "klems-quarter", "klems-2x", "klems-4x", "tree3", "tree4")
_ANGLES = tuple(range(0, 90, 10))
_out = click.option("--out", required=True, type=_PATH, help="BSDF file to write (.xml).")
_name = click.option("--name", default="", help="Name of the sample in the file.")
_seed = click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
_rays = click.option(
    "--rays", type=click.IntRange(min=1), default=10_000, show_default=True, help="For each patch or cell, when traced."
)
_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def _to(default: str | None) -> Callable[[_F], _F]:
    return click.option(
        "--to", "form", type=click.Choice(_FORMS), default=default, required=default is None, show_default=True,
        help="Klems basis (145, 77, 41, 581, 2321 patches) or tensor tree (3: isotropic, 4: not).",
    )  # fmt: skip


@click.group("bsdf", short_help="Look at, convert and make BSDF files.")
def command() -> None:
    """Look at BSDF files, convert them, and make them of prismatic sheets or of measured scattering.

    Files are LBNL's XML: Klems matrices and tensor trees. `labdaq simulate` takes them as lenses (entry.bsdf = "FILE").
    """


@command.command("report")
@click.argument("file", type=_PATH)
@click.option("--plot", type=_PATH, help="Also draw where light from 0, 20, 40 and 60 degrees goes (.svg, .png, .pdf).")
@click.option(
    "--component",
    type=click.Choice(["transmission-front", "transmission-back", "reflection-front", "reflection-back"]),
    help="What to draw; the first that the file describes when not given.",
)
@_json
def report(file: Path, plot: Path | None, component: str | None, as_json: bool) -> None:
    """Tell what FILE holds: form, hemispherical values by angle of incidence, and whether it can be true.

    Trees are averaged over the full Klems basis for reciprocity and white furnace.
    """
    from analysis.bsdf.summary import lines, summary
    from analysis.bsdf.xml_read import read_bsdf

    found = read_bsdf(file)
    told = summary(found.bsdf, _ANGLES) | {"file": str(file), "bands": found.bands, "oddities": found.oddities}
    if plot is not None:
        from analysis.bsdf.plots import plot_scatter

        part = _component(component) if component else found.bsdf.components()[0]
        if part not in found.bsdf.components():
            raise click.BadParameter(f"{file} does not describe it", param_hint="--component")
        if plot.suffix.lower() not in (".svg", ".png", ".pdf"):
            raise click.BadParameter("the name of a picture ends in .svg, .png or .pdf", param_hint="--plot")
        plot_scatter(plot, found.bsdf, part, title=f"{file.name}: {part.value}")
        told["plot"] = str(plot)
    click.echo(json.dumps(told) if as_json else "\n".join([str(file), *lines(told)]))


@command.command("convert")
@click.argument("file", type=_PATH)
@_to(None)
@_out
@_rays
@_seed
@_json
def convert(file: Path, form: str, out: Path, rays: int, seed: int, as_json: bool) -> None:
    """Bring FILE into another basis or into a tensor tree, and keep its light.

    Values are averaged, without noise; what goes on of evenly diffuse light is told before and after.
    To tree3, what is not isotropic is traced: its mean over all orientations.
    """
    import numpy as np

    from analysis.bsdf.forms import converted
    from analysis.bsdf.xml_read import read_bsdf

    _checked(out)
    found = read_bsdf(file).bsdf
    made = converted(found, form, rays=rays, rng=np.random.default_rng(seed))
    _finish(made, out, as_json, before=found)


@command.command("sheet")
@_out
@_to("tree4")
@click.option("--pitch", default=5.0, show_default=True, help="Side of a pyramid's base [mm].")
@click.option("--slope", default=27.0, show_default=True, help="Angle between facets and sheet [deg].")
@click.option("--thickness", default=3.0, show_default=True, help="From the flat side to the peaks [mm].")
@click.option("--index", default=1.491, show_default=True, help="Refractive index.")
@click.option("--absorption", default=0.03, show_default=True, help="Natural-logarithm coefficient [1/mm].")
@click.option("--blur", default=4.0, show_default=True, help="Standard deviation of the facets' slope [deg].")
@click.option("--peak-radius", default=0.0, show_default=True, help="Rounds peaks and ridges [mm].")
@click.option("--valley-radius", default=0.0, show_default=True, help="Fillets of the valleys [mm].")
@click.option(
    "--dimple", type=(float, float), default=(0.0, 0.0), metavar="RADIUS DEPTH",
    help="Spherical dimples in the flat side above the peaks: radius of the rim, depth [mm].",
)  # fmt: skip
@click.option("--orientation", default=0.0, show_default=True, help="Turn of the pattern, counter-clockwise [deg].")
@click.option("--mirrored", is_flag=True, help="The mirror image, east and west exchanged.")
@click.option(
    "--prisms", type=click.Choice(["down", "up"]), default="down", show_default=True,
    help="The file's back carries the prisms (down), or its front.",
)  # fmt: skip
@_name
@_rays
@_seed
@_json
def sheet(out: Path, form: str, name: str, rays: int, seed: int, as_json: bool, **shape: Any) -> None:
    """Trace a clear sheet of square pyramids, sharp or rounded, and write its BSDF.

    \b
        labdaq bsdf sheet --peak-radius 0.5 --valley-radius 0.2 --out sheet.xml

    Use it in a system's file as entry.bsdf = "sheet.xml". The front is the flat side, unless the prisms are up.
    Orientation is that seen from the front, which lies up: x is east, y south.
    """
    import numpy as np

    from analysis.bsdf.forms import Made, traced
    from analysis.bsdf.klems import KlemsBsdf
    from analysis.bsdf.model import Material
    from analysis.bsdf.prism import PrismSheet, prism_tracer, turned_over
    from analysis.bsdf.report import made_reciprocal

    _checked(out)
    made_of = PrismSheet(
        index=shape["index"],
        thickness_mm=shape["thickness"],
        pitch_mm=shape["pitch"],
        slope_deg=shape["slope"],
        slope_error_deg=shape["blur"],
        absorption_per_mm=shape["absorption"],
        peak_radius_mm=shape["peak_radius"],
        valley_radius_mm=shape["valley_radius"],
        dimple_radius_mm=shape["dimple"][0],
        dimple_depth_mm=shape["dimple"][1],
        orientation_deg=shape["orientation"] if shape["prisms"] == "down" else -shape["orientation"],
        mirrored=shape["mirrored"],
    )
    tracer = prism_tracer(made_of)
    if shape["prisms"] == "up":
        tracer = turned_over(tracer)
    material = Material(name or "prismatic sheet", "labdaq", shape["thickness"] / 1000.0)
    made = traced(tracer, form, np.random.default_rng(seed), rays=rays, material=material)
    if isinstance(made.bsdf, KlemsBsdf):  # as trees are
        made = Made(made_reciprocal(made.bsdf), rays)
    _finish(made, out, as_json)


@command.command("import")
@click.argument("file", type=_PATH)
@_out
@_to("klems-full")
@click.option("--both-sides", is_flag=True, help="What FILE tells of the front holds for the back, too.")
@_name
@_rays
@_seed
@_json
def import_(file: Path, out: Path, form: str, both_sides: bool, name: str, rays: int, seed: int, as_json: bool) -> None:
    """Make a BSDF file of measured or fitted scattering.

    FILE is TOML with ABg (Harvey-Shack) parameters,

    \b
        [reflection-front]            (or transmission-front, transmission-back, reflection-back)
        a = 0.02                      (f = A / (B + d^g), d the distance from the mirror ray in direction cosines)
        b = 0.02
        g = 1.8
        hemispherical = 0.85          (optional: scales A)

    or a CSV table of BSDF values over the angles of ASTM E2387, with the columns

    \b
        component, theta_i_deg, phi_i_deg, theta_s_deg, phi_s_deg, bsdf_per_sr

    or of relative intensity about the mirror ray, whose size comes from hemispherical values:

    \b
        component, theta_i_deg, theta_m_deg, phi_m_deg, intensity, hemispherical
    """
    import numpy as np

    from analysis.bsdf.forms import converted
    from analysis.bsdf.model import Material
    from analysis.bsdf.scatter_file import read_scatter

    _checked(out)
    found = read_scatter(file, both_sides=both_sides)
    rng = np.random.default_rng(seed)
    made = converted(found, form, rays=rays, rng=rng, material=Material(name or file.stem, "labdaq"))
    _finish(made, out, as_json)


def _component(word: str) -> "Component":
    from analysis.bsdf.model import Component

    return next(part for part in Component if part.key == word)


def _checked(out: Path) -> None:
    """Refuse a bad name before any work is done."""
    from labdaq.cli.files import check_folder

    if out.suffix.lower() != ".xml":
        raise click.BadParameter("the name of a BSDF file ends in .xml", param_hint="--out")
    check_folder(out)


def _finish(made: "Made", out: Path, as_json: bool, before: Any = None) -> None:
    """Write the file and tell what is in it, beside what was there ``before``."""
    from analysis.bsdf.brightest import TOLD, brightest
    from analysis.bsdf.forms import diffuse, form_of
    from analysis.bsdf.xml_write import write_bsdf

    write_bsdf(out, made.bsdf)
    values = {str(part): diffuse(made.bsdf, part) for part in made.bsdf.components()}
    told: dict[str, Any] = {"file": str(out), "form": form_of(made.bsdf), "rays": made.rays, "diffuse": values}
    if before is not None:
        told["before"] = {
            "form": form_of(before), "diffuse": {str(part): diffuse(before, part) for part in before.components()}
        }  # fmt: skip
    light = brightest(made.bsdf)
    notes = [str(light)] if light.share > TOLD else []
    told["notes"] = notes
    for note in notes:
        click.echo(f"note: {out}: {note}", err=True)
    if as_json:
        click.echo(json.dumps(told))
        return
    how = f"traced, {made.rays} rays for each patch or cell" if made.rays else "averaged"
    click.echo(f"{out}\n  {told['form']}; {how}\n  of evenly diffuse light goes on:")
    for part, value in values.items():
        was = f" (before: {told['before']['diffuse'][part]:.4f})" if before is not None else ""
        click.echo(f"    {part:<18} {value:.4f}{was}")
