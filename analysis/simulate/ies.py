"""A prediction as LM-63 files: the one place where simulation meets the writer of photometric files."""

import dataclasses
from pathlib import Path

from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, Opening, write_lm63
from analysis.photometry.testdata import TestData
from analysis.simulate.prediction import Prediction
from analysis.simulate.system import System
from analysis.simulate.tally import Field


def write_prediction(path: Path, made: Prediction, field: Field, issued: str, *, parts: bool = False) -> list[Path]:
    """Write a prediction's total to ``path``, and its parts beside it as ``NAME-sun.ies`` and ``NAME-sky.ies``.

    ``issued`` is the date in the file, e.g. ``2026-01-31``. Returns what was written; raises `StorageError`.
    """
    seen = made.field(field)
    wanted: list[tuple[Path, str, Distribution]] = [(path, "sun and sky", seen.total)]
    if parts:
        wanted += [
            (path.with_stem(f"{path.stem}-{name}"), f"{name} part", distribution)
            for name, distribution in (("sun", seen.sun), ("sky", seen.sky))
        ]
    for place, what, distribution in wanted:
        words = keywords(made, field, issued, what)
        write_lm63(
            place,
            dataclasses.replace(distribution, keywords=words),
            generation=FileGeneration.SIMULATED,
            opening=opening(made.system),
        )
    return [place for place, _, _ in wanted]


def opening(system: System) -> Opening:
    """The aperture as the luminous opening of a luminaire; width runs east-west, length north-south."""
    if system.aperture.shape == "disc":
        return Opening.disc(system.aperture.diameter_m)
    width, length = system.aperture.size_m
    return Opening(width, length, 0.0)


def keywords(made: Prediction, field: Field, issued: str, what: str) -> dict[str, str]:
    """LM-63 keywords of a simulated file: what the standard requires, the daylight, and how it was made."""
    day = made.daylight
    distance_m = made.distance_m if field == "near" else None
    if "rays" in made.facts:  # given one by one: no daylight is known
        data = TestData(distance_m=distance_m, field=field)
    else:
        data = TestData(
            sun_altitude_deg=day.sun_altitude_deg,
            sun_azimuth_deg=day.sun_azimuth_deg % 360.0,
            global_lx=day.beam_lx + day.diffuse_lx,
            diffuse_lx=day.diffuse_lx,
            distance_m=distance_m,
            field=field,
        )
    worst = 100.0 * made.field(field).worst_relative()
    varied = {}
    if "variant" in made.facts:
        setting = ", ".join(f"{key} = {value}" for key, value in made.facts["setting"].items())
        varied = {"_VARIANT": f"{made.facts['variant']}: {setting}"}
    return {
        "TEST": day.name or f"simulation of {made.system.name}",
        "TESTLAB": "labdaq (simulated, not measured)",
        "ISSUEDATE": issued,
        "MANUFAC": "labdaq",
        "LUMINAIRE": f"skylight {made.system.name} ({made.system.kind})",
        "_PART": what,
        "_ENGINE": made.engine,
        "_UNCERTAINTY": f"{worst:.2g} % rms, statistics only",
        **varied,
        **data.keywords(),
    }
