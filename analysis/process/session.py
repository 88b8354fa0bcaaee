"""Process a session: its sky as a picture in cd/m², its sun, and its measured photometry.

Writes into ``SESSION/derived``, whole or not at all:

    sky.hdr         Radiance picture of the sky without the sun's disc [cd/m²], looking up (-vta -vh 180 -vv 180)
    sky.npz         the same as a master, with its record (`analysis.sky.map.SkyMap.load`)
    measured.ies    LM-63-2019: near-field intensity at the arm's distance, normalised to one global illuminance
    process.json    every decision and figure, and what is missing
"""

from pathlib import Path
from typing import Any, Final

import labdaq
from analysis.photometry.lm63 import write_lm63
from analysis.photometry.reduction import Reduction
from analysis.process.derived import PROCESS, SIMULATE, rewrite, write_account
from analysis.process.scan import opening_of, scan_of, summary
from analysis.process.sky import PIXELS, sky_of
from analysis.sky.process import SkyResult
from labdaq.errors import DataError
from labdaq.session import Session

FORMAT: Final = "labdaq-process/1"
SKY_PICTURE: Final = "sky.hdr"
SKY_MASTER: Final = "sky.npz"
MEASURED: Final = "measured.ies"


def process_session(path: Path, *, pixels: int = PIXELS, fill_missing: bool = False) -> dict[str, Any]:
    """Process the session at ``path``; return the account that is written to ``derived/process.json``.

    A session without camera, roof meters or arm gives what can be given, and ``missing`` says what is not there.

    Parameters
    ----------
    pixels
        Along a side of the sky map.
    fill_missing
        Interpolate directions of the arm that have no usable reading.

    Raises
    ------
    DataError
        It is no session, nothing can be made of it, or something cannot be used that is there, e.g. a truncated file.
    StorageError
        The disk refused.
    """
    session = Session.open(path)
    station = session.station
    sky, without_sky = sky_of(session, station, pixels)
    scan, without_scan = scan_of(session, station, fill_missing=fill_missing)
    missing = [f"sky: {what}" for what in without_sky] + [f"photometry: {what}" for what in without_scan]
    if sky is None and scan is None:
        raise DataError(
            "\n".join(f"{path}: {what}" for what in missing), "a session of exposures or of the arm is needed"
        )
    files = ([SKY_PICTURE, SKY_MASTER] if sky else []) + ([MEASURED] if scan else [])
    account: dict[str, Any] = {
        "format": FORMAT,
        "session": session.header.name,
        "test": session.header.test,
        "system": session.header.system,
        "software": {"labdaq": labdaq.__version__},
        "outcome": session.outcome,
        "files": files,
        "missing": missing,
        "sky": sky.record if sky else None,
        "photometry": summary(scan) if scan else None,
    }

    def fill(folder: Path) -> None:
        _write(folder, session, sky, scan)
        write_account(folder / PROCESS, account)

    rewrite(session.path, (PROCESS, SIMULATE), fill)
    return account


def _write(folder: Path, session: Session, sky: SkyResult | None, scan: Reduction | None) -> None:
    if sky is not None:
        sky.sky.save_picture(folder / SKY_PICTURE)
        sky.sky.save(folder / SKY_MASTER)
    if scan is not None:
        write_lm63(
            folder / MEASURED,
            scan.distribution,
            generation=scan.generation,
            opening=opening_of(session.header.system),
        )
