"""A case on its way to disk."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from analysis.cases import Case, Records, write_case
from analysis.cases.model import CaseFile


@dataclass(frozen=True)
class Draft:
    """A case that is complete but not written.

    Attributes
    ----------
    files
        Content by name relative to the case's folder.
    notes
        What was left out or assumed while it was made, one sentence each.
    """

    setup: CaseFile
    records: Records
    files: Mapping[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def write(self, folder: str | Path, *, replace: bool = False) -> Case:
        """Write it, whole or not at all; see `analysis.cases.write_case` for the errors."""
        return write_case(folder, self.setup, self.records, files=self.files, replace=replace)
