"""IES LM-63 files: everything another module needs to read and write them.

::

    file = read_lm63("test-27.ies")
    file.distribution.flux(), file.oddities
    write_lm63("out.ies", distribution, generation=FileGeneration.MEASURED_INTERPOLATED)
"""

from analysis.photometry.lm63_model import Edition, FileGeneration, Lm63, Oddity, Opening, Table, Tilt
from analysis.photometry.lm63_read import parse_lm63, read_lm63
from analysis.photometry.lm63_write import render_lm63, write_lm63

__all__ = [
    "Edition",
    "FileGeneration",
    "Lm63",
    "Oddity",
    "Opening",
    "Table",
    "Tilt",
    "parse_lm63",
    "read_lm63",
    "render_lm63",
    "write_lm63",
]
