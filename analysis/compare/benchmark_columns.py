"""The columns of a benchmark's tables, each with its unit: for README.txt, and as columns.csv for programs."""

import csv
import io
from collections.abc import Sequence
from fnmatch import fnmatch
from typing import Final

Column = tuple[str, str, str]
"""Name, unit, meaning. Names and files have the unit ``text``, moments ``UTC``, counts ``1``."""

COLUMNS: Final[dict[str, tuple[Column, ...]]] = {
    "columns.csv": (
        ("file", "text", "which tables; * stands for any name"),
        ("column", "text", "name of the column"),
        ("unit", "text", "its unit; text for names, UTC for moments (ISO 8601), 1 for numbers without"),
        ("meaning", "text", "what it holds"),
    ),
    "tests.csv": (
        ("test", "text", "name of the test"),
        ("source", "text", "folder of the case or session"),
        ("system", "text", "name of the skylight"),
        ("system_file", "text", "its description, relative to this folder"),
        ("start_utc", "UTC", "start of the test"),
        ("end_utc", "UTC", "its end"),
        ("sky", "text", "kind of sky, as the observers labelled it"),
        ("sun_altitude_deg", "deg", "altitude of the sun in the middle of the test"),
        ("sun_azimuth_deg", "deg", "its azimuth, from north through east"),
        ("global_illuminance_lx", "lx", "horizontal illuminance of sun and sky on the roof"),
        ("diffuse_illuminance_lx", "lx", "of the sky alone"),
        ("readings", "1", "number of usable readings"),
        ("measured_ies", "text", "file of the recorded intensities, relative to this folder"),
        ("simulated_sun_ies", "text", "file of the prediction's part due to the sun"),
        ("simulated_sky_ies", "text", "file of its part due to the rest of the sky"),
        ("simulated_total_ies", "text", "file of the whole prediction, where it is not in parts"),
        ("sky_hdr", "text", "file of the sky's luminance map"),
    ),
    "cases/*/records.csv": (
        ("test", "text", "name of the test"),
        ("time", "UTC", "middle of the integration"),
        ("channel", "text", "name; case.toml describes it, with the unit of its readings"),
        ("gamma_deg", "deg", "where the sensor was or looked"),
        ("c_deg", "deg", "the same"),
        ("measured", "the channel's", "the reading"),
        ("uncertainty", "the channel's", "standard uncertainty of the reading's noise alone"),
        ("simulated", "the channel's", "the prediction"),
        ("simulated_sun", "the channel's", "its part due to the sun"),
        ("simulated_sky", "the channel's", "its part due to the rest of the sky"),
    ),
    "sessions/*/readings.csv": (
        ("utc", "UTC", "middle of the integration"),
        ("mono_ns", "ns", "the same as a count that never jumps"),
        ("duration_s", "s", "length of the integration"),
        ("channel", "text", "what the reading is of"),
        ("quantity", "text", "what was read"),
        ("value", "the column unit's", "the reading, as the instrument gave it"),
        ("uncertainty", "the column unit's", "standard uncertainty of the value, calibration included"),
        ("unit", "text", "unit of value and uncertainty"),
        ("gamma_deg", "deg", "where the sensor was"),
        ("c_deg", "deg", "the same"),
        ("usable", "text", "whether the value may be used: yes or no"),
        ("flags", "text", "what is doubtful about it"),
        ("instrument", "text", "who read"),
        ("step", "text", "in which step of the test"),
    ),
    "sessions/*/exposures.csv": (
        ("utc", "UTC", "middle of the exposure"),
        ("mono_ns", "ns", "the same as a count that never jumps"),
        ("exposure_s", "s", "shutter time by the camera's account"),
        ("nominal_exposure_s", "s", "shutter time as set"),
        ("f_number", "1", "focal length over aperture, as the camera says"),
        ("iso", "1", "sensitivity, as the camera says"),
        ("file", "text", "the picture in the original session"),
        ("size", "byte", "its size"),
        ("sha256", "text", "its check sum"),
        ("instrument", "text", "which camera"),
        ("flags", "text", "what is doubtful about it"),
        ("step", "text", "in which step of the test"),
    ),
}
"""By file, in the order of the file."""


def there(file: str, names: Sequence[str]) -> bool:
    """Whether a file of `COLUMNS` is among the files of a benchmark."""
    return any(fnmatch(name, file) for name in names)


def columns_csv(names: Sequence[str]) -> bytes:
    """Content of columns.csv for a benchmark that holds ``names``: file (* is any name), column, unit, meaning."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(("file", "column", "unit", "meaning"))
    for file, columns in COLUMNS.items():
        if there(file, [*names, "columns.csv"]):
            writer.writerows((file, *column) for column in columns)
    return out.getvalue().encode()
