"""A list of tests to compare: which .ies files or tables of readings belong together (docs/cases.md)."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from analysis.cases.model import Goniometer, Room, Simulation, Site, System
from analysis.cases.model import Test as CaseTest
from analysis.compare.named_systems import NAMED_SYSTEMS
from labdaq.config import NotNegative, Table, load


class Noise(Table):
    """Standard uncertainty of the noise of one reading: a share of the reading [%], and an amount [cd]."""

    percent: NotNegative = 1.0
    cd: NotNegative = 0.0


class Files(Table):
    """Files of a predicted distribution: ``sun`` and ``sky``, or ``total``; relative to the list."""

    sun: str | None = None
    sky: str | None = None
    total: str | None = None

    @model_validator(mode="after")
    def _are_enough(self) -> Self:
        if (self.sun is None) != (self.sky is None) or (self.sun is None) == (self.total is None):
            raise ValueError("give sun and sky, or total")
        return self

    def paths(self, folder: Path) -> dict[str, Path]:
        """The files by part."""
        given = {"sun": self.sun, "sky": self.sky, "total": self.total}
        return {part: folder / name for part, name in given.items() if name is not None}


class ListedTest(CaseTest):
    """A test as in a case, and its files; what a measured .ies says about the test itself need not be said again."""

    measured: str
    simulated: Files  # type: ignore[assignment]

    def facts(self) -> dict[str, Any]:
        """What was given about the test, without the files."""
        facts: dict[str, Any] = self.model_dump(
            exclude={"measured", "simulated"}, exclude_unset=True, exclude_none=True
        )
        return facts


class ListedVariant(Table):
    """The same simulation with one thing changed (`analysis.cases.Variant`)."""

    mechanism: str
    setting: dict[str, Any] = Field(default={})
    simulated: dict[str, Files]


class Rival(Table):
    """Another simulation of the same tests, shown beside the first one in reports; not used by explanations."""

    name: Annotated[str, Field(min_length=1)]
    simulated: dict[str, Files]


class Listing(Table):
    """A whole list."""

    described_in = "docs/cases.md"

    format: Literal["labdaq-comparison/1"]
    title: str = ""
    noise: Noise = Noise()
    site: Site | None = None
    room: Room | None = None
    goniometer: Goniometer | None = None
    simulation: Simulation = Simulation()
    system: tuple[System, ...] = ()
    test: Annotated[tuple[ListedTest, ...], Field(min_length=1)]
    variant: tuple[ListedVariant, ...] = ()
    rival: tuple[Rival, ...] = ()

    @model_validator(mode="after")
    def _names_fit(self) -> Self:
        ids = [t.id for t in self.test]
        found = [f"test '{i}' is given twice" for i in sorted(set(ids)) if ids.count(i) > 1]
        named = [("variant", v.mechanism, v.simulated) for v in self.variant]
        named += [("rival", r.name, r.simulated) for r in self.rival]
        for kind, name, simulated in named:
            found += [f"{kind} '{name}': there is no test '{i}'" for i in simulated if i not in ids]
        names = [r.name for r in self.rival]
        found += [f"rival '{n}' is given twice" for n in sorted(set(names)) if names.count(n) > 1]
        if found:
            raise ValueError("\n".join(found))
        return self

    def systems(self) -> list[dict[str, Any]]:
        """The systems as given, and the report's three where a test names one that is not given."""
        known = {s.id: s for s in self.system}
        for test in self.test:
            if test.system in NAMED_SYSTEMS and test.system not in known:
                known[test.system] = NAMED_SYSTEMS[test.system]
        return [s.model_dump(exclude_unset=True, exclude_none=True) for s in known.values()]


def read_listing(path: Path) -> Listing:
    """Read a list; raises `ConfigError` with all its mistakes."""
    return load(path, Listing)
