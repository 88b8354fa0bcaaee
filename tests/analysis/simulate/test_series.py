"""`labdaq simulate --series`: many moments, each as a prediction of its own would have it."""

import csv
import json
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from analysis.simulate.daylight import daylight
from analysis.simulate.predict import predict
from analysis.simulate.series import read_moments
from analysis.simulate.system import named
from analysis.sky.sun import GREENWOOD, sun_position
from labdaq.cli.simulate import command
from labdaq.clock import utc_ns_of, utc_text
from labdaq.errors import DataError, LabdaqError

OPEN = ["--set", "entry.kind=clear", "--set", "exit.kind=none"]
TABLE = """sun_altitude_deg,sun_azimuth_deg,global_lx,diffuse_lx,remark
31.17,85.57,45717,17343,a morning
55,200,20000,20000,no sun
-5,270,0,0,night
"""
HEAD = (
    "LOCATION,Greenwood,SC,USA,made,0,34.2176,-82.1084,-5.0,180.0\nDESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\n"
    "GROUND TEMPERATURES,0\nHOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,\nCOMMENTS 2,\n"
    "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n"
)
HOUR = (
    "2010,7,{day},{hour},60,?,25,15,50,99000,0,0,300,{whole},{normal},{diffuse},"
    "0,0,0,0,0,0,5,5,9999,99999,9,9,20,0,0,88,0,0,1\n"
)


ZONE = timezone(timedelta(hours=-5))


def an_hour(number: object, normal: object = 0, diffuse: float = 0, day: int = 22, whole: float = 0) -> str:
    """A line of a weather file: irradiances [W/m²]."""
    return HOUR.format(hour=number, normal=normal, diffuse=diffuse, day=day, whole=whole)


def simulate(*words: str) -> Result:
    return CliRunner().invoke(command, list(words))


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_moments_are_those_of_predictions(tmp_path: Path) -> None:
    """Sun within three of the stated uncertainties, sky within 2 %: patches of 12 degrees (docs/simulation.md)."""
    (tmp_path / "m.csv").write_text(TABLE)
    out = tmp_path / "out.csv"
    words = ["--series", str(tmp_path / "m.csv"), "--out", str(out), "--distance", "2.6", "--json"]
    done = simulate("box", *words, *OPEN)
    assert done.exit_code == 0, done.exception
    report = json.loads(done.output)
    assert (report["moments"], report["lit"], report["suns"]) == (3, 2, 1)
    rows = rows_of(out)
    system = named("box").with_settings({"entry.kind": "clear", "exit.kind": "none"})
    for row, day in zip(rows, ((31.17, 85.57, 45_717.0, 17_343.0), (55.0, 200.0, 20_000.0, 20_000.0)), strict=False):
        made = predict(system, daylight(*day), rays=100_000, distance_m=2.6)
        sun, sky = made.facts["sun"], made.facts["sky"]
        error = 3.0 * float(row["flux_uncertainty_lm"])
        assert float(row["flux_sun_lm"]) == pytest.approx(sun["out"] if sun else 0.0, abs=error)
        assert float(row["flux_sky_lm"]) == pytest.approx(sky["out"], rel=0.02)
        assert made.near is not None
        below = made.near.sky.candela[0, 0] / 2.6**2
        assert float(row["below_sky_lx"]) == pytest.approx(below, rel=0.1)
    assert float(rows[2]["flux_lm"]) == 0.0 and "time" not in rows[0]


def test_times_place_the_sun(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("time,global_lx,diffuse_lx\n2010-07-22T09:13:22-04:00,45717,17343\n")
    moments = read_moments(tmp_path / "m.csv", GREENWOOD)
    assert moments.times == ("2010-07-22T13:13:22.000Z",)
    assert moments.altitude_deg[0] == pytest.approx(31.198, abs=0.05)
    assert moments.beam_lx[0] == 45_717.0 - 17_343.0


def test_a_weather_file(tmp_path: Path) -> None:
    """Clear air at noon: some 105 lm/W of the beam, 130 of the blue sky (Perez 1990); the sun in mid hour."""
    path = tmp_path / "day.epw"
    light = {hour: (800, 120) if 7 <= hour <= 18 else (0, 0) for hour in range(1, 25)}
    path.write_text(HEAD + "".join(an_hour(h, n, d) for h, (n, d) in light.items()))
    moments = read_moments(path, GREENWOOD)
    assert moments.times[12] == "2010-07-22T17:30:00.000Z"
    up = np.sin(np.radians(moments.altitude_deg[12]))
    assert moments.altitude_deg[12] == pytest.approx(75.9, abs=0.3)
    assert 98.0 < moments.beam_lx[12] / (800 * up) < 112.0
    assert 115.0 < moments.diffuse_lx[12] / 120 < 145.0
    assert np.all(moments.beam_lx[[0, 1, 22, 23]] == 0.0)


@pytest.mark.parametrize(("stood_min", "put_min"), [(30, 30), (36, 30), (0, 0), (60, 60), (71, 71)])
def test_the_sun_stands_where_a_weather_file_had_it(tmp_path: Path, stood_min: int, put_min: int) -> None:
    """Seven real files had the sun 1, 30, 60 and 71 minutes into the hour; from 36 to 30 is not worth a note.

    Then the beam that is found is that of the file on the horizontal.
    """
    began = [datetime(2010, 7, 22 + day, hour, tzinfo=ZONE) for day in range(8) for hour in range(24)]
    stood = np.array([utc_ns_of(t + timedelta(minutes=stood_min)) for t in began])
    up = np.maximum(np.sin(np.radians(sun_position(stood, GREENWOOD).altitude_deg)), 0.0)
    lit = [(float(u), 700 if u > 0.0 else 0, 100 if u > 0.0 else 0) for u in up]
    text = "".join(an_hour(t.hour + 1, n, d, t.day, round(d + n * u)) for t, (u, n, d) in zip(began, lit, strict=True))
    (tmp_path / "m.epw").write_text(HEAD + text)
    moments = read_moments(tmp_path / "m.epw", GREENWOOD)
    assert moments.times[12] == utc_text(utc_ns_of(began[12] + timedelta(minutes=put_min)))
    assert [f"{put_min} minutes into" in note for note in moments.notes] == ([True] if put_min != 30 else [])
    if stood_min == put_min:
        assert np.array_equal(moments.altitude_deg > 0.0, up > 0.0)
        high = up > 0.5
        assert moments.beam_lx[high] / (700.0 * up[high]) == pytest.approx(101.0, abs=6.0)


def test_a_weather_file_that_contradicts_itself_is_read_as_the_format_has_it(tmp_path: Path) -> None:
    lit = [(hour, 800 if 7 <= hour <= 18 else 0) for hour in range(1, 25)]
    rows = "".join(an_hour(h, n, n / 8, d, n) for d in range(1, 30) for h, n in lit)
    (tmp_path / "m.epw").write_text(HEAD + rows)
    moments = read_moments(tmp_path / "m.epw", GREENWOOD)
    assert not moments.notes and moments.times[0] == "2010-07-01T05:30:00.000Z"


def test_a_place_may_be_written_in_one_byte_letters(tmp_path: Path) -> None:
    head = HEAD.replace("Greenwood", "K\u00f6ln").encode("latin-1")
    (tmp_path / "m.epw").write_bytes(head + an_hour(13, 800, 120).encode())
    assert read_moments(tmp_path / "m.epw", GREENWOOD).beam_lx[0] > 0.0


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("m.csv", "", "line 1: no column time and diffuse_lx"),
        ("m.csv", "time,diffuse_lx\n", "no moments"),
        ("m.csv", "time,diffuse_lx\nnoon,10\n2010-07-22,dark\n", "line 2: time.*noon.*line 3: diffuse_lx.*dark"),
        ("m.csv", "time,global_lx,diffuse_lx\n2010-07-22T03:00:00Z,9000,10\n", "2010-07-22T03.*a beam.*--site"),
        ("m.csv", TABLE + "3,4,10,20,\n", "line 5: global_lx"),
        ("m.csv", TABLE + "-3,4,20,10,\n", "line 5: sun_altitude_deg"),
        ("m.txt", TABLE, "ends in .csv or .epw"),
        ("m.epw", TABLE, "not an EPW"),
        ("m.epw", HEAD + an_hour(1, 9999, 0), "line 9: dni: .*9999"),
        ("m.epw", HEAD + 2 * an_hour(1, 0, 0), "hourly"),
        ("m.epw", HEAD + an_hour(1, "x", 0), "m.epw"),
        ("none.epw", None, "none.epw"),
        ("none.csv", None, "none.csv"),
    ],
)
def test_mistakes_in_tables_are_named(tmp_path: Path, name: str, text: str | None, says: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    done = simulate("box", "--series", str(tmp_path / name), "--out", str(tmp_path / "out.csv"))
    assert isinstance(done.exception, DataError)
    with pytest.raises(DataError, match=f"(?s){says}"):
        raise done.exception
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("hour", ["noon", "77", ""])
def test_a_weather_file_of_no_dates_is_refused_in_one_line(tmp_path: Path, hour: str) -> None:
    """pandas explains itself in many."""
    (tmp_path / "m.epw").write_text(HEAD + an_hour(hour, 0, 0))
    with pytest.raises(DataError, match=r"not an EPW file|line 9: no date and hour") as caught:
        read_moments(tmp_path / "m.epw", GREENWOOD)
    assert len(caught.value.message.splitlines()) == 1


@pytest.mark.parametrize("words", [["--diffuse", "1"], ["--parts"], ["--site", "1,2"], ["--out", "a.ies"]])
def test_what_the_table_tells_is_not_told_again(tmp_path: Path, words: list[str]) -> None:
    path = tmp_path / "m.epw"
    out = [] if "--out" in words else ["--out", str(tmp_path / "out.csv")]
    assert simulate("box", "--series", str(path), *out, *words).exit_code == 2


def test_a_map_is_of_one_moment(tmp_path: Path) -> None:
    done = simulate("box", "--series", "m.csv", "--out", str(tmp_path / "o.csv"), "--sky", "a.hdr")
    assert isinstance(done.exception, LabdaqError) and "one moment" in str(done.exception)
