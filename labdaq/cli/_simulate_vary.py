"""``labdaq simulate --vary``: what is varied, and where it goes."""

import re
from pathlib import Path
from typing import Any, Final

from labdaq.errors import ConfigError, Problems

EXAMPLE: Final = "write e.g. --vary dull:wall.reflectance=0.85 or --vary turned:rotation_deg=45,isotropic=true"

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def parse_varied(words: tuple[str, ...]) -> list[Any]:
    """The changes that ``NAME:setting=value[,setting=value]`` words tell. Raises one `ConfigError` for all mistakes."""
    from analysis.simulate.changes import Change
    from analysis.simulate.system import parse_settings

    problems = Problems("--vary")
    found: dict[str, Any] = {}
    for word in words:
        name, colon, rest = word.partition(":")
        if not colon or not _NAME.fullmatch(name) or not rest:
            problems.add(repr(word), "is not NAME:setting=value; a name has letters, digits, dots, dashes, underscores")
        elif re.search(r"(^|-)(sun|sky)$", name):
            problems.add(name, "names that end in sun or sky are those of parts")
        elif name in found:
            problems.add(name, "is there twice")
        else:  # a comma within a value, as of a list, is not followed by another setting
            found[name] = Change(name, parse_settings(re.split(r",(?=[\w.]+=)", rest), "--vary"))
    problems.raise_if_any(ConfigError, EXAMPLE)
    return list(found.values())


def file_of(out: Path, name: str) -> Path:
    """Where a variant goes: ``FILE-NAME.ies`` beside ``FILE.ies``."""
    return out.with_name(f"{out.stem}-{name}{out.suffix}")


def told(made: Any, field: Any, files: list[Path]) -> dict[str, Any]:
    """What the report says of a variant."""
    seen = made.field(field)
    return {
        "name": made.facts["variant"],
        "setting": made.facts["setting"],
        "files": [str(path) for path in files],
        "traced": made.facts["traced"],
        "flux_lm": seen.total.flux(),
        "flux_sun_lm": seen.sun.flux(),
        "flux_sky_lm": seen.sky.flux(),
        "uncertainty": seen.worst_relative(),
    }


def in_words(variant: dict[str, Any], baseline_lm: float) -> str:
    """A line about a variant for who reads along."""
    change = 100.0 * (variant["flux_lm"] / baseline_lm - 1.0) if baseline_lm > 0.0 else 0.0
    how = "traced again" if variant["traced"] else "from the baseline's tallies"
    return f"{', '.join(variant['files'])}\n  {variant['flux_lm']:.4g} lm ({change:+.2f} %), {how}"
