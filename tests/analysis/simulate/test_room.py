"""Light that the room sends to the sensors: conservation, figures of Radiance, and Radiance itself."""

import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from analysis.photometry import Distribution
from analysis.simulate.room import CELLS, Room, patches_of
from labdaq.directions import vector
from labdaq.errors import ConfigError

GAMMA = np.array([0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0])
SIZE = (5.486, 5.486, 5.486)
AREA = 0.6096**2


def lambertian() -> Distribution:
    gamma, c = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.0, 15.0)
    return Distribution.closed(gamma, c, np.tile(AREA * np.cos(np.radians(gamma)), (len(c), 1)))


def test_form_factors_close() -> None:
    patches = patches_of(SIZE)
    assert np.allclose(patches.factors.sum(axis=1), 1.0, atol=1e-12)  # a closed box: all light arrives somewhere
    areas = np.full(len(patches.middle), SIZE[0] * SIZE[1] / CELLS**2)
    far_apart = patches.surface[:, None] // 2 == patches.surface[None, :] // 2  # opposite faces
    exchange = areas[:, None] * patches.factors
    assert np.allclose(exchange[far_apart], exchange.T[far_apart], rtol=0.02)  # middles stand for patches


def test_all_flux_of_the_aperture_reaches_the_room() -> None:
    patches = patches_of(SIZE)
    received = float(patches.reach(lambertian()).sum()) * SIZE[0] * SIZE[1] / CELLS**2
    assert received == pytest.approx(math.pi * AREA, rel=1e-3)


def test_energy_of_many_bounces() -> None:
    """In a closed room of one reflectance the surfaces absorb what the aperture sends: Σ (1-ρ) E A = Φ."""
    direct = patches_of(SIZE).reach(lambertian())
    rho = 0.6
    exitance = Room(SIZE, wall=rho, floor=rho, ceiling=rho).exitance(direct)
    absorbed = (1.0 - rho) * exitance / rho
    assert float(absorbed.sum()) == pytest.approx(float(direct.sum()), rel=0.01)


@pytest.mark.parametrize(("rho", "error"), [(0.05, 0.01), (0.3, 0.05), (0.6, 0.08)])
def test_later_bounces_may_be_taken_by_four_patches_at_once(rho: float, error: float) -> None:
    """Each patch to a share, and the flux as exactly as form factors from patches' middles conserve it."""
    patches = patches_of(SIZE)
    direct = np.stack([patches.reach(lambertian()), np.maximum(0.0, patches.middle @ [0.3, 0.5, -0.8]) ** 4], axis=1)
    room = Room(SIZE, wall=rho, floor=rho / 2.0, ceiling=rho)
    exact, soon = room.exitance(direct), room.exitance_soon(direct)
    assert np.all(np.std(soon - exact, axis=0) < error * exact.mean(axis=0))
    assert soon.sum(axis=0) == pytest.approx(exact.sum(axis=0), rel=2e-3)


def test_figures_of_radiance() -> None:
    """Room light over direct light in per cent, rtrace -ab 4, a Lambertian aperture, walls .043, floor .015."""
    added = Room(SIZE, half_angle_deg=90.0).added(lambertian(), GAMMA, 22.5, 2.6, 0.3)
    percent = 100.0 * added / (AREA * np.cos(np.radians(GAMMA)))
    reference = {0.0: 0.33, 55.0: 0.54, 65.0: 0.73, 75.0: 1.2, 85.0: 3.5}
    for gamma, expected in reference.items():  # printed with two figures
        assert percent[list(GAMMA).index(gamma)] == pytest.approx(expected, rel=0.06)


def test_shields_and_black_walls() -> None:
    shielded, open_ = (Room(SIZE, half_angle_deg=a).added(lambertian(), GAMMA, 0.0, 2.6, 0.3) for a in (60.0, 90.0))
    assert np.all(shielded < open_) and np.all(shielded > 0.0)
    black = Room(SIZE, wall=0.0, floor=0.0, ceiling=0.0)
    assert not black.added(lambertian(), GAMMA, 0.0, 2.6).any()


def test_rooms_that_cannot_be() -> None:
    for wrong in ({"wall": 1.0}, {"floor": -0.1}, {"half_angle_deg": 0.0}, {"size_m": (0.0, 1.0, 1.0)}):
        with pytest.raises(ConfigError):
            Room(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="do not fit"):
        Room(SIZE).added(lambertian(), 85.0, 0.0, 3.0)


_TURN = ((1, 1), (1, -1), (-1, -1), (-1, 1))


def test_agrees_with_radiance_for_a_peaked_distribution(tmp_path: Path) -> None:
    """rtrace -ab 4 in the same room with a spot that follows cos^5, an .ies file turned by ies2rad into a light."""
    import pyradiance

    home = Path(pyradiance.__file__).parent
    environment = os.environ | {"PATH": f"{home / 'bin'}:{os.environ['PATH']}", "RAYPATH": f"{home / 'lib'}:."}

    def run(*command: str, data: str = "") -> str:
        return subprocess.run(
            command, input=data, capture_output=True, cwd=tmp_path, env=environment, text=True, check=True
        ).stdout

    wall, floor = 0.2, 0.1
    half = SIZE[0] / 2
    side = 0.6096 / 2
    # cos^5 of intensity is cos^4 of luminance: a brightness function on the aperture's polygon
    (tmp_path / "spot.cal").write_text("spot = if(-Dz, 1, 1) * abs(Dz)^4;\n")
    (tmp_path / "room.rad").write_text(
        f"void plastic wall 0 0 5 {wall} {wall} {wall} 0 0\nvoid plastic floor 0 0 5 {floor} {floor} {floor} 0 0\n"
        "void brightfunc beam 2 spot spot.cal 0 0\nbeam light lamp 0 0 3 1 1 1\n"
        f"lamp polygon aperture 0 0 12 {' '.join(f'{x * side} {y * side} -.0001' for x, y in _TURN)}\n"
        + "".join(
            f"{name} polygon s{k} 0 0 12 {' '.join(f'{v:.6f}' for p in points for v in p)}\n"
            for k, (name, points) in enumerate(_box(half, SIZE[2]))
        )
    )
    (tmp_path / "room.oct").write_bytes(
        subprocess.run(["oconv", "room.rad"], capture_output=True, cwd=tmp_path, env=environment, check=True).stdout
    )
    gammas = np.array([0.0, 35.0, 65.0, 85.0])
    toward = vector(gammas, 22.5)
    sensors = "\n".join(" ".join(f"{v:.6f}" for v in (*(2.6 * t), *(-t))) for t in toward)
    common = ("rtrace", "-I", "-h", "-ds", ".02", "-dj", "0", "-aa", "0", "-ad", "16384", "-lw", "1e-7", "-lr", "8")
    both, direct = (
        np.array([float(line.split()[0]) for line in run(*common, "-ab", ab, "room.oct", data=sensors).splitlines()])
        for ab in ("4", "0")
    )
    gamma, c = np.arange(0.0, 90.1, 2.5), np.arange(0.0, 360.0, 15.0)
    spot = Distribution.closed(gamma, c, np.tile(4 * side**2 * np.cos(np.radians(gamma)) ** 5, (len(c), 1)))
    room = Room(SIZE, wall=wall, floor=floor, ceiling=wall, half_angle_deg=90.0)
    added = room.added(spot, gammas, 22.5, 2.6, 0.0)
    # patches of 39 cm, and Radiance's own noise of some per cent
    assert np.allclose(added, (both - direct) * 2.6**2, rtol=0.08)


def _box(half: float, height: float) -> list[tuple[str, list[tuple[float, float, float]]]]:
    a, z = half, -height
    ring = [(-a, -a), (a, -a), (a, a), (-a, a)]
    walls = [
        ("wall", [(*p, z), (*q, z), (*q, 0.0), (*p, 0.0)][::-1]) for p, q in zip(ring, ring[1:] + ring[:1], strict=True)
    ]
    return [*walls, ("floor", [(*p, z) for p in ring]), ("wall", [(*p, 0.0) for p in ring[::-1]])]
