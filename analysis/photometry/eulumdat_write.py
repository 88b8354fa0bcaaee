"""Write EULUMDAT (.ldt) files: absolute photometry, all planes, CR LF, Latin-1."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63_model import POINT, Opening
from labdaq.errors import DataError, Problems
from labdaq.whole_file import write_whole_bytes

_MAX_C: Final = 721
_MAX_GAMMA: Final = 361
_TEXT: Final = 78
"""Longest text line."""


def write_eulumdat(
    path: Path | str, distribution: Distribution, *, opening: Opening = POINT, watts: float = 0.0
) -> None:
    """Write a distribution as absolute photometry (lamp count -1, flux the luminaire's own).

    Parameters
    ----------
    distribution
        Its keywords LAB (or TESTLAB), TEST, LUMINAIRE, LUMCAT and DATE (or ISSUEDATE) fill the text lines.
    opening
        Luminous opening [m]; equal negative width and length for a round one.
    watts
        Power [W].

    Raises
    ------
    DataError
        No light, negative light, too many angles, or text that does not fit; all reasons are listed.
    StorageError
        The disk refused.
    """
    write_whole_bytes(Path(path), render_eulumdat(distribution, opening=opening, watts=watts, source=str(path)))


def render_eulumdat(
    distribution: Distribution, *, opening: Opening = POINT, watts: float = 0.0, source: str = "EULUMDAT data"
) -> bytes:
    """The bytes `write_eulumdat` writes; same parameters and errors."""
    flux = distribution.flux()
    words = distribution.keywords
    texts = {
        "identification": words.get("LAB") or words.get("TESTLAB", ""),
        "report": words.get("TEST", ""),
        "luminaire": words.get("LUMINAIRE", ""),
        "number": words.get("LUMCAT", ""),
        "date": words.get("DATE") or words.get("ISSUEDATE", ""),
    }
    _check(distribution, flux, texts, Problems(source))
    lines = list(_lines(distribution, flux, texts, opening, watts))
    return "".join(f"{line}\r\n" for line in lines).encode("latin-1")


def _check(distribution: Distribution, flux: float, texts: dict[str, str], problems: Problems) -> None:
    if not flux > 0:
        problems.add("intensity", "there is no light, and EULUMDAT is relative to the flux")
    if (distribution.candela < 0).any():
        problems.add("intensity", f"{distribution.candela.min():g} cd is negative")
    if len(distribution.c_deg) - 1 > _MAX_C:
        problems.add("C", f"{len(distribution.c_deg) - 1} planes; EULUMDAT has room for {_MAX_C}")
    if len(distribution.gamma_deg) > _MAX_GAMMA:
        problems.add("gamma", f"{len(distribution.gamma_deg)} angles; EULUMDAT has room for {_MAX_GAMMA}")
    for name, text in texts.items():
        if len(text) > _TEXT:
            problems.add(name, f"{len(text)} characters; EULUMDAT has room for {_TEXT}")
        if any(ord(letter) > 255 or ord(letter) < 32 for letter in text):
            problems.add(name, f"{text!r} is not one line of Latin-1")
    problems.raise_if_any(DataError)


def _lines(
    distribution: Distribution, flux: float, texts: dict[str, str], opening: Opening, watts: float
) -> Iterator[str]:
    gamma, c = distribution.gamma_deg, distribution.c_deg[:-1]
    planes = distribution.candela[:-1]
    round_ = len(c) == 1
    yield texts["identification"]
    yield "1" if round_ else "3"  # point source with symmetry about the axis, or any other
    yield "1" if round_ else "0"
    yield str(len(c))
    yield _step(distribution.c_deg)
    yield str(len(gamma))
    yield _step(gamma)
    yield from (texts["report"], texts["luminaire"], texts["number"], "", texts["date"])
    length, width = abs(opening.length_m) * 1000.0, abs(opening.width_m) * 1000.0
    if opening.width_m < 0:
        width = 0.0
    height = f"{abs(opening.height_m) * 1000.0:g}"
    yield from (f"{length:g}", f"{width:g}", height)
    yield from (f"{length:g}", f"{width:g}", height, height, height, height)
    yield f"{100.0 * _downward(distribution) / flux:.4g}"
    yield from ("100", "1", "0")  # light output ratio, conversion factor, tilt
    yield from ("1", "-1", "", f"{flux:.10g}", "", "", f"{watts:g}")
    yield from ["0"] * 10  # direct ratios, left to the lighting program
    yield from (f"{angle:.10g}" for angle in c)
    yield from (f"{angle:.10g}" for angle in gamma)
    for plane in planes * (1000.0 / flux):
        yield from (f"{value:.8g}" for value in plane)


def _step(angles: NDArray[np.float64]) -> str:
    """Distance of equidistant angles, else 0."""
    steps = np.diff(angles)
    return f"{steps[0]:.10g}" if np.allclose(steps, steps[0], atol=1e-9) else "0"


def _downward(distribution: Distribution) -> float:
    """Flux below the horizon [lm]."""
    gamma = distribution.gamma_deg
    if gamma[-1] <= 90.0:
        return distribution.flux()
    if gamma[0] >= 90.0:
        return 0.0
    below = np.append(gamma[gamma < 90.0], 90.0)
    return distribution.resampled(below, distribution.c_deg).flux()
