"""Recipes: how the columns of somebody's table become a case (docs/cases.md describes each field)."""

from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self
from zoneinfo import ZoneInfo

from pydantic import BeforeValidator, Field, model_validator

from analysis.cases.model import Channel, Goniometer, Room, Simulation, Site, System
from analysis.cases.units import conversion
from analysis.compare.expression import Expression
from analysis.compare.template import Template
from labdaq.config import Table, load
from labdaq.errors import ConfigError

SKIES: Final = ("clear", "partly-cloudy", "overcast")


class Amount(Table):
    """A number from a row: an expression, and its unit (without one, the unit of what it fills)."""

    value: Expression
    unit: str | None = None


def _as_amount(given: object) -> object:
    return given if isinstance(given, dict | Amount) else {"value": given}


def _as_list(given: object) -> object:
    return given if isinstance(given, list | tuple) else (given,)


AnAmount = Annotated[Amount, BeforeValidator(_as_amount)]
FirstKnown = Annotated[tuple[AnAmount, ...], BeforeValidator(_as_list), Field(min_length=1)]
"""One amount, or several of which the first that is not missing counts."""
Parts = Annotated[tuple[AnAmount, ...], BeforeValidator(_as_list), Field(min_length=1)]
"""Independent parts of a standard uncertainty: the root of the sum of their squares counts."""


class Label(Table):
    """A word from a row: a template, looked up in ``words`` where there are any."""

    text: Template
    words: dict[str, str] = Field(default={})


ALabel = Annotated[Label, BeforeValidator(lambda given: given if isinstance(given, dict | Label) else {"text": given})]


class Skip(Table):
    """Rows to leave out: those whose ``column`` is ``empty``, or holds one of the words in ``is``."""

    column: str
    empty: bool = False
    words: Annotated[tuple[str, ...], Field(alias="is")] = ()

    @model_validator(mode="after")
    def _says_which(self) -> Self:
        if self.empty == bool(self.words):
            raise ValueError("give either empty = true or is = [words]")
        return self


class Unpivot(Table):
    """Columns such as ``Set 1_CLTC_fc`` hold several rows side by side.

    ``columns`` is a template that their names fit (``Set {set}_{meter}_fc``); each original row becomes one for each
    different filling of it, in which ``spread`` (``meter``) gives the names of the columns and the others (``set``)
    are columns of words.
    """

    columns: Template
    spread: str

    @model_validator(mode="after")
    def _spread_is_one_of_them(self) -> Self:
        if self.spread not in self.columns.columns:
            raise ValueError(f"spread must be one of the names in braces: {', '.join(self.columns.columns)}")
        if self.columns.text.count("{") != len(self.columns.columns):
            raise ValueError("each name may stand in the braces once")
        return self


class Times(Table):
    """How texts become times: ISO 8601 unless a ``format`` (as of strptime) is given; ``zone`` for those without."""

    format: str | None = None
    zone: str | None = None

    @model_validator(mode="after")
    def _zone_is_known(self) -> Self:
        if self.zone is not None:
            try:
                ZoneInfo(self.zone)
            except (ValueError, OSError, KeyError):
                raise ValueError(f"there is no time zone {self.zone!r}; write e.g. America/New_York, or UTC") from None
        return self


class TestFacts(Table):
    """What a row says about its test; rows of one test must agree."""

    __test__ = False  # not a test for pytest

    id: Template
    system: ALabel | None = None
    start: Template | None = None
    end: Template | None = None
    sky: ALabel | None = None
    sun_altitude_deg: FirstKnown | None = None
    sun_azimuth_deg: FirstKnown | None = None
    global_illuminance: FirstKnown | None = None
    diffuse_illuminance: FirstKnown | None = None

    @model_validator(mode="after")
    def _fit(self) -> Self:
        for name in ("global_illuminance", "diffuse_illuminance"):
            for amount in getattr(self, name) or ():
                if amount.unit is not None and conversion(amount.unit, "lx") is None:
                    raise ValueError(f"{name}: '{amount.unit}' is not a unit of illuminance")
        for name in ("sun_altitude_deg", "sun_azimuth_deg"):
            if any(a.unit not in (None, "deg") for a in getattr(self, name) or ()):
                raise ValueError(f"{name} is in deg")
        odd = [word for word in (self.sky.words.values() if self.sky else ()) if word not in SKIES]
        if odd:
            raise ValueError(f"sky: '{odd[0]}' is not one of {', '.join(SKIES)}")
        return self

    def amounts(self) -> dict[str, tuple[Amount, ...]]:
        """The numbers that are given, by the name they have in a case."""
        names = {"global_illuminance": "global_illuminance_lx", "diffuse_illuminance": "diffuse_illuminance_lx"}
        fields = ("sun_altitude_deg", "sun_azimuth_deg", *names)
        return {names.get(f, f): getattr(self, f) for f in fields if getattr(self, f) is not None}


class Record(Table):
    """One compared reading of a row; numbers without a unit are in ``unit``, by default the channel's."""

    channel: str
    unit: str | None = None
    time: Template | None = None
    gamma_deg: FirstKnown | None = None
    c_deg: FirstKnown | None = None
    measured: FirstKnown | None = None
    uncertainty: Parts | None = None
    simulated: FirstKnown
    simulated_sun: FirstKnown | None = None
    simulated_sky: FirstKnown | None = None

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        if (self.measured is None) != (self.uncertainty is None):
            raise ValueError("measured and uncertainty go together")
        if (self.simulated_sun is None) != (self.simulated_sky is None):
            raise ValueError("simulated_sun and simulated_sky go together")
        return self

    def amounts(self) -> dict[str, tuple[Amount, ...]]:
        """The numbers that are given, by column of records.csv, without the uncertainty."""
        fields = ("gamma_deg", "c_deg", "measured", "simulated", "simulated_sun", "simulated_sky")
        return {f: getattr(self, f) for f in fields if getattr(self, f) is not None}


class TableOf(Table):
    """One kind of table: how it is recognised and read, and what its rows mean."""

    name: str
    columns: Annotated[tuple[str, ...], Field(min_length=1)] = ()
    optional: bool = False
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] = ","
    decimal: Literal[".", ","] = "."
    lines_before_header: Annotated[int, Field(ge=0)] = 0
    missing: tuple[str, ...] = ()
    skip: tuple[Skip, ...] = ()
    unpivot: Unpivot | None = None
    time: Times = Times()
    test: TestFacts
    record: Annotated[tuple[Record, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _can_be_recognised(self) -> Self:
        if not self.columns and self.unpivot is None:
            raise ValueError("give the columns by which such a file is recognised, or an unpivot")
        return self

    def columns_used(self) -> list[str]:
        """All columns that skipping, test and records name (after the unpivot, where there is one)."""
        words: list[Template | None] = [self.test.id, self.test.start, self.test.end, *(r.time for r in self.record)]
        words += [label.text for label in (self.test.system, self.test.sky) if label is not None]
        amounts = chain(
            self.test.amounts().values(),
            *(chain(r.amounts().values(), [r.uncertainty or ()]) for r in self.record),
        )
        names = [s.column for s in self.skip]
        names += [column for text in words if text is not None for column in text.columns]
        names += [column for amount in chain.from_iterable(amounts) for column in amount.value.columns]
        return list(dict.fromkeys(names))


class Recipe(Table):
    """A whole recipe; site, room, goniometer, simulation, systems and channels are those of a case."""

    described_in = "docs/cases.md"

    format: Literal["labdaq-recipe/1"]
    title: str = ""
    site: Site | None = None
    room: Room | None = None
    goniometer: Goniometer | None = None
    simulation: Simulation | None = None
    system: tuple[System, ...] = ()
    channel: Annotated[tuple[Channel, ...], Field(min_length=1)]
    table: Annotated[tuple[TableOf, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        units = {c.id: c.unit for c in self.channel}
        found = [f"channel '{i}' is given twice" for i in units if [c.id for c in self.channel].count(i) > 1]
        for table in self.table:
            for record in table.record:
                where = f"table '{table.name}', record of '{record.channel}'"
                if record.channel not in units:
                    found.append(f"{where}: there is no such channel; there are {', '.join(units)}")
                    continue
                for unit in _units_of(record):
                    if conversion(unit, units[record.channel]) is None:
                        found.append(f"{where}: '{unit}' cannot be turned into {units[record.channel]}")
        if found:
            raise ValueError("\n".join(found))
        return self

    def facts(self) -> dict[str, Any]:
        """The set-up of the case as far as the recipe gives it, as plain values."""
        keep = {"title", "site", "room", "goniometer", "simulation", "system", "channel"}
        facts: dict[str, Any] = self.model_dump(include=keep, exclude_unset=True, exclude_none=True)
        return facts


def _units_of(record: Record) -> set[str]:
    amounts = [a for name, several in record.amounts().items() if not name.endswith("_deg") for a in several]
    units = {a.unit for a in (*amounts, *(record.uncertainty or ()))} | {record.unit}
    return {unit for unit in units if unit is not None}


def find_recipe(name: str) -> Recipe:
    """A recipe from a file; a bare name that is no file is looked for among the recipes that come with labdaq.

    Raises `ConfigError` listing all mistakes of the recipe.
    """
    path = Path(name)
    if not path.is_file() and not path.suffix and len(path.parts) == 1:
        shipped = Path(str(files("analysis.compare").joinpath("recipes")))
        path = shipped / f"{name}.toml"
        if not path.is_file():
            known = ", ".join(sorted(p.stem for p in shipped.glob("*.toml")))
            raise ConfigError(f"{name}: there is no such file, and no such recipe; recipes are {known}")
    return load(path, Recipe)
