"""The skylight as data: cover, well, boot and lenses, read from TOML, a case, or one of three names.

Frame: the aperture (the exit, in the ceiling) lies in z = 0 and its centre is the origin; the well goes up to
z = ``well_depth_m``, where the cover stands on the same outline. x is east, y north, unless ``rotation_deg`` turns the
skylight. Dimensions of the three named systems follow the Greenwood field test (IES LM-81 style measurements of 2010);
what the report does not give (facet slope, blur, absorption) is a nominal value.
"""

import dataclasses
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, Self

from pydantic import TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass

from analysis.simulate.components import STRICT, Aperture, Lens, NotNegative, Positive, Wall
from analysis.simulate.obstruction import Obstruction
from labdaq.errors import ConfigError, Problems

_CLEAR: Final = Lens(kind="clear", absorption_per_mm=0.0)
_NONE: Final = Lens(kind="none")


@dataclass(frozen=True, config=STRICT)
class System:
    """One skylight. See the module's text for the frame.

    Attributes
    ----------
    rise_m
        Height of the cover above the well: a pyramid on a rectangle, a spherical cap on a disc; 0 is a flat sheet.
    entry, exit
        Lens of the cover (its facets, or the dome) and lens of the aperture.
    wall, boot, boot_height_m
        Wall of the well, and of its lowest ``boot_height_m``, if that is not 0.
    rotation_deg
        The whole skylight turned about the vertical, counter-clockwise seen from above.
    obstructions
        What stands around it, outside: black, and fixed to the site whatever ``rotation_deg``.
    """

    name: str = "skylight"
    kind: str = "box"
    aperture: Aperture = Aperture()
    well_depth_m: Positive = 0.61
    rise_m: NotNegative = 0.15
    entry: Lens = Lens()
    exit: Lens = _NONE
    wall: Wall = Wall()
    boot: Wall = Wall(reflectance=0.85, finish="diffuse")
    boot_height_m: NotNegative = 0.0
    rotation_deg: float = 0.0
    obstructions: tuple[Obstruction, ...] = ()

    @model_validator(mode="after")
    def _is_convex(self) -> Self:
        if self.aperture.shape == "disc" and self.rise_m > self.aperture.diameter_m / 2:
            raise ValueError("rise_m of a dome must not exceed its radius")
        if self.boot_height_m >= self.well_depth_m:
            raise ValueError("boot_height_m must be less than well_depth_m")
        return self

    @property
    def aperture_area_m2(self) -> float:
        """Area of the opening in the ceiling [m²]."""
        if self.aperture.shape == "disc":
            return math.pi * self.aperture.diameter_m**2 / 4
        return self.aperture.size_m[0] * self.aperture.size_m[1]

    def replace(self, **changes: Any) -> "System":
        """A copy with attributes changed; raises `ConfigError` for values that make no skylight."""
        return _checked({**_as_dict(self), **{k: _as_dict(v) for k, v in changes.items()}}, self.name)

    def with_settings(self, settings: Mapping[str, Any]) -> "System":
        """A copy with dotted settings changed, e.g. ``{"wall.reflectance": 0.9, "entry.orientation_deg": 45}``."""
        data = _as_dict(self)
        problems = Problems(f"system {self.name}")
        for key, value in settings.items():
            place: Any = data
            *path, last = key.split(".")
            for part in path:
                place = place.get(part) if isinstance(place, dict) else None
            if not isinstance(place, dict) or last not in place:
                problems.add(key, "no such setting")
                continue
            place[last] = _as_dict(value)
        problems.raise_if_any(ConfigError, "`labdaq simulate --list-settings` shows them all")
        return _checked(data, self.name)


def setting_names() -> list[str]:
    """All dotted names that `System.with_settings` and ``--set`` accept."""

    def walk(data: Mapping[str, Any], before: str) -> Iterable[str]:
        for key, value in data.items():
            if isinstance(value, dict):
                yield from walk(value, f"{before}{key}.")
            else:
                yield before + key

    return list(walk(_as_dict(System()), ""))


def parse_settings(pairs: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Read ``key=value`` words of a command line's option; values as in TOML, bare words as strings."""
    problems = Problems(option)
    settings: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key:
            problems.add(repr(pair), "is not key=value")
            continue
        try:
            settings[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            settings[key.strip()] = text.strip()
    problems.raise_if_any(ConfigError, f"write e.g. {option} wall.reflectance=0.9")
    return settings


def named(name: str) -> System:
    """The system ``top``, ``box`` or ``tube``; raises `ConfigError` for another name."""
    if name not in SYSTEMS:
        raise ConfigError(f"there is no system {name!r}", f"use {', '.join(SYSTEMS)}, or a TOML file")
    return SYSTEMS[name]


def load(path: Path) -> System:
    """Read a system from TOML; ``base = "box"`` starts from a named one. Raises `ConfigError` naming all mistakes."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}", f"use {', '.join(SYSTEMS)}, or a TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: {error}", "compare with the example in `labdaq simulate --help`") from error
    for place in ("entry", "exit"):
        lens = data.get(place)
        if isinstance(lens, dict) and isinstance(lens.get("bsdf"), str) and lens["bsdf"]:
            lens["bsdf"] = str(path.parent / lens["bsdf"])
            lens["kind"] = lens.get("kind", "bsdf")
            lens["prisms"] = lens.get("prisms", "down")  # whatever the base has: a file's front is outside
    base = named(str(data.pop("base"))) if "base" in data else System()
    return _checked(_merged(_as_dict(base), {"name": path.stem, **data}), str(path))


def find(text: str) -> System:
    """A system by name, or from the TOML file of that name."""
    return SYSTEMS[text] if text in SYSTEMS else load(Path(text))


def from_case_table(table: Mapping[str, Any]) -> System:
    """The system that a case's ``[[system]]`` table describes.

    ``kind`` chooses the named system to start from; ``aperture``, ``well_depth_m``, ``wall_reflectance``,
    ``wall_finish`` and ``lens`` override it. ``lens`` is the sheet of the system's prismatic positions: entry of a
    top, entry and exit of a box, exit of a tube. Further keys of `System` are taken as they are.
    Raises `ConfigError` naming all mistakes.
    """
    rest = dict(table)
    name = str(rest.pop("id", "system"))
    kind = str(rest.pop("kind", "box"))
    if kind not in SYSTEMS:
        raise ConfigError(f"system {name}: kind: {kind!r} is not one of {', '.join(SYSTEMS)}")
    data: dict[str, Any] = {"name": name}
    wall = {key: rest.pop(f"wall_{key}") for key in ("reflectance", "finish") if f"wall_{key}" in rest}
    if wall:
        data["wall"] = wall
    lens = rest.pop("lens", None)
    if lens is not None:
        for place in LENS_PLACES[kind]:
            data[place] = {"kind": lens}
    return _checked(_merged(_merged(_as_dict(SYSTEMS[kind]), data), rest), f"system {name}")


def _as_dict(value: Any) -> Any:
    """A dataclass, and those in it, as dicts; what is no dataclass, and so each density of shifts, is not copied."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    return {field.name: _as_dict(getattr(value, field.name)) for field in dataclasses.fields(value)}


def _merged(base: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if both else value
    return result


def _checked(data: Mapping[str, Any], source: str) -> System:
    try:
        return _ADAPTER.validate_python(dict(data))
    except ValidationError as error:
        problems = Problems(source)
        for mistake in error.errors():
            problems.add(".".join(str(part) for part in mistake["loc"]) or "values", mistake["msg"])
        problems.raise_if_any(ConfigError)
        raise


_ADAPTER: Final = TypeAdapter(System)

SYSTEMS: Final[dict[str, System]] = {
    "top": System(
        name="top", kind="top", well_depth_m=0.6096, wall=Wall(reflectance=0.85, finish="diffuse"), exit=_NONE
    ),
    "box": System(name="box", kind="box", well_depth_m=0.61, exit=Lens(prisms="up")),
    "tube": System(
        name="tube",
        kind="tube",
        aperture=Aperture(shape="disc", diameter_m=0.3556),
        well_depth_m=0.9144,
        rise_m=0.12,
        entry=_CLEAR,
        exit=Lens(prisms="up"),
        wall=Wall(reflectance=0.98),
        boot_height_m=0.08,
    ),
}
"""The three skylights by name."""

LENS_PLACES: Final[dict[str, tuple[str, ...]]] = {"top": ("entry",), "box": ("entry", "exit"), "tube": ("exit",)}
"""Where each kind carries its prismatic sheets."""
