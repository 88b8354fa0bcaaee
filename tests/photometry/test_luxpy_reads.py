"""What luxpy makes of the LM-63 and EULUMDAT files we write (Smet 2020, doi:10.1080/15502724.2018.1518717).

luxpy 1.12 cannot be imported beside numpy 2.4 or later; with `numpy<2.4` and luxpy installed these tests run.
"""

import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from analysis.photometry import Distribution
from analysis.photometry.eulumdat_write import write_eulumdat
from analysis.photometry.lm63 import Edition, FileGeneration, write_lm63
from tests.photometry.lamps import KEYWORDS, lopsided


@pytest.fixture(scope="module")
def luxpy() -> ModuleType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            from luxpy.toolboxes import iolidfiles
        except (ImportError, TypeError) as error:
            pytest.skip(f"luxpy is not installed, or too old for this numpy: {error}")
    return iolidfiles  # type: ignore[no-any-return]


def quadrants() -> Distribution:
    """Alike in the four quadrants, so that a file may hold one of them."""
    gamma, c = np.linspace(0.0, 90.0, 10), np.arange(16) * 22.5
    oval = 1 + 0.3 * np.cos(2 * np.radians(c))[:, None] * np.sin(np.radians(gamma)) ** 2
    d = Distribution.closed(gamma, c, 500 * np.cos(np.radians(gamma)) * oval)
    return Distribution(d.gamma_deg, d.c_deg, d.candela, KEYWORDS)


def same(theirs: dict[str, np.ndarray], d: Distribution) -> None:
    """Their map of the whole sphere is ours below, and dark above."""
    assert theirs["thetas"][: d.gamma_deg.size] == pytest.approx(d.gamma_deg)
    assert theirs["phis"] == pytest.approx(d.c_deg)
    assert theirs["values"][:, : d.gamma_deg.size] == pytest.approx(d.candela, rel=1e-6, abs=1e-4)
    assert not np.any(theirs["values"][:, d.gamma_deg.size :])


@pytest.mark.parametrize("edition", [Edition.E2002, Edition.E2019])
@pytest.mark.parametrize("d", [lopsided(), quadrants()], ids=["lopsided", "quadrants"])
def test_luxpy_reads_our_lm63(luxpy: ModuleType, tmp_path: Path, d: Distribution, edition: Edition) -> None:
    path = tmp_path / "lamp.ies"
    write_lm63(path, d, generation=FileGeneration.MEASURED_INTERPOLATED, edition=edition)
    theirs = luxpy.read_lamp_data(str(path), normalize=None)
    same(theirs["map"], d)
    assert theirs["lumens_per_lamp"] == -1
    assert theirs["photometric_type"] == 1


@pytest.mark.parametrize("d", [lopsided(), quadrants()], ids=["lopsided", "quadrants"])
def test_luxpy_reads_our_eulumdat(luxpy: ModuleType, tmp_path: Path, d: Distribution) -> None:
    path = tmp_path / "lamp.ldt"
    write_eulumdat(path, d)
    theirs = luxpy.read_lamp_data(str(path), normalize=None)
    same({**theirs["map"], "values": theirs["map"]["values"] * theirs["tflux"] / 1000}, d)


@pytest.mark.parametrize("name", ["lamp.ies", "lamp.ldt"])
def test_luxpy_finds_the_same_flux(luxpy: ModuleType, tmp_path: Path, name: str) -> None:
    """Its rule of solid angles on steps of 10° and 22.5° against our exact integral of the same surface."""
    d, path = quadrants(), tmp_path / name
    if name.endswith("ies"):
        write_lm63(path, d, generation=FileGeneration.MEASURED_INTERPOLATED)
    else:
        write_eulumdat(path, d)
    theirs = luxpy.read_lamp_data(str(path), normalize=None)
    per = 1.0 if name.endswith("ies") else theirs["tflux"] / 1000
    flux = luxpy.luminous_intensity_to_luminous_flux(
        theirs["map"]["phis"], theirs["map"]["thetas"], theirs["map"]["values"] * per
    )
    assert float(np.squeeze(flux)) == pytest.approx(d.flux(), rel=0.02)
