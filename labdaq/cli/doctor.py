"""``labdaq doctor``: is everything there that a test needs?"""

import json
import sys
from pathlib import Path

import click

from labdaq.cli.files import json_option, read_station, sessions_folder, station_option


@click.command("doctor", short_help="Look at every instrument, the clock and the disk.")
@station_option
@json_option
def command(station_file: Path | None, as_json: bool) -> None:
    """Connect every instrument and show its identity and a reading, or what is wrong and what to try.

    Nothing is moved. Exit code 69 when an instrument is missing, 74 when sessions cannot be written, 78 when a
    certificate is not where the station file says.
    """
    from labdaq.build import mount
    from labdaq.doctor import Finding, examine_bench, examine_certificates, examine_clock, examine_disk
    from labdaq.runs import choose_clock, run_on

    station = read_station(station_file)
    clock = choose_clock(station, virtual=False, rate=None)

    async def bench() -> list[Finding]:
        async with mount(station, clock, False)() as mounted:
            return await examine_bench(mounted, clock)

    findings = run_on(clock, bench())
    findings.append(examine_clock(clock, station))
    findings.append(examine_disk(sessions_folder(station, station_file, None)))
    findings += examine_certificates(station, station_file, clock.utc_ns())
    for f in findings:
        if as_json:
            line = {"check": f.check, "name": f.name, "ok": f.ok, "what": f.what, "try": f.hint, **(f.facts or {})}
            click.echo(json.dumps(line))
        else:
            mark = (
                click.style("ok  ", fg="green") if f.ok else click.style("FAIL", fg="red" if f.exit_code else "yellow")
            )
            click.echo(f"{mark} {f.check:<11} {f.name:<18} {f.what}")
            if f.hint:
                click.echo(f"     try: {f.hint}")
    sys.exit(next((f.exit_code for f in findings if f.exit_code), 0))
