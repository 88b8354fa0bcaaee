"""Whether angles and line breaks of an LM-63 file make sense."""

from collections.abc import Iterator

import numpy as np

from analysis.photometry.goniometry import PhotometricType
from analysis.photometry.lm63_numbers import Numbers

_RANGE = {PhotometricType.C: (0.0, 180.0), PhotometricType.B: (-90.0, 90.0), PhotometricType.A: (-90.0, 90.0)}
_FIRST = {PhotometricType.C: (0.0, 90.0), PhotometricType.B: (-90.0, 0.0), PhotometricType.A: (-90.0, 0.0)}
_LAST = {PhotometricType.C: (90.0, 180.0), PhotometricType.B: (90.0,), PhotometricType.A: (90.0,)}


def check_angles(numbers: Numbers, kind: PhotometricType, first_v: int, first_h: int, first_cd: int) -> Iterator[str]:
    """Refuse angles that do not increase or leave the sphere; yield remarks about incomplete ones.

    ``first_v``, ``first_h`` and ``first_cd`` are the indices of the first vertical angle, horizontal angle and candela.
    """
    for start, end, name in ((first_v, first_h, "vertical"), (first_h, first_cd, "horizontal")):
        fallen = np.flatnonzero(np.diff(numbers.values[start:end]) <= 0)
        if fallen.size:
            bad = start + int(fallen[0]) + 1
            before, here = numbers.token(bad - 1), numbers.token(bad)
            raise numbers.error(bad, f"the {name} angles do not increase ({here} after {before})")
    vertical = numbers.values[first_v:first_h]
    low, high = _RANGE[kind]
    if vertical[0] < low or vertical[-1] > high:
        place = first_v if vertical[0] < low else first_h - 1
        raise numbers.error(
            place, f"a type {kind.name} vertical angle of {numbers.token(place)} is outside {low:g}..{high:g}"
        )
    if vertical[0] not in _FIRST[kind]:
        yield f"the vertical angles start at {vertical[0]:g}; the light below that is missing"
    if vertical[-1] not in _LAST[kind]:
        yield f"the vertical angles end at {vertical[-1]:g}; the light beyond that is missing"


def check_layout(numbers: Numbers, at: int, n_v: int, n_h: int) -> Iterator[tuple[int, str]]:
    """Yield (index, remark) where a record does not start on a new line.

    Raises
    ------
    DataError
        Most candela planes start on a new line but some do not: then a value is missing in one plane and another
        stands doubled in the next, and the count alone would not show it.
    """
    starts = numbers.starts
    line_starts = np.unique(starts[:-1])
    heads = {at: "the lamp record", at + 10: "the ballast record", at + 13: "the vertical angles"}
    heads[at + 13 + n_v] = "the horizontal angles"
    for index, name in heads.items():
        if index not in line_starts:
            yield index, f"{name} do(es) not start on a new line"
    first = at + 13 + n_v + n_h
    planes = first + n_v * np.arange(n_h)
    on_new_line = np.isin(planes, line_starts)
    if on_new_line.all():
        return
    bad = int(np.flatnonzero(~on_new_line)[0])
    if on_new_line.sum() > n_h / 2 and n_h > 2:
        raise numbers.error(
            int(planes[bad]),
            f"the candelas of horizontal angle {numbers.values[first - n_h + bad]:g} do not start on a new line, as "
            "most others do: a value is missing or doubled before here",
        )
    yield int(planes[bad]), "candela planes do not start on new lines"
