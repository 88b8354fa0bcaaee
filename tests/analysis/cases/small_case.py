"""A small good case, as text, to be spoilt in one place."""

from pathlib import Path

import numpy as np

from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, render_lm63

CASE = """
format = "labdaq-case/1"
title = "small"

[site]
latitude_deg = 34.2176
longitude_deg = -82.1084

[goniometer]
distance_m = 2.6

[[system]]
id = "box"
kind = "box"
aperture = { shape = "rectangle", size_m = [0.6096, 0.6096] }

[[channel]]
id = "gonio.g45"
kind = "goniometer"
quantity = "luminous_intensity"
unit = "cd"

[[channel]]
id = "roof"
kind = "illuminance-meter"
quantity = "illuminance"
unit = "fc"

[[test]]
id = "T1"
system = "box"
start = 2010-07-22T13:12:00Z
end = 2010-07-22T13:14:45Z
simulated = { sun = "simulated/sun.ies", sky = "simulated/sky.ies" }

[[test]]
id = "T2"
"""

RECORDS = """\
test,time,channel,gamma_deg,c_deg,measured,uncertainty,simulated,simulated_sun,simulated_sky
T1,2010-07-22T13:12:10.5Z,gonio.g45,45,22.5,1000,3,990,600,390
T1,2010-07-22T13:12:20Z,gonio.g45,45,45,,,980,580,400
T2,,roof,,,8000,20,7900,,
"""


def flat(candela: float = 100.0) -> Distribution:
    keywords = {"TEST": "x", "TESTLAB": "x", "ISSUEDATE": "x", "MANUFAC": "x"}
    values = np.full((5, 3), candela)
    return Distribution(np.array([0.0, 45.0, 90.0]), np.array([0.0, 90, 180, 270, 360]), values, keywords)


def ies(candela: float = 100.0) -> bytes:
    return render_lm63(flat(candela), generation=FileGeneration.SIMULATED)


def small_case(folder: Path, *, case: str = CASE, records: str = RECORDS) -> Path:
    (folder / "simulated").mkdir(parents=True, exist_ok=True)
    for part in ("sun", "sky"):
        (folder / "simulated" / f"{part}.ies").write_bytes(ies())
    (folder / "case.toml").write_text(case, encoding="utf-8")
    (folder / "records.csv").write_text(records, encoding="utf-8")
    return folder
