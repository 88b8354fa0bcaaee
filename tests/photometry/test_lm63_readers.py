"""What other programs make of the LM-63 files we write."""

import os
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest

from analysis.photometry.goniometry import PhotometricType, type_vector
from analysis.photometry.lm63 import Edition, FileGeneration, Opening, parse_lm63, render_lm63, write_lm63
from labdaq.directions import gamma_c, vector
from tests.photometry.lamps import lopsided

pyradiance = pytest.importorskip("pyradiance", reason="pyradiance is not installed")
RADIANCE = Path(pyradiance.__file__).parent


def radiance(*command: str, folder: Path, data: str = "") -> bytes:
    environment = os.environ | {
        "PATH": f"{RADIANCE / 'bin'}:{os.environ['PATH']}",
        "RAYPATH": f"{RADIANCE / 'lib'}:.",
    }
    done = subprocess.run(command, cwd=folder, input=data.encode(), capture_output=True, check=True, env=environment)
    return done.stdout


def radiance_candela(folder: Path, rays: np.ndarray) -> np.ndarray:
    """Intensities [cd] of lamp.ies in ``folder`` along unit vectors (n, 3), through ies2rad and rtrace."""
    radiance("ies2rad", "-dm", "-i", "0.001", "lamp.ies", folder=folder)
    # ies2rad puts C = 0 on +x; our C = 0 is north, +y
    (folder / "scene.rad").write_text("!xform -rz 90 lamp.rad\n")
    (folder / "scene.oct").write_bytes(radiance("oconv", "scene.rad", folder=folder))
    lines = "".join(f"{x * 10} {y * 10} {z * 10} {-x} {-y} {-z}\n" for x, y, z in rays)
    out = radiance("rtrace", "-h", "-I", "-ab", "0", "-dj", "0", "-ds", "0", "scene.oct", folder=folder, data=lines)
    rgb = np.array([[float(v) for v in line.split()[:3]] for line in out.decode().splitlines()])
    return 179.0 * rgb @ [0.265, 0.670, 0.065] * 100.0


@pytest.mark.parametrize("edition", [Edition.E2002, Edition.E2019])
def test_radiance_sees_the_same_intensities_in_the_same_places(tmp_path: Path, edition: Edition) -> None:
    d = lopsided()
    write_lm63(
        tmp_path / "lamp.ies", d, generation=FileGeneration.MEASURED_INTERPOLATED, edition=edition,
        opening=Opening.disc(0.01),
    )  # fmt: skip
    gamma, c = (a.ravel() for a in np.meshgrid([0.0, 12, 40, 70, 84], [0.0, 45, 100, 222, 340]))
    # source.cal and rtrace work in single precision; the illum sphere is a point at 10 m
    assert radiance_candela(tmp_path, vector(gamma, c)) == pytest.approx(d.at(gamma, c), rel=2e-4)


def test_radiance_turns_type_b_as_we_do(tmp_path: Path) -> None:
    """Along the two principal planes, where ies2rad's projected type B angles are the true ones."""
    v = h = np.arange(-90, 91, 10.0)
    table = 100 + v[None, :] + 0.5 * h[:, None]
    rows = "\r\n".join(" ".join(f"{x:g}" for x in row) for row in table)
    angles = " ".join(f"{x:g}" for x in v)
    lines = ["IESNA:LM-63-2002", "[TEST] 1", "TILT=NONE", f"1 -1 1 {v.size} {h.size} 2 2 0 0 0", "1 1 0"]
    (tmp_path / "lamp.ies").write_bytes("\r\n".join([*lines, angles, angles, rows, ""]).encode())
    ours = parse_lm63((tmp_path / "lamp.ies").read_bytes()).distribution
    steps = np.array([-60.0, -35, 20, 50])
    kind = PhotometricType.B
    rays = np.concatenate([type_vector(kind, steps, 0 * steps), type_vector(kind, 0 * steps, steps)])
    theirs = radiance_candela(tmp_path, rays)
    assert theirs == pytest.approx(np.concatenate([100 + steps, 100 + 0.5 * steps]), rel=2e-3)
    # ours passed a 10 degree type C grid on the way: a table linear in its angles bends on it by at most 2 cd
    assert np.abs(ours.at(*gamma_c(rays)) - theirs).max() < 2


def test_photompy_reads_the_same(tmp_path: Path) -> None:
    photompy = pytest.importorskip("photompy", reason="photompy is not installed")
    d = lopsided()
    path = tmp_path / "lamp.ies"
    write_lm63(path, d, generation=FileGeneration.MEASURED_INTERPOLATED)
    theirs = photompy.IESFile.read(path)
    assert theirs.photometry.thetas == pytest.approx(d.gamma_deg)
    assert theirs.photometry.phis == pytest.approx(d.c_deg)
    assert theirs.photometry.values == pytest.approx(d.candela, rel=1e-6, abs=1e-4)
    # its band rule against our exact integral of the same surface, on 5 and 10 degree steps: half a percent
    assert theirs.photometry.total_optical_power() == pytest.approx(d.flux(), rel=5e-3)
    assert theirs.header.keywords["TESTLAB"] == "Greenwood"
    assert theirs.header.lumens_per_lamp == -1


def test_photompy_writes_what_we_read(tmp_path: Path) -> None:
    photompy = pytest.importorskip("photompy", reason="photompy is not installed")
    d = lopsided()
    path = tmp_path / "lamp.ies"
    write_lm63(path, d, generation=FileGeneration.MEASURED_INTERPOLATED)
    photompy.IESFile.read(path).write(tmp_path / "theirs.ies")
    back = parse_lm63((tmp_path / "theirs.ies").read_bytes())
    assert back.distribution.candela == pytest.approx(d.candela, rel=1e-5, abs=1e-3)


def test_eulumdat_ies_converts_ours(tmp_path: Path) -> None:
    converter = pytest.importorskip("eulumdat_ies", reason="eulumdat-ies is not installed")
    d = lopsided()
    text = render_lm63(d, generation=FileGeneration.MEASURED_INTERPOLATED, edition=Edition.E2002).decode("ascii")
    path = tmp_path / "lamp.ies"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says that -1 lumens become 1000
        ldt = converter.ies_to_ldt(path)
    candela = np.array(ldt.intensities)  # it sets 1000 lm, so that cd per 1000 lm are cd
    assert ldt.header.lamp_flux == [1000.0]
    assert candela[: len(d.c_deg) - 1] == pytest.approx(d.candela[:-1], rel=1e-6, abs=1e-2)
