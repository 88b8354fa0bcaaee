"""Scattering as somebody measured or fitted it: ABg parameters in TOML, tables of E2387 or relative intensity as CSV.

The columns are described in docs/bsdf.md. Lines of a CSV file that start with ``#`` are comments.
"""

import csv
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analysis.bsdf.harvey import AbgBsdf, AbgLobe
from analysis.bsdf.model import Component, Floats
from analysis.bsdf.relative import RelativeBsdf, RelativeTable
from analysis.bsdf.tabulated import ScatterTable, TabulatedBsdf, mirrored_phi
from labdaq.errors import DataError, LabdaqError, Problems

Made = TypeVar("Made")
Described = AbgBsdf | TabulatedBsdf | RelativeBsdf

E2387_COLUMNS: Final = ("component", "theta_i_deg", "phi_i_deg", "theta_s_deg", "phi_s_deg", "bsdf_per_sr")
RELATIVE_COLUMNS: Final = ("component", "theta_i_deg", "theta_m_deg", "phi_m_deg", "intensity", "hemispherical")

_KEYS: Final = {component.key: component for component in Component}

_Numbers = float | Annotated[list[float], Field(min_length=1)]


class _Lobe(BaseModel):
    """One component of an ABg file."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    a: _Numbers
    b: _Numbers
    g: _Numbers
    theta_deg: _Numbers = 0.0
    across: _Numbers = 1.0
    specular: _Numbers = 0.0
    hemispherical: _Numbers | None = None


def read_scatter(path: Path | str, *, both_sides: bool = False) -> Described:
    """Read a description of scattering.

    Parameters
    ----------
    path
        ``.toml``: ABg parameters. ``.csv``: a table; its columns tell of which kind.
    both_sides
        The sample looks alike from both sides: what the file tells of the front alone holds for the back.

    Raises
    ------
    DataError
        With file, line or field, and what is wrong there.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
    found: Described = _abg(text, path) if path.suffix.lower() == ".toml" else _table(text, path)
    return _alike(found) if both_sides else found


def _alike(bsdf: Described) -> Described:
    """The same with the front's components at the back, where it has none of its own."""
    if isinstance(bsdf, AbgBsdf):
        return AbgBsdf(_at_both(bsdf.lobes))
    if isinstance(bsdf, TabulatedBsdf):
        return TabulatedBsdf(_at_both(bsdf.tables))
    return RelativeBsdf(_at_both(bsdf.tables))


def _at_both(parts: Mapping[Component, Made]) -> dict[Component, Made]:
    pairs = ((Component.TF, Component.TB), (Component.RF, Component.RB))
    return dict(parts) | {back: parts[front] for front, back in pairs if front in parts and back not in parts}


def _abg(text: str, path: Path) -> AbgBsdf:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: {error}") from error
    problems, lobes = Problems(str(path)), {}
    for key, table in data.items():
        if key not in _KEYS or not isinstance(table, dict):
            problems.add(key, f"is none of the tables [{'], ['.join(_KEYS)}]")
            continue
        try:
            lobes[_KEYS[key]] = _lobe(_Lobe.model_validate(table))
        except ValidationError as error:
            for mistake in error.errors():
                problems.add(f"{key}.{mistake['loc'][0]}", mistake["msg"])
        except LabdaqError as error:
            problems.add(key, error.message)
    if not data:
        problems.add("tables", f"there are none; [{'], ['.join(_KEYS)}] are known")
    problems.raise_if_any(DataError, "docs/bsdf.md shows such a file")
    return AbgBsdf(lobes)


def _lobe(given: _Lobe) -> AbgLobe:
    """The lobe; where hemispherical values are given, A follows from them."""
    angles = np.atleast_1d(np.asarray(given.theta_deg, dtype=np.float64))
    fields = {name: getattr(given, name) for name in ("a", "b", "g", "across", "specular")}
    wrong = [name for name, value in fields.items() if np.size(value) not in (1, angles.size)]
    if given.hemispherical is not None and np.size(given.hemispherical) not in (1, angles.size):
        wrong.append("hemispherical")
    if wrong:
        raise DataError(f"{', '.join(wrong)}: one number, or one for each of the {angles.size} of theta_deg")
    lobe = AbgLobe.of(theta_deg=angles, **fields)
    if given.hemispherical is not None:
        whole = np.broadcast_to(np.asarray(given.hemispherical, dtype=np.float64), angles.shape)
        if ((whole > 1.0) | (whole < lobe.specular)).any():
            raise DataError("hemispherical: lies between the specular part and 1")
        sine = np.sin(np.radians(angles))
        bsdf = AbgBsdf({Component.RF: lobe})
        now = bsdf.hemispherical(Component.RF, np.stack([sine, np.zeros(sine.size)], axis=-1)) - lobe.specular
        if (now <= 0.0).any():
            raise DataError("a: must be positive where hemispherical values are given")
        lobe = AbgLobe.of(theta_deg=angles, **(fields | {"a": lobe.a * (whole - lobe.specular) / now}))
    return lobe


def _table(text: str, path: Path) -> TabulatedBsdf | RelativeBsdf:
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(line for _, line in lines))
    names = tuple(word.strip() for word in rows[0]) if rows else ()
    for columns in (E2387_COLUMNS, RELATIVE_COLUMNS):
        if sorted(names) == sorted(columns):
            numbered = [(lines[k][0], dict(zip(names, row, strict=False))) for k, row in enumerate(rows) if k]
            by_component = _numbers(path, columns, numbered)
            if columns is E2387_COLUMNS:
                return TabulatedBsdf({c: _e2387(path, c, values) for c, values in by_component.items()})
            return RelativeBsdf({c: _relative(path, c, values) for c, values in by_component.items()})
    raise DataError(
        f"{path}: line {lines[0][0] if lines else 1}: the columns are {', '.join(names) or 'none'}",
        f"{', '.join(E2387_COLUMNS)}; or {', '.join(RELATIVE_COLUMNS)}",
    )


def _numbers(path: Path, columns: tuple[str, ...], rows: list[tuple[int, dict[str, str]]]) -> dict[Component, Floats]:
    """The numbers of each component's rows, shape (n, 6): the columns but the first, and the line."""
    problems, found = Problems(str(path)), dict[Component, list[list[float]]]()
    for line, row in rows:
        component = _KEYS.get(row["component"].strip().lower().replace(" ", "-"))
        if component is None:
            problems.add(f"line {line}: component", f"{row['component']!r} is none of {', '.join(_KEYS)}")
            continue
        values = []
        for name in columns[1:]:
            try:
                values.append(float(row[name]))
            except (KeyError, ValueError):
                problems.add(f"line {line}: {name}", f"{row.get(name, '')!r} is not a number")
                break
        else:
            if not all(np.isfinite(values)):
                problems.add(f"line {line}", "a number is not finite")
            found.setdefault(component, []).append([*values, float(line)])
    if not rows:
        problems.add("rows", "there are none")
    problems.found = problems.found[:12]
    problems.raise_if_any(DataError)
    return {component: np.array(lines) for component, lines in found.items()}


def _grid(path: Path, component: Component, keys: Floats, values: Floats, line: Floats) -> tuple[list[Floats], Floats]:
    """Axes, and values on their grid, of rows in any order; refuses gaps and doubles."""
    axes, places = [], []
    for column in keys.T:
        axis, place = np.unique(column, return_inverse=True)
        axes.append(axis)
        places.append(place.reshape(-1))
    shape = tuple(len(axis) for axis in axes)
    flat = np.ravel_multi_index(tuple(places), shape)
    count = np.bincount(flat, minlength=int(np.prod(shape)))
    if count.max() > 1:
        twice = np.flatnonzero(flat == count.argmax())
        raise DataError(f"{path}: lines {line[twice[0]]:.0f} and {line[twice[1]]:.0f}: {component}, the same angles")
    if count.min() == 0:
        gap = [f"{axis[k]:g}" for axis, k in zip(axes, np.unravel_index(int(count.argmin()), shape), strict=True)]
        raise DataError(
            f"{path}: {component}: there is no row for the angles {', '.join(gap)}",
            "tables are grids: every combination of their angles stands there once",
        )
    grid = np.empty(flat.size)
    grid[flat] = values
    return axes, grid.reshape(shape)


def _e2387(path: Path, component: Component, rows: Floats) -> ScatterTable:
    rows = rows.copy()
    if component.transmits:  # E2387 measures theta_s from the lit side's normal
        rows[:, 2] = 180.0 - rows[:, 2]
    wrong = np.flatnonzero((rows[:, 2] < 0.0) | (rows[:, 2] > 90.0))
    if wrong.size:
        span = "90 to 180 degrees in transmission" if component.transmits else "0 to 90 degrees in reflection"
        raise DataError(f"{path}: line {rows[wrong[0], 5]:.0f}: theta_s_deg: lies within {span}, as in E2387")
    (theta_i, phi_i, theta_s, phi_s), values = _grid(path, component, rows[:, :4], rows[:, 4], rows[:, 5])
    if phi_i.size == 1 and phi_i[0] in (0.0, 180.0) and phi_s[0] == 0.0 and phi_s[-1] == 180.0:
        phi_s, values = mirrored_phi(phi_s, values, axis=3)
    return _said(path, component, lambda: ScatterTable(theta_i, phi_i, theta_s, phi_s, values))


def _relative(path: Path, component: Component, rows: Floats) -> RelativeTable:
    (theta_i, theta_m, phi_m), values = _grid(path, component, rows[:, :3], rows[:, 3], rows[:, 5])
    first = np.searchsorted(theta_i, rows[:, 0])
    sphere = np.zeros(theta_i.size)
    sphere[first] = rows[:, 4]
    odd = np.flatnonzero(sphere[first] != rows[:, 4])
    if odd.size:
        raise DataError(
            f"{path}: line {rows[odd[0], 5]:.0f}: hemispherical: {rows[odd[0], 4]:g}, where another row of "
            f"{rows[odd[0], 0]:g} degrees of incidence says {sphere[first[odd[0]]]:g}"
        )
    return _said(path, component, lambda: RelativeTable(theta_i, theta_m, phi_m, values, sphere))


def _said(path: Path, component: Component, make: Callable[[], Made]) -> Made:
    """What ``make()`` makes; its complaints name the file."""
    try:
        return make()
    except DataError as error:
        raise DataError(f"{path}: {component}: {error.message}", error.hint) from error
