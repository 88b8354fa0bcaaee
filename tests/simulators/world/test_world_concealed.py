"""What is concealed shows in the readings as strongly as it should, and its truth stays where it belongs."""

import json
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labdaq.build import mount
from labdaq.clock import NS, utc_ns_of
from labdaq.config import parse
from labdaq.errors import DataError
from labdaq.headers import Order
from labdaq.runs import run
from labdaq.script import Script
from labdaq.station import Station
from labdaq.worlds import world_of
from simulators.cl200 import ChromaMeterOptions, Head, LevelHead
from simulators.goniophotometer import GoniophotometerOptions
from simulators.hidden.effects import Hidden
from simulators.world.concealed import MECHANISMS, Concealed, draw
from simulators.world.emulated import EmulatedWorld, WorldOptions

UP = np.array([0.0, 0.0, 1.0])
START_NS = utc_ns_of(datetime.fromisoformat("2010-07-22T14:24:20+00:00"))
QUICK = WorldOptions(effort=0.05)
SHOULD: tuple[float, float] = (0.015, 0.16)
"""One sun and one skylight; over a campaign the mean lies between 3 and 12 %."""


def scan(world: EmulatedWorld, options: GoniophotometerOptions) -> np.ndarray:
    """What the emulated arm's heads respond to, without noise (planes, heads) [lx]."""
    gamma = np.asarray(options.gammas_deg)
    rows = []
    for k in range(16):
        utc_ns = START_NS + 9 * k * NS
        g, c = options.arm(gamma, 22.5 * k, 1)
        near, far = (world.room_illuminance(np.abs(g), at, utc_ns) for at in (c, c + 180.0))
        seen = options.sensors(np.where(g < 0, far, near), g, c)
        rows.append(seen[list(options.wiring)] if options.wiring else seen)
    return np.array(rows)


@pytest.fixture(scope="module")
def sound() -> tuple[EmulatedWorld, np.ndarray]:
    world = EmulatedWorld(QUICK)
    return world, scan(world, GoniophotometerOptions())


def effect(concealed: Concealed, sound: tuple[EmulatedWorld, np.ndarray]) -> float:
    """Rms change of the readings relative to their mean, dim ones weighted down."""
    _, honest = sound
    world = EmulatedWorld(QUICK, concealed.hidden)
    with_it = scan(world, concealed.alter(None, GoniophotometerOptions()))
    change = (with_it - honest) / (0.5 * (np.abs(with_it) + np.abs(honest)) + 0.005 * honest.max())
    return float(np.sqrt(np.mean(change**2)))


def test_there_are_many_mechanisms_of_many_stages() -> None:
    assert len(MECHANISMS) >= 12
    assert len({m.stage for m in MECHANISMS.values()}) >= 6
    assert {draw(seed).mechanism for seed in range(300)} == set(MECHANISMS)


@pytest.mark.parametrize("mechanism", sorted(set(MECHANISMS) - {"sky-sun-ratio"}))
def test_it_changes_the_readings_as_much_as_it_should(mechanism: str, sound: tuple[EmulatedWorld, np.ndarray]) -> None:
    assert SHOULD[0] < effect(draw(5, ("box",), mechanism), sound) < SHOULD[1]


def test_the_shaded_meter_reads_another_share() -> None:
    concealed = draw(3, mechanism="sky-sun-ratio")
    world = EmulatedWorld(QUICK, concealed.hidden)
    options = ChromaMeterOptions(heads=(Head(0), Head(1, LevelHead(5.0))))
    honest, altered = (
        [sum(h.response.illuminance(world, START_NS)) for h in o.heads]
        for o in (options, concealed.alter(None, options))
    )
    assert altered[0] == honest[0]
    assert honest[1] / altered[1] == pytest.approx(1.0 + concealed.parameters["diffuse_shift"])
    assert abs(concealed.parameters["diffuse_shift"]) > 0.1


def test_nothing_concealed_changes_nothing(sound: tuple[EmulatedWorld, np.ndarray]) -> None:
    assert np.array_equal(scan(EmulatedWorld(QUICK, Hidden()), GoniophotometerOptions()), sound[1])


@pytest.mark.parametrize("mechanism", sorted(MECHANISMS))
def test_truths_are_json_and_come_back(mechanism: str, tmp_path: Path) -> None:
    concealed = draw(8, ("box", "tube"), mechanism)
    assert concealed == draw(8, ("box", "tube"), mechanism)
    concealed.write(tmp_path / "truth.json")
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert truth == concealed.truth()
    assert truth["mechanism"] == mechanism
    assert truth["parameters"].keys() == MECHANISMS[mechanism].units.keys()
    assert truth["sentence"].endswith(".") and "{" not in truth["sentence"]
    assert Concealed.read(tmp_path / "truth.json") == concealed
    assert list(tmp_path.iterdir()) == [tmp_path / "truth.json"]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda t: t | {"format": "other/1"},
        lambda t: t | {"mechanism": "gremlins"},
        lambda t: t | {"parameters": {}},
        lambda t: {"format": t["format"]},
        lambda t: [1, 2],
    ],
)
def test_other_files_are_refused(spoil: Any, tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(spoil(draw(1).truth())))
    with pytest.raises(DataError, match=r"truth\.json: not a concealed effect"):
        Concealed.read(path)


SCRIPT = """
test = "t"
system = "box"
[exposures]
times_s = [0.25]
period_s = 5.0
[scan]
c_planes_deg = [0, 90]
period_s = 8.0
"""


def test_nothing_of_the_truth_enters_a_session(tmp_path: Path) -> None:
    """Byte for byte: no name, no sentence, no number of it in any file."""
    concealed = replace(draw(2, mechanism="c-offset"), parameters={"offset_deg": 7.123456})
    station = Station.built_in()
    order = Order(station, parse(SCRIPT, Script, "script"), tmp_path)
    values = []
    for hidden in (None, concealed):
        world = world_of(station, hidden)
        world.tracing.effort = 0.05
        alter = hidden.alter if hidden else None
        (path,) = run(order, partial(mount, world=world, alter=alter), virtual=True)
        written = b"".join(p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file())
        for secret in ("c-offset", "conceal", "hidden", "7.1234", "offset_deg"):
            assert secret.encode() not in written
        values.append(sorted(p.relative_to(path).as_posix() for p in path.rglob("*")))
    assert values[0] == values[1]
