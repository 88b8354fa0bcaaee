"""``labdaq process``: what follows from a recorded session."""

import json
from pathlib import Path
from typing import Any

import click

from labdaq.errors import LabdaqError


@click.command("process", short_help="Make a session's sky map and measured photometry.")
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--size", "pixels", default=512, show_default=True, type=click.IntRange(64, 4000), help="Of the sky map.")
@click.option("--fill-missing", is_flag=True, help="Interpolate directions of the arm without a usable reading.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object a session.")
def command(sessions: tuple[Path, ...], pixels: int, fill_missing: bool, as_json: bool) -> None:
    """Process each SESSION: exposures to a sky in cd/m² and the sun beside it, the arm's readings to an .ies file.

    Writes derived/sky.hdr, sky.npz, measured.ies and process.json (every decision and figure) into the session;
    what was recorded is not touched. A session without camera or arm gives what it can. What was derived before is
    replaced, predictions of `labdaq simulate` among it, because they belong to the sky that was.
    """
    from analysis.process.session import process_session

    failed: list[LabdaqError] = []
    for path in sessions:
        try:
            account = process_session(path, pixels=pixels, fill_missing=fill_missing)
        except LabdaqError as error:
            failed.append(error)
            if as_json:
                click.echo(json.dumps({"session": str(path), "error": error.message}))
            continue
        if as_json:
            click.echo(json.dumps({**account, "path": str(path), "error": ""}))
        else:
            click.echo(_words(path, account))
    if failed:
        first = failed[0]
        first.message = "\n".join(error.message for error in failed)
        raise first


def _words(path: Path, account: dict[str, Any]) -> str:
    lines = [f"{path / 'derived'}: {', '.join(account['files'])}"]
    if sky := account["sky"]:
        sun, scale, zenith = sky["sun"], sky["calibration"], sky["zenith"]
        lines.append(
            f"  sun at {sun['altitude_deg']:.2f}, {sun['azimuth_deg']:.2f} degrees with "
            f"{sun['normal_illuminance_lx']:.4g} lx; sky {scale['diffuse_lx']:.4g} lx on the horizontal"
        )
        if zenith:
            lines.append(
                f"  zenith: meter {zenith['meter_cd_m2']:.4g} cd/m2 is {zenith['ratio_meter_to_map']:.3f} of the map's "
                f"({zenith['deviation_in_sd']:+.1f} standard uncertainties)"
            )
        if sky["flags"]:
            lines.append(f"  doubtful: {', '.join(sky['flags'])}")
    if scan := account["photometry"]:
        lines.append(
            f"  photometry: {scan['flux_lm']:.4g} lm, at most {scan['peak_cd']:.4g} cd, "
            f"uncertainty {100 * scan['relative_uncertainty_rms']:.2g} % rms"
        )
    lines += [f"  missing: {what}" for what in account["missing"]]
    return "\n".join(lines)
