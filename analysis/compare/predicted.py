"""What a simulation predicts for one test: its distributions, as values at directions and as files of a case."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Self

import numpy as np

from analysis.cases.model import Aperture, Floats
from analysis.photometry import Distribution
from analysis.photometry.any_file import OTHER_SUFFIXES, read_distribution
from analysis.photometry.closing import closed_at_90
from analysis.photometry.lm63 import FileGeneration, Opening, parse_lm63, render_lm63
from analysis.photometry.lm63_model import REQUIRED_KEYWORDS
from labdaq.errors import DataError

_EDGE_DEG: Final = 1e-6
_DIGITS: Final = 9  # the rounding of a file must stay far below any noise


@dataclass(frozen=True, kw_only=True)
class Predicted:
    """Predicted intensity of one test: sun part and sky part, or the total alone.

    Attributes
    ----------
    sun, sky
        Light that comes from the sun, and from the rest of the sky [cd].
    total
        Both together, where the parts are not known apart [cd].
    raw
        The files' own bytes by part (``sun``, ``sky``, ``total``), where the distributions were read from files.
    source
        Where it comes from, for error messages.
    """

    sun: Distribution | None = None
    sky: Distribution | None = None
    total: Distribution | None = None
    raw: Mapping[str, bytes] = field(default_factory=dict)
    source: str = "prediction"

    def __post_init__(self) -> None:
        if (self.sun is None) != (self.sky is None):
            raise DataError(f"{self.source}: give the sun part and the sky part together, or the total alone")
        if self.sun is None and self.total is None:
            raise DataError(f"{self.source}: there is neither a sun and a sky part nor a total")
        if self.sun is not None and self.total is not None:
            raise DataError(f"{self.source}: give either the parts or the total; the total of the parts is their sum")

    @classmethod
    def read(cls, paths: Mapping[str, Path]) -> Self:
        """Read files by part: .ies, .ldt, or candela tables (see `analysis.photometry.any_file`).

        Raises `DataError` naming the file and the line.
        """
        raw, parts = {}, {}
        for part, path in paths.items():
            if path.suffix.lower() in OTHER_SUFFIXES:
                parts[part] = read_distribution(path)  # a case gets it as .ies
                continue
            try:
                raw[part] = path.read_bytes()
            except OSError as error:
                raise DataError(f"{path}: cannot be read: {error.strerror}") from None
            parts[part] = parse_lm63(raw[part], str(path)).distribution
        return cls(**parts, raw=raw, source=", ".join(str(p) for p in paths.values()) or "prediction")

    @property
    def parts(self) -> dict[str, Distribution]:
        """The distributions there are, by part."""
        given = {"sun": self.sun, "sky": self.sky, "total": self.total}
        return {name: part for name, part in given.items() if part is not None}

    def at(self, gamma_deg: Floats, c_deg: Floats) -> tuple[Floats, Floats, Floats]:
        """Total, sun part and sky part [cd] at directions (N,), bilinear; parts that are not known are NaN.

        Raises `DataError` for a direction that a file does not cover: nothing is known there, not even that it is dark.
        """
        for name, part in self.parts.items():
            low, high = part.gamma_deg[0] - _EDGE_DEG, part.gamma_deg[-1] + _EDGE_DEG
            outside = (gamma_deg < low) | (gamma_deg > high)
            if np.any(outside):
                covered = f"{part.gamma_deg[0]:g} to {part.gamma_deg[-1]:g}"
                reading = f"{gamma_deg[outside][0]:g}"
                raise DataError(
                    f"{self.source}: the {name} covers gamma {covered}, but there is a reading at {reading}"
                )
        if self.sun is not None and self.sky is not None:
            sun, sky = self.sun.at(gamma_deg, c_deg), self.sky.at(gamma_deg, c_deg)
            return sun + sky, sun, sky
        assert self.total is not None
        unknown = np.full(len(gamma_deg), np.nan)
        return self.total.at(gamma_deg, c_deg), unknown, unknown

    def files(
        self, stem: str, test: str, *, group: str = "", aperture: Aperture | None = None, issued: str = ""
    ) -> dict[str, bytes]:
        """LM-63 files by name, ``simulated/<stem>-sun.ies`` and so on: the files' own bytes, else written now.

        Parameters
        ----------
        stem, group
            See `file_name`.
        test, issued
            Name of the test and date, for keywords that the standard requires and the distribution lacks.
        aperture
            The luminous opening to state.
        """
        names = self.names(stem, group)
        return {
            names[part]: self.raw.get(part) or _render(distribution, part, test, aperture, issued)
            for part, distribution in self.parts.items()
        }

    def names(self, stem: str, group: str = "") -> dict[str, str]:
        """The parts and the names of their files, as ``simulated`` in case.toml wants them."""
        return {part: file_name(stem, part, group) for part in self.parts}


def file_name(stem: str, part: str, group: str = "") -> str:
    """Where a part lies in a case: ``simulated/T18-sun.ies``, or with a group ``simulated/variant-1/T18-sun.ies``."""
    return f"simulated/{group + '/' if group else ''}{safe_name(stem)}-{part}.ies"


def stems_of(ids: Iterable[str], shown: Callable[[str], str] = lambda text: text) -> dict[str, str]:
    """A file name for each of ``ids``: what is ``shown`` of it where that is a good name, and never the same twice."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for name in ids:
        first = safe_name(shown(name))
        stem, k = first, 2
        while stem.lower() in taken:
            stem, k = f"{first}-{k}", k + 1
        taken.add(stem.lower())
        stems[name] = stem
    return stems


def safe_name(text: str) -> str:
    """``text`` as part of a file's name: other letters than plain ones become ``-``."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.") or "test"


def _render(part: Distribution, name: str, test: str, aperture: Aperture | None, issued: str) -> bytes:
    required = {"TEST": test, "TESTLAB": "simulation", "ISSUEDATE": issued or "unknown", "MANUFAC": "unknown"}
    assert set(required) == set(REQUIRED_KEYWORDS)
    keywords = {key: _ascii(value) for key, value in {**required, **part.keywords}.items()}
    keywords["_PART"] = {"sun": "sun", "sky": "sky without the sun", "total": "sun and sky"}[name]
    kept = Distribution(part.gamma_deg, part.c_deg, part.candela, keywords)
    opening = Opening()
    if aperture is not None and aperture.size_m is not None:
        opening = Opening(width_m=aperture.size_m[0], length_m=aperture.size_m[1])
    elif aperture is not None and aperture.diameter_m is not None:
        opening = Opening.disc(aperture.diameter_m)
    return render_lm63(
        closed_at_90(kept),
        generation=FileGeneration.SIMULATED,
        opening=opening,
        digits=_DIGITS,
        source=f"{test}, {name}",
    )


def _ascii(text: str) -> str:
    return text.encode("ascii", "replace").decode("ascii")
