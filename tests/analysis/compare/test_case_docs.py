"""docs/cases.md shows files that are read as it says."""

import re
import tomllib
from pathlib import Path

from analysis.cases.model import CaseFile
from analysis.cases.read import COLUMNS
from analysis.compare.listing import Listing, Rival
from analysis.compare.recipe import Recipe
from labdaq.config import check

DOCS = Path(__file__).parents[3] / "docs" / "cases.md"


def test_the_examples_are_read() -> None:
    text = DOCS.read_text(encoding="utf-8")
    case, recipe, listing = (tomllib.loads(block) for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL))
    setup = CaseFile.model_validate(case)
    assert setup.variant[0].simulated["T18"].names
    assert not setup.model_extra or set(setup.model_extra) == {"rival"}
    Rival.model_validate(case["rival"][0])
    assert check(recipe, Recipe, "docs").table[0].unpivot is not None
    listing["variant"], listing["rival"] = [], []  # shown as headings only
    assert check(listing, Listing, "docs").test[0].id == "T18"
    assert ",".join(COLUMNS) in text
