"""What ``labdaq merge`` does, once it is known that it shall: kept apart so that ``--help`` imports nothing heavy."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

import labdaq
from analysis.hdr.flags import SATURATED
from analysis.hdr.lens_file import read_lens
from analysis.hdr.merge import merge_files
from analysis.hdr.merged import Merged, Recipe
from analysis.hdr.radiance_picture import LUMENS_PER_WATT, SKY_VIEW, write_luminance, write_rgb
from analysis.hdr.response import Response
from analysis.hdr.times import read_times
from analysis.sky.unwrap import unwrap
from labdaq.errors import DataError, LabdaqError
from labdaq.whole_file import write_whole

T = TypeVar("T")

SRGB_PRIMARIES: Final = "PRIMARIES= 0.6400 0.3300 0.3000 0.6000 0.1500 0.0600 0.3127 0.3290"


@dataclass(frozen=True)
class Job:
    """The command's arguments."""

    files: tuple[Path, ...]
    out: Path
    times: Path | None = None
    response: str | None = None
    save_response: Path | None = None
    lens: Path | None = None
    size: int = 1000
    scale: float | None = None
    colour: bool = False
    labels: bool = False
    refine: bool | None = None
    master: Path | None = None


def run(job: Job) -> dict[str, Any]:
    """Merge, write, and return a JSON-able report.

    Raises one `LabdaqError` with all mistakes: in the times file, the response, the lens file and the exposures.
    """
    mistakes: list[str] = []
    times = _tried(mistakes, read_times, job.times)
    if job.times and times is None:
        times = [1.0] * len(job.files)  # only to look at the pictures as well before it is refused
    response = _tried(mistakes, _response, job.response)
    lens = _tried(mistakes, read_lens, job.lens)
    recipe = Recipe(
        response=response,
        snap=False if job.labels else None,
        refine=job.refine,
        luminance_row=lens.luminance.row if lens else None,
        crop=lens.crop if lens else None,
        keep_channels=job.colour,
    )
    picture = merge_files(job.files, times, None, recipe, mistakes)
    if job.colour and picture.channels is None:
        raise DataError("raw files are merged to luminance; --colour is for pictures", "leave --colour out")
    scale = job.scale or (lens.luminance.scale if lens else None)
    picture = picture.scaled(scale) if scale else picture
    aperture = picture.record["f_number"]
    sky = unwrap(picture, lens.lens_in(lens.crop, aperture), job.size).sky if lens else None
    shown = sky.luminance if sky else picture.signal.astype(np.float64)
    unit = "cd/m2" if scale else "relative"
    _write(job, picture, shown, unit)
    sure = (picture.flags & SATURATED == 0) & (picture.signal > 0.0)
    return {
        "out": str(job.out),
        "size": list(shown.shape),
        "unit": unit,
        "range": [float(picture.signal.min()), float(picture.signal.max())],
        "median_relative_sd": float(np.median(np.sqrt(picture.variance[sure]) / picture.signal[sure]))
        if sure.any()
        else None,
        "illuminance": sky.horizontal_illuminance() if sky else None,
        "record": picture.record,
    }


def _tried(mistakes: list[str], read: Callable[[Any], T], given: object) -> T | None:
    """``read(given)``, or ``None`` for nothing given; what is wrong with it is noted."""
    try:
        return None if given is None else read(given)
    except LabdaqError as error:
        mistakes += error.message.splitlines()
        return None


def _response(words: str) -> Response | None:
    known = {"linear": Response.linear, "srgb": Response.srgb}
    if words in known:
        return known[words]()
    return None if words == "recover" else Response.load(Path(words))


def _write(job: Job, picture: Merged, shown: NDArray[np.float64], unit: str) -> None:
    """Write all that was asked for."""
    note = (f"SOFTWARE= labdaq {labdaq.__version__}", f"UNIT= {unit}", f"EXPOSURES= {len(picture.record['files'])}")
    if job.master:
        write_whole(job.master, lambda beside: _fill_master(beside, picture, unit))
    if job.save_response and picture.response:
        picture.response.save(job.save_response)
    if picture.channels is not None:
        rgb = np.moveaxis(picture.channels, 0, -1).astype(np.float64) / LUMENS_PER_WATT
        write_rgb(job.out, rgb, comments=(*note, SRGB_PRIMARIES))
    else:
        write_luminance(job.out, shown, view=SKY_VIEW if job.lens else "", comments=note)


def _fill_master(beside: Path, picture: Merged, unit: str) -> None:
    with beside.open("wb") as file:
        np.savez_compressed(
            file,
            signal=picture.signal,
            variance=picture.variance,
            worth=picture.worth,
            mean_time=picture.mean_time,
            flags=picture.flags,
            record=np.array(json.dumps({**picture.record, "unit": unit})),
        )
