"""The dark room against Radiance's numbers, conservation, and what a shield must do; the arm's geometry."""

import numpy as np
import pytest

from labdaq.directions import angle_between, vector
from simulators.hidden.arm import ArmFaults, sensors
from simulators.hidden.maps import COARSE, Field
from simulators.hidden.room import Panel, Room, _first_light, _patches

GAMMAS = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0])
PLANES = np.arange(16) * 22.5
EVEN = Field(np.ones((3, COARSE, COARSE)))
"""An aperture of 1 cd by Lambert's law."""


def _excess(room: Room) -> np.ndarray:
    """Light by way of the room over light straight from the aperture, mean over planes (10,)."""
    here = sensors(GAMMAS, PLANES, 2.6, ArmFaults())
    added = room.added(EVEN, here.places, here.aims)
    direct = EVEN.intensity(here.directions) / here.distances**2
    return (added / direct).reshape(16, 10).mean(axis=0)


def test_the_room_is_radiances() -> None:
    # rtrace -ab 4, cosine sensors without shields: radiance.md section 2 (all .04) and inference.md (.043, floor .015)
    everywhere = _excess(Room(walls=0.04, floor=0.04, ceiling=0.04, half_angle_deg=90.0))
    assert everywhere[[0, 7, 8, 9]] == pytest.approx([0.0030, 0.0069, 0.0107, 0.037], rel=0.13)
    report = _excess(Room(walls=0.043, floor=0.015, ceiling=0.043, half_angle_deg=90.0))
    assert report[[0, 6, 7, 8, 9]] == pytest.approx([0.0033, 0.0054, 0.0073, 0.012, 0.035], rel=0.06)


def test_no_light_is_made_in_a_room() -> None:
    room = Room(walls=0.5, floor=0.3, ceiling=0.6)
    patches = _patches(room.size_m)
    arriving = float(_first_light(patches, EVEN) @ patches.area)
    assert arriving == pytest.approx(np.pi, rel=2e-3)  # all of the aperture's flux lands somewhere
    exitance = room.exitance(EVEN)
    reflectance = room._reflectances(patches)
    absorbed = float((exitance / reflectance * (1.0 - reflectance)) @ patches.area)
    assert absorbed == pytest.approx(arriving, rel=1e-2)


def test_a_sensor_sees_the_room_once() -> None:
    here = sensors(GAMMAS, PLANES, 2.6, ArmFaults())
    open_ = Room(half_angle_deg=90.0).seen(here.places, here.aims).sum(axis=1)
    # at gamma 85 a sensor is 0.2 m from ceiling and wall: parts of patches of 0.12 m lose 1.5 %
    assert open_ == pytest.approx(np.ones(160), abs=0.02)
    shielded = Room(half_angle_deg=60.0).seen(here.places, here.aims).sum(axis=1)
    assert shielded == pytest.approx(np.full(160, 0.75), abs=0.015)  # sin² 60°


def test_transfer_is_the_same_sum() -> None:
    here = sensors(GAMMAS, PLANES[:3], 2.6, ArmFaults())
    room = Room(walls=0.2, floor=0.1, ceiling=0.2, panel=Panel(60.0, 90.0, 20.0, 0.8))
    direct = room.transfer(room.seen(here.places, here.aims)) @ room.first_exitance(EVEN)
    assert direct == pytest.approx(room.added(EVEN, here.places, here.aims), rel=1e-9)
    assert Room().added(EVEN, here.places, here.aims) == pytest.approx(0.0)


def test_a_panel_shines_on_the_side_that_faces_it() -> None:
    here = sensors(np.array([65.0]), np.array([90.0, 270.0]), 2.6, ArmFaults())
    room = Room(panel=Panel(70.0, 90.0, 25.0, 0.9))
    beside, opposite = room.added(EVEN, here.places, here.aims)
    assert opposite > 2.0 * beside  # sensors look away from the wall behind them, through the aperture's centre


def test_a_true_arm_is_where_it_says() -> None:
    here = sensors(GAMMAS, PLANES, 2.6, ArmFaults())
    expected = vector(GAMMAS[None, :], PLANES[:, None]).reshape(-1, 3)
    assert here.directions == pytest.approx(expected, abs=1e-12)
    assert here.distances == pytest.approx(np.full(160, 2.6))
    assert here.incidence == pytest.approx(np.ones(160))


def test_each_fault_moves_the_sensors_as_it_should() -> None:
    true = sensors(GAMMAS, PLANES, 2.6, ArmFaults())

    def moved(**faults: object) -> np.ndarray:
        return sensors(GAMMAS, PLANES, 2.6, ArmFaults(**faults)).directions  # type: ignore[arg-type]

    assert angle_between(moved(gamma_offset_deg=1.5), true.directions) == pytest.approx(np.full(160, 1.5))
    sagged = angle_between(moved(sag_deg=2.0), true.directions).reshape(16, 10)[0]
    assert sagged == pytest.approx(2.0 * np.sin(np.radians(GAMMAS)))
    assert moved(c_offset_deg=22.5).reshape(16, 10, 3)[0] == pytest.approx(true.directions.reshape(16, 10, 3)[1])
    assert moved(mirrored=True).reshape(16, 10, 3)[1] == pytest.approx(true.directions.reshape(16, 10, 3)[15])
    swapped = moved(swapped=(2, 7)).reshape(16, 10, 3)
    assert swapped[:, 2] == pytest.approx(true.directions.reshape(16, 10, 3)[:, 7])
    lag = angle_between(moved(backlash_deg=3.0), true.directions).reshape(16, 10)
    assert lag[:, 9] == pytest.approx(np.full(16, 3.0 * np.sin(np.radians(85.0))), abs=0.01)
    shifted = sensors(GAMMAS, PLANES, 2.6, ArmFaults(aperture_shift_m=(0.0, 0.0, -0.1)))
    assert shifted.distances[0] == pytest.approx(2.5)  # the aperture hangs lower: nadir is nearer
    drooped = sensors(GAMMAS, PLANES, 2.6, ArmFaults(aim_droop=0.5)).incidence.reshape(16, 10)[0]
    assert drooped == pytest.approx(np.cos(np.radians(0.5 * GAMMAS)))
