"""``labdaq merge``: a bracket of exposures to one luminance map."""

import json
from pathlib import Path
from typing import Any

import click


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILES...")
@click.option(
    "--times",
    type=click.Path(path_type=Path),
    help="Exposure times in seconds, one a line (0.25 or 1/250), in the order of FILES; else from the files' Exif.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Radiance picture to write (.hdr).")
@click.option(
    "--response",
    default=None,
    metavar="linear|srgb|recover|FILE",
    help="Of 8-bit pictures: a frozen response (.rsp, or kept by --save-response), or recovered from the bracket.",
)
@click.option("--save-response", type=click.Path(path_type=Path), help="Keep the response used, to freeze it.")
@click.option("--lens", type=click.Path(path_type=Path), help="Lens file (TOML): unwrap a fisheye to an angular map.")
@click.option("--size", default=1000, show_default=True, type=click.IntRange(16, 4000), help="Of the unwrapped map.")
@click.option("--scale", type=click.FloatRange(min=0.0, min_open=True), help="cd/m² for a signal of one per second.")
@click.option("--colour", is_flag=True, help="Write red, green and blue instead of luminance (8-bit pictures only).")
@click.option("--labels", is_flag=True, help="Take the cameras' round times as they are, even if exact steps fit.")
@click.option(
    "--refine/--no-refine", default=None, help="Refine the times from the exposures; raw files do by default."
)
@click.option("--master", type=click.Path(path_type=Path), help="Also keep 32-bit planes and the record (.npz).")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object that says what was decided and found.")
def command(files: tuple[Path, ...], out: Path, as_json: bool, **options: Any) -> None:
    """Merge exposures of one scene (DNG and other raw files, JPEG, PNG, TIFF) into a map of luminance.

    Every pixel is the best mean of the exposures that show it, with its variance. Without a scale the map is
    relative. All mistakes are told at once, and nothing is written unless all is well.
    """
    from labdaq.cli._merge_job import Job, run
    from labdaq.cli.files import check_folder

    for path in (out, options["save_response"], options["master"]):
        if path is not None:
            check_folder(path)
    if out.suffix.lower() != ".hdr":
        raise click.BadParameter("the map is a Radiance picture; its name ends in .hdr", param_hint="--out")
    if options["colour"] and options["lens"]:
        raise click.UsageError("--colour keeps the picture's own geometry; leave out --lens")
    report = run(Job(files=files, out=out, **options))
    click.echo(json.dumps(report) if as_json else _words(report))


def _words(report: dict[str, Any]) -> str:
    record, unit = report["record"], report["unit"]
    lines = [f"{report['out']}: {report['size'][1]} x {report['size'][0]} pixels, {unit}"]
    low, high = report["range"]
    lines.append(f"  {len(record['files'])} exposures, {record['kind']}; values from {low:.4g} to {high:.4g}")
    if "response" in record:
        lines.append(f"  response: {record['response']['source']}")
    if "refined" in record:
        change = max(abs(v) for v in record["refined"]["change_percent"])
        lines.append(f"  exposure times refined from the exposures, by up to {change:.2g} %")
    lines.append(f"  median uncertainty from noise {100.0 * report['median_relative_sd']:.2g} % a pixel")
    marks = [f"{count} {name}" for name, count in record["flagged"].items() if count]
    lines.append(f"  of {record['pixels']} pixels: {', '.join(marks) if marks else 'none doubtful'}")
    if report["illuminance"] is not None:
        lines.append(
            f"  illuminance from the hemisphere: {report['illuminance']:.5g} {'lx' if unit == 'cd/m2' else ''}"
        )
    return "\n".join(lines)
