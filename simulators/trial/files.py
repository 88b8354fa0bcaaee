"""Write cases and truths: small writers of our own for TOML, CSV, JSON and LM-63."""

import io
import json
import math
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import utc_text

Floats = NDArray[np.float64]
Toml = Mapping[str, object]
COLUMNS = "test,time,channel,gamma_deg,c_deg,measured,uncertainty,simulated,simulated_sun,simulated_sky"


class Raw(str):
    """A TOML value that is written as it stands (times)."""

    __slots__ = ()


def toml(document: Toml) -> str:
    """Write a document of plain values, tables, and arrays of tables."""
    document = {k: v for k, v in document.items() if v != []}
    plain = {k: v for k, v in document.items() if not _is_table(v) and not _is_tables(v)}
    lines = [f"{k} = {_value(v)}" for k, v in plain.items()]
    for name, table in document.items():
        if _is_table(table):
            assert isinstance(table, Mapping)
            lines += ["", f"[{name}]", *(f"{k} = {_value(v)}" for k, v in table.items())]
        elif _is_tables(table):
            assert isinstance(table, Sequence)
            for entry in table:
                lines += ["", f"[[{name}]]", *(f"{k} = {_value(v)}" for k, v in entry.items())]
    return "\n".join(lines) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _value(value: object) -> str:
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        text = f"{value:.10g}"
        return text if any(c in text for c in ".en") else text + ".0"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    raise TypeError(f"TOML has no place for {value!r}")


def _key(key: str) -> str:
    return key if key.replace("-", "").replace("_", "").isalnum() else json.dumps(key)


def number(value: float | None, digits: int = 7) -> str:
    """A number for a table; empty for none."""
    return "" if value is None or math.isnan(value) else f"{value:.{digits}g}"


def parts(sun: float, sky: float, digits: int = 7) -> tuple[str, str, str]:
    """Sum and parts as written, such that the written parts add up to the written sum."""
    a, b = number(sun, digits), number(sky, digits)
    return f"{float(a) + float(b):.{digits + 4}g}", a, b


def utc(utc_ns: int) -> Raw:
    """A TOML date and time."""
    return Raw(utc_text(utc_ns))


def ies(
    gammas_deg: Floats, planes_deg: Floats, candela: Floats, keywords: Mapping[str, str], round_: bool, size_m: Floats
) -> str:
    """Write an LM-63-2019 file, type C, absolute, file generation type 1.00010 (computer simulation).

    ``planes_deg`` (p,) runs from 0 to below 360 and is closed by repeating the first; ``candela`` is (p, g).
    """
    planes = np.append(planes_deg, 360.0)
    table = np.concatenate([candela, candela[:1]])
    width, length = (-size_m[0], -size_m[0]) if round_ else (size_m[0], size_m[1])
    out = io.StringIO()
    out.write("IES:LM-63-2019\r\n")
    for key, text in keywords.items():
        out.write(f"[{key}] {text}\r\n")
    out.write("TILT=NONE\r\n")
    out.write(f"1 -1 1 {len(gammas_deg)} {len(planes)} 1 2 {width:.4f} {length:.4f} 0\r\n")
    out.write("1 1.00010 0\r\n")
    for row in (gammas_deg, planes, *table):
        words = [f"{x:.6g}" for x in row]
        for start in range(0, len(words), 16):
            out.write(" ".join(words[start : start + 16]) + "\r\n")
    return out.getvalue()


def write_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Write files (paths relative to the folder) beside the folder's name, then rename: all or nothing."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(dir=folder.parent, prefix=".new-"))
    for name, text in files.items():
        path = made / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")
    made.chmod(0o755)
    if folder.exists():
        shutil.rmtree(folder)
    made.rename(folder)


def write_text(path: Path, text: str) -> None:
    """Write one file beside its name, then rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = path.with_name(f".{path.name}.{os.getpid()}")
    made.write_text(text, encoding="utf-8")
    made.replace(path)
