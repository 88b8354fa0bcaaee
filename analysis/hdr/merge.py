"""From a bracket of exposures to one picture of luminance, with its uncertainty.

Read and sample the exposures, find the response and the true times, learn the noise, merge. What each step decided goes
into the record.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.bracket import Bracket, open_bracket
from analysis.hdr.flags import NAMES
from analysis.hdr.luminance import SRGB_ROW, camera_row, superpixels
from analysis.hdr.merged import Exposure, Merged, Plane, Recipe
from analysis.hdr.noise import Noise, learn_noise
from analysis.hdr.ratios import misfit, refine_times
from analysis.hdr.recover import recover_response
from analysis.hdr.response import Response
from analysis.hdr.times import step_of

Floats = NDArray[np.float64]

HARD_RAW: Final = 0.95
HARD_CODE: Final = 243
"""From here on a signal only says 'at least': share of a sensor's range, and code of 8 bits (JPEG rings up to 250)."""

SOFT: Final = 0.15
"""Below the hard limit a weight fades over this share of it."""

LOW_CODE: Final = 4
"""Darker codes are used only where no longer exposure tells more."""

PLAY: Final = {True: 0.05, False: 0.15}
"""How far exposures may differ beyond their noise before the scene counts as moved: raw files, pictures."""

_BLOCK: Final = 128


@dataclass(frozen=True)
class _Plan:
    """What is decided before the pixels are merged: one noise and one set of limits for each channel."""

    times: Plane
    when: Plane
    noise: Plane
    limits: Plane
    record: dict[str, Any]


def merge(exposures: Sequence[Exposure], recipe: Recipe | None = None) -> Merged:
    """Merge a bracket.

    Raises `DataError` that lists every exposure that cannot be read, has no usable time, or does not fit the others.
    """
    paths, times = [e.path for e in exposures], [e.time_s for e in exposures]
    return merge_files(paths, times, [e.when_s for e in exposures], recipe)


def merge_files(
    paths: Sequence[Path],
    times_s: Sequence[float | None] | None = None,
    when_s: Sequence[float | None] | None = None,
    recipe: Recipe | None = None,
    mistakes: Sequence[str] = (),
) -> Merged:
    """Merge a bracket given as lists: as `merge`, and lists of unequal length are one more mistake.

    ``times_s`` and ``when_s`` mean what `Exposure` says [s]; ``None`` for all of them is allowed. ``mistakes`` are
    those the caller has found already: with any, the merge is refused, and they are named with the exposures' own.
    """
    recipe = recipe or Recipe()
    times = [None] * len(paths) if times_s is None else times_s
    bracket = open_bracket(paths, times, recipe.crop, recipe.memory_mb, mistakes)
    labels = np.array([times[i] is None for i in bracket.order])
    steps = np.where(labels | bool(recipe.snap), [step_of(t) for t in bracket.told_s], bracket.told_s)
    readings = {"exact steps": steps, "as told": bracket.told_s}
    if recipe.snap is not None or np.array_equal(steps, bracket.told_s):
        readings.pop("as told" if recipe.snap else "exact steps")
    when = _when([None] * len(paths) if when_s is None else when_s, bracket)
    record: dict[str, Any] = {
        "files": [path.name for path in bracket.paths],
        "kind": "raw" if bracket.sensor else f"{bracket.samples.dtype.itemsize * 8} bit",
        "size": [bracket.height, bracket.width],
        "told_s": bracket.told_s.tolist(),
        "f_number": bracket.exif.f_number,
    }
    if bracket.sensor is not None:
        done = _merge_raw(bracket, readings, when, recipe, record)
    else:
        done = _merge_pictures(bracket, readings, when, recipe, record)
    counts = {name: int(np.count_nonzero(done.flags & bit)) for bit, name in NAMES.items()}
    done.record.update(pixels=int(done.flags.size), flagged=counts)
    return done


def _when(when_s: Sequence[float | None], bracket: Bracket) -> Floats:
    """Middles of the exposures in the bracket's order [s]; one after the other as given, where no clock tells."""
    known = [when_s[i] for i in bracket.order]
    if all(w is not None for w in known):
        return np.array(known, dtype=np.float64)
    as_given = np.empty(len(bracket.told_s))
    as_given[bracket.order] = bracket.told_s
    return np.asarray((np.cumsum(as_given) - as_given / 2.0)[bracket.order])


def _believed(misfits: dict[str, float], record: dict[str, Any]) -> str:
    """Which reading of the times the exposures contradict least; the first one when they cannot tell."""
    name = min(misfits, key=lambda reading: misfits[reading])
    record["times_read"] = {"as": name, "misfit_ln": {reading: round(v, 6) for reading, v in misfits.items()}}
    return name


def _plan(
    signals: list[Floats],
    hard: list[float],
    low: list[float],
    full: float,
    told: Floats,
    when: Floats,
    recipe: Recipe,
    record: dict[str, Any],
    *,
    refine: bool,
) -> _Plan:
    """Refine the times and learn the noise from sampled signals (F, P) of each channel; note both in ``record``."""
    times = told
    if recipe.refine if recipe.refine is not None else refine:
        main = 1 if len(signals) == 3 else 0
        first = recipe.noise or learn_noise(signals[main], told, hard[main], full)
        refined = refine_times(signals[main], told, first, hard[main])
        times = refined.times_s
        record["refined"] = refined.record(told)
    noises = [recipe.noise or learn_noise(s, times, h, full) for s, h in zip(signals, hard, strict=True)]
    record["times_s"] = times.tolist()
    record["noise"] = [{"s2": n.s2, "g": n.g, "k": n.k, "assumed": n.assumed} for n in noises]
    return _Plan(
        times.astype(np.float32),
        (when - when.min()).astype(np.float32),
        np.array([[n.s2, n.g, n.k] for n in noises], np.float32),
        np.array([[h, 1.0 / (SOFT * h), lo, PLAY[refine] ** 2] for h, lo in zip(hard, low, strict=True)], np.float32),
        record,
    )


def _merge_raw(
    bracket: Bracket, readings: dict[str, Floats], when: Floats, recipe: Recipe, record: dict[str, Any]
) -> Merged:
    """Merge raw files: one plane of linear codes, four places to a cell of the mosaic."""
    from analysis.hdr.kernels import ROWS, merge_mono

    sensor = bracket.sensor
    assert sensor is not None
    full = sensor.white - float(sensor.black.max())
    row, column = bracket.sample_places
    signals = bracket.samples - sensor.black[row % 2, column % 2]
    hard = HARD_RAW * full
    typical = Noise.typical(full)
    told = readings[_believed({k: misfit(signals, t, typical, hard) for k, t in readings.items()}, record)]
    plan = _plan([signals], [hard], [0.0], full, told, when, recipe, record, refine=True)
    weights = recipe.luminance_row or camera_row(sensor.xyz_to_camera)
    record.update(black=sensor.black.ravel().tolist(), white=sensor.white, covered_median=sensor.dark)
    if sensor.mosaic:
        record["luminance_row"] = list(weights) if weights else "green only: the file has no colour matrix"
    step = 2 if sensor.mosaic else 1
    height, width = bracket.height // step, bracket.width // step
    planes, flags = np.empty((4, height, width), np.float32), np.empty((height, width), np.uint8)
    black = np.tile(sensor.black.astype(np.float32), (ROWS // 2, bracket.width // 2 + 1))[:, : bracket.width].copy()
    parts = 1 if bracket.one_group else -(-bracket.height // ROWS)
    state = np.empty((parts, 5, ROWS * bracket.width), np.float32)
    block = np.empty((4, _BLOCK, bracket.width), np.float32)
    marks = np.empty((_BLOCK, bracket.width), np.uint8)
    for part in bracket.parts():
        t, w = plan.times[part.at], plan.when[part.at]
        for top in range(0, height * step, _BLOCK):
            end = min(top + _BLOCK, height * step)
            merge_mono(
                part.codes,
                black,
                t,
                w,
                plan.noise[0],
                plan.limits[0],
                state,
                part.first,
                part.last,
                top,
                end,
                block,
                marks,
            )
            here = slice(top // step, end // step)
            if part.last and sensor.mosaic:
                cells = block[:, : end - top], marks[: end - top]
                planes[:, here], flags[here] = superpixels(*cells, sensor.colours, weights or (0.0, 1.0, 0.0))
            elif part.last:
                planes[:, here], flags[here] = block[:, : end - top], marks[: end - top]
    return Merged(planes[0], planes[1], planes[2], planes[3], flags, step, record=record)


def _merge_pictures(
    bracket: Bracket, readings: dict[str, Floats], when: Floats, recipe: Recipe, record: dict[str, Any]
) -> Merged:
    """Merge colour pictures of 8 or 16 bits through their response."""
    from analysis.hdr.kernels import merge_colour

    response, told = _response(bracket, readings, recipe, record)
    record["response"] = {"kind": response.kind, "source": response.source, "residual_ln": response.residual}
    curves = response.table(bracket.samples.dtype.itemsize * 8)
    hard_code, low_code = (int(code * (curves.shape[1] - 1) / 255.0) for code in (HARD_CODE, LOW_CODE))
    hard, low = curves[:, hard_code].tolist(), curves[:, low_code].tolist()
    shut = np.any(bracket.samples >= hard_code, axis=2)
    signals = [np.where(shut, 9e9, curves[c][bracket.samples[..., c]]) for c in range(3)]
    plan = _plan(signals, hard, low, 1.0, told, when, recipe, record, refine=False)
    row = recipe.luminance_row or SRGB_ROW
    record["luminance_row"] = list(row)
    height, width = bracket.height, bracket.width
    planes, flags = np.empty((4, height, width), np.float32), np.empty((height, width), np.uint8)
    channels = np.empty((3, height if recipe.keep_channels else 1, width), np.float32)
    state = np.empty((1 if bracket.one_group else height, 3, 5, width), np.float32)
    table, weights = curves.astype(np.float32), np.array(row, np.float32)
    for part in bracket.parts():
        merge_colour(
            part.codes,
            table,
            hard_code,
            weights,
            plan.times[part.at],
            plan.when[part.at],
            plan.noise,
            plan.limits,
            state,
            part.first,
            part.last,
            planes,
            flags,
            channels,
        )
    kept = channels if recipe.keep_channels else None
    return Merged(planes[0], planes[1], planes[2], planes[3], flags, 1, kept, response, record)


def _response(
    bracket: Bracket, readings: dict[str, Floats], recipe: Recipe, record: dict[str, Any]
) -> tuple[Response, Floats]:
    """The response of pictures, given or recovered, and the reading of the times that suits it."""
    if recipe.response is None and bracket.samples.dtype == np.uint8:
        recovered = {name: recover_response(bracket.samples, t.tolist()) for name, t in readings.items()}
        name = _believed({k: r.residual or 0.0 for k, r in recovered.items()}, record)
        return recovered[name], readings[name]
    response = recipe.response or Response.linear()
    curve = response.table(bracket.samples.dtype.itemsize * 8)[1]
    hard = float(curve[int(HARD_CODE * (len(curve) - 1) / 255.0)])
    shut = np.any(bracket.samples >= HARD_CODE * (len(curve) - 1) / 255.0, axis=2)
    green = np.where(shut, 9e9, curve[bracket.samples[..., 1]])
    typical = Noise.typical(1.0)
    name = _believed({k: misfit(green, t, typical, hard) for k, t in readings.items()}, record)
    return response, readings[name]
