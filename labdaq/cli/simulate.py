"""``labdaq simulate``: the photometry of a skylight under a sky, by its figures or of recorded sessions."""

import contextlib
import functools
import json
from pathlib import Path
from typing import Any

import click

_SKIES = (
    "perez, clear, partly-cloudy, overcast, uniform, cie:1 .. cie:15, ies-clear, ies-partly-cloudy, ies-overcast, "
    "or a map (.hdr or .npz)"
)


def _list_settings(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from analysis.simulate.system import named, setting_names

        box = named("box")
        for name in setting_names():
            click.echo(f"{name} = {functools.reduce(getattr, name.split('.'), box)!r}")
        context.exit()


@click.command("simulate", short_help="Predict the photometry of a skylight.")
@click.argument("system", metavar="[SYSTEM]", required=False)
@click.option("--out", type=click.Path(path_type=Path), help="LM-63 file to write (.ies); a .csv with --series.")
@click.option(
    "--session",
    "sessions",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Predict a processed session under its own sky, in the near field; may be repeated.",
)
@click.option(
    "--series",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Predict flux and light below at each moment of a table (.csv) or a year's weather (.epw); --out is a .csv.",
)
@click.option(
    "--ray-set",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Light is the rays of a file instead (.txt, .csv, .tm25ray).",
)
@click.option(
    "--export",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Write geometry, BSDFs, a Radiance scene and, under a daylight, the rays on the cover for other programs.",
)
@click.option("--sky", default="perez", show_default=True, metavar="NAME|MAP", help=_SKIES)
@click.option("--global", "global_lx", type=click.FloatRange(min=0), help="Global horizontal illuminance [lx].")
@click.option("--diffuse", "diffuse_lx", type=click.FloatRange(min=0), help="Diffuse horizontal illuminance [lx].")
@click.option("--sun", metavar="ALT,AZ", help="Sun's altitude and azimuth from north through east [deg].")
@click.option("--time", metavar="UTC", help="Sun's position from a time instead, e.g. 2010-07-22T13:12:00Z.")
@click.option(
    "--site",
    default="34.2176,-82.1084,180",
    show_default=True,
    metavar="LAT,LON,ELEV",
    help="Site for --time, and for times of --series [deg, m].",
)
@click.option("--engine", type=click.Choice(["tracer", "radiance"]), default="tracer", show_default=True)
@click.option(
    "--distance", type=click.FloatRange(min=0, min_open=True), help="Near field at this distance [m]; else far field."
)
@click.option(
    "--room", metavar="WALL[,FLOOR]", help="Add the light of a room with these reflectances; needs --distance."
)
@click.option(
    "--directions",
    type=click.Choice(["fine", "arm"]),
    default="fine",
    show_default=True,
    help="Every 2.5 by 7.5 degrees, counted and smoothed; or the goniometer's 145, each scored without smoothing.",
)
@click.option("--no-shields", is_flag=True, help="Sensors without shields see the whole room (with --room).")
@click.option(
    "--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the system, e.g. wall.reflectance=0.9."
)
@click.option("--orientation", type=float, help="Turn the pattern of all prismatic lenses [deg, counter-clockwise].")
@click.option("--mirrored", is_flag=True, help="Mirror the pattern of all prismatic lenses.")
@click.option("--isotropic", is_flag=True, help="Lenses as an isotropic scatter model sees them.")
@click.option("--max-bounces", type=click.IntRange(min=0), help="Cut rays after so many wall reflections.")
@click.option(
    "--vary",
    multiple=True,
    metavar="NAME:KEY=VALUE,...",
    help="Also write FILE-NAME.ies with these settings (of --set, or max_bounces, rotation_deg, mirrored, isotropic, "
    "...), under the same random numbers; may be repeated.",
)
@click.option(
    "--precision",
    type=click.FloatRange(0.001, 0.5),
    default=0.01,
    show_default=True,
    help="Relative standard error to reach, root mean square over the brighter directions.",
)
@click.option("--rays", type=click.IntRange(min=1000), help="Rays for each part, instead of a precision.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--threads", type=click.IntRange(min=0), default=0, help="Cores to use; all when not given.")
@click.option("--parts", is_flag=True, help="Also write sun part and sky part apart, as NAME-sun.ies and NAME-sky.ies.")
@click.option("--name", default="", help="Name of the test in the file.")
@click.option(
    "--list-settings",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_settings,
    help="List what --set can change, with the values of the box, and stop.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object that says what was predicted.")
@click.pass_context
def command(
    context: click.Context, /, out: Path | None, sessions: tuple[Path, ...], as_json: bool, **options: Any
) -> None:
    """Predict the luminous intensity distribution of a skylight and write it as an .ies file.

    SYSTEM is top, box, tube, or a TOML file such as

    \b
        base = "box"
        well_depth_m = 0.8
        wall.reflectance = 0.92
        exit.orientation_deg = 45
        entry.bsdf = "lens.xml"     (Klems or tensor tree, beside the file)

    The sky is scaled to the diffuse illuminance; the sun gets the rest of the global one. Without a global
    illuminance there is no sun; skies that are bright about it still need its place (not overcast, uniform, cie:1,
    cie:3, cie:5, ies-overcast, or a map).

    A lens of a file that sends on more light than it gets is told of on standard error.

    With --session, the skylight is the one the session names (or SYSTEM), sun and sky are those that `labdaq process`
    found, and the files are SESSION/derived/simulated.ies, simulated-sun.ies and simulated-sky.ies.

    With --series, a table of moments (time in UTC, or sun_altitude_deg and sun_azimuth_deg; global_lx, diffuse_lx)
    or an EnergyPlus weather file becomes a table of flux [lm], candela at nadir and, with --distance, lux right below.

    With --vary, what a simulation may get wrong is set otherwise, one NAME at a time. Reflectance and bounces come from
    the tallies of the baseline where it was counted (--directions fine); the rest is traced again, as many rays:

    \b
        --vary dull:wall.reflectance=0.85 --vary cut:max_bounces=5 --vary turned:rotation_deg=45,haze=0.1

    With --export, solids go to DIR as OBJ and STL, prismatic lenses and the whole skylight as BSDF files, and, when
    --diffuse or a map tells the daylight, --rays (or 100,000) rays of sun and sky as text and TM-25; --ray-set reads
    such files back.
    """
    from labdaq.cli._first_time import compiling_is_told

    with contextlib.nullcontext() if as_json else compiling_is_told():
        if sessions:
            _sessions(context, sessions, as_json, options)
        elif options["series"] is not None:
            _series(context, out, as_json, options)
        else:
            _one(out, as_json, options)


def _one(out: Path | None, as_json: bool, options: dict[str, Any]) -> None:
    """Predict, or export, what the command line tells, and tell of it."""
    from labdaq.cli._simulate_job import Job, run
    from labdaq.cli._simulate_vary import in_words
    from labdaq.cli.files import check_folder

    if options["system"] is None:
        raise click.UsageError("name a SYSTEM, or give --session")
    if options["vary"] and out is None:
        raise click.UsageError("--vary writes beside --out FILE.ies, which is missing")
    if options["export"] is not None:
        from labdaq.cli._simulate_export import export

        exported = export(Job(out=out or Path(), **options))
        click.echo(json.dumps(exported) if as_json else "\n".join([*exported["files"], *exported["not_written"]]))
        if out is None:
            return
    if out is None:
        raise click.UsageError("--out FILE.ies is needed; only --session knows where to write")
    if out.suffix.lower() != ".ies":
        raise click.BadParameter("the name of a photometric file ends in .ies", param_hint="--out")
    check_folder(out)
    report = run(Job(out=out, **options))
    for note in report["notes"]:
        click.echo(f"note: {note}", err=True)
    if as_json:
        click.echo(json.dumps(report))
        return
    click.echo(_words(report))
    for variant in report.get("variants", ()):
        click.echo(in_words(variant, report["flux_lm"]))


_OF_SESSIONS = ("system", "sessions", "as_json", "settings", "orientation", "mirrored", "isotropic", "max_bounces",
                "precision", "rays", "seed", "threads", "parts")  # fmt: skip
"""Options that mean something with --session; the session itself tells the others."""


def _sessions(context: click.Context, sessions: tuple[Path, ...], as_json: bool, options: dict[str, Any]) -> None:
    """Predict sessions, and tell of each."""
    from analysis.process.prediction import Wish, simulate_sessions
    from analysis.simulate.lens_file import bright_lenses
    from labdaq.cli._simulate_job import changes

    given = context.get_parameter_source
    if odd := _others(context, _OF_SESSIONS):
        raise click.UsageError(f"{', '.join(odd)}: not with --session, which tells daylight, distance and place")
    exact = {"precision": options["precision"]} if given("precision") is click.core.ParameterSource.COMMANDLINE else {}
    notes: dict[str, None] = {}

    def change(system: Any) -> Any:
        changed = changes(system, options)
        notes.update(dict.fromkeys(bright_lenses(changed)))
        return changed

    wish = Wish(
        system=options["system"],
        change=change,
        rays=options["rays"],
        seed=options["seed"],
        threads=options["threads"],
        max_bounces=options["max_bounces"],
        **exact,
    )
    accounts = simulate_sessions(sessions, wish)
    for note in notes:
        click.echo(f"note: {note}", err=True)
    for path, account in zip(sessions, accounts, strict=True):
        if as_json:
            click.echo(json.dumps({**account, "path": str(path)}))
            continue
        click.echo(
            f"{path / 'derived'}: {', '.join(account['files'])}\n"
            f"  {account['system']['name']} at {account['distance_m']:g} m under its "
            f"{'own sky' if account['sky'] == 'map' else 'illuminances (a Perez sky: there is no sky map)'}: "
            f"{account['flux_lm']:.4g} lm, {account['flux_sun_lm']:.4g} of them from the sun; "
            f"statistical uncertainty {100 * account['uncertainty']:.2g} % rms"
        )


def _others(context: click.Context, known: tuple[str, ...]) -> list[str]:
    """Options on the command line that are not among those known."""
    given = context.get_parameter_source
    return [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name not in known and given(str(parameter.name)) is click.core.ParameterSource.COMMANDLINE
    ]


def _series(context: click.Context, out: Path | None, as_json: bool, options: dict[str, Any]) -> None:
    """Predict the moments of a table, and tell of them."""
    from labdaq.cli._simulate_series import OPTIONS, in_words, run_series
    from labdaq.cli.files import check_folder

    if odd := _others(context, OPTIONS):
        raise click.UsageError(f"{', '.join(odd)}: not with --series, whose moments are traced with --rays a sun")
    placed = context.get_parameter_source("site") is click.core.ParameterSource.COMMANDLINE
    if placed and options["series"].suffix.lower() == ".epw":
        raise click.UsageError("--site: an .epw file has its own")
    if options["system"] is None or out is None or out.suffix.lower() != ".csv":
        raise click.UsageError("--series needs a SYSTEM and --out FILE.csv")
    check_folder(out)
    report = run_series(options, out)
    for note in report["notes"]:
        click.echo(f"note: {note}", err=True)
    click.echo(json.dumps(report) if as_json else in_words(report))


def _words(report: dict[str, Any]) -> str:
    lines = [f"{path}" for path in report["files"]]
    lines.append(
        f"  {report['system']} ({report['engine']}, {report['field']} field): {report['flux_lm']:.4g} lm, "
        f"{report['flux_sun_lm']:.4g} of them from the sun; at most {report['peak_cd']:.4g} cd "
        f"at gamma {report['peak_gamma_deg']:g}, C {report['peak_c_deg']:g}"
    )
    sun = report["sun"]
    if "ray_set" in report:
        lines.append(f"  under the rays of {report['ray_set']}")
        lines.append(f"  uncertainty {100 * report['uncertainty']:.2g} % rms of the brighter directions")
        return "\n".join(lines)
    where = f"sun at {sun['altitude_deg']:.2f}, {sun['azimuth_deg']:.2f} degrees, " if sun else "no sun, "
    lines.append(f"  under {where}{report['global_lx']:.5g} lx global, {report['diffuse_lx']:.5g} lx diffuse")
    lines.append(f"  uncertainty {100 * report['uncertainty']:.2g} % rms of the brighter directions")
    return "\n".join(lines)
