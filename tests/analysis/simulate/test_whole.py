"""The BSDF of a whole skylight is what the skylight does, to our tracer and to Radiance."""

from pathlib import Path

import numpy as np
import pytest

from analysis.bsdf.klems import KlemsBsdf
from analysis.bsdf.model import Component
from analysis.bsdf.tensor_tree import TensorTreeBsdf
from analysis.bsdf.xml_read import read_bsdf
from analysis.bsdf.xml_write import write_bsdf
from analysis.simulate.components import Lens, Wall
from analysis.simulate.daylight import Daylight, daylight
from analysis.simulate.predict import predict
from analysis.simulate.source import skies
from analysis.simulate.system import System, named
from analysis.simulate.tracer import Settings, trace
from analysis.simulate.whole import klems_of_system, tree_of_system

NONE = Lens(kind="none")
HOLE = System(name="hole", well_depth_m=1e-6, rise_m=0.0, entry=NONE, exit=NONE, wall=Wall(reflectance=0.0))
LEANING = named("box").replace(
    aperture={"size_m": (0.6, 0.3)}, rise_m=0.0, entry=NONE, exit=NONE, well_depth_m=0.4, rotation_deg=25.0
)
"""A mirror well that is not square and stands askew: no mirror image of it looks the same."""


def sheet(system: System, file: Path) -> System:
    """A hole of the same size with the file in it, front outside."""
    lens = Lens(kind="bsdf", bsdf=str(file), prisms="down")
    return HOLE.replace(aperture=system.aperture, well_depth_m=1e-3, entry=lens)


def low_light() -> Daylight:
    """A sky alone, much brighter in the south-east."""
    return daylight(25.0, 130.0, 15_000.0, 15_000.0, "cie:12")


def quarters(system: System, day: Daylight, engine: str = "tracer") -> tuple[float, np.ndarray]:
    """Flux [lm], and its shares in the four quarters of C."""
    gamma, c = np.arange(5.0, 90.0, 10.0), np.arange(5.0, 360.0, 10.0)
    grid = np.concatenate([c, [365.0]]) - 5.0
    # the tracer goes by its rays, Radiance by the precision in each of 324 directions that are summed
    around = {"gamma_deg": np.append(gamma, 90.0), "c_deg": grid}
    made = predict(system, day, engine=engine, precision=0.02, rays=400_000, threads=1, **around)
    candela = made.field("far").sky.candela[:-1, :-1] * np.sin(np.radians(gamma))
    flux = candela.sum() * np.radians(10.0) ** 2
    return float(flux), candela.reshape(4, 9, -1).sum(axis=(1, 2)) / candela.sum()


def test_a_hole_lets_every_direction_through() -> None:
    made = klems_of_system(HOLE, rays=2_000)
    through = made.matrices[Component.TF] * made.basis.projected[:, None]
    assert np.allclose(through.sum(axis=0), 1.0, atol=0.02)  # two samplings of the patches' edges
    assert np.diag(through).min() > 0.8 and np.diag(through).mean() > 0.9  # cells of 1.1 degrees reach over edges
    assert made.diffuse(Component.TF) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize(
    "name", ["top", pytest.param("box", marks=pytest.mark.slow), pytest.param("tube", marks=pytest.mark.slow)]
)
def test_diffuse_light_passes_as_through_the_skylight(name: str) -> None:
    system = named(name)
    made = klems_of_system(system, rays=4_000)
    flux, error = trace(system, skies([lambda v: np.ones(v.shape[:-1])]), Settings(rays=400_000)).flux()
    share = np.pi * system.aperture_area_m2
    assert made.diffuse(Component.TF) == pytest.approx(flux[0] / share, abs=4 * error[0] / share + 0.004)
    assert made.diffuse(Component.TB) == pytest.approx(made.diffuse(Component.TF), rel=1e-12)


@pytest.mark.parametrize("form", ["klems", pytest.param("tree", marks=pytest.mark.slow)])
def test_a_file_of_a_skylight_stands_for_it(form: str, tmp_path: Path) -> None:
    """Which way round it lies shows in the four quarters; patches of 10 degrees and cells of 7 blur them."""
    made: KlemsBsdf | TensorTreeBsdf
    made = klems_of_system(LEANING, rays=1_000) if form == "klems" else tree_of_system(LEANING, rays=4_000)
    write_bsdf(tmp_path / "whole.xml", made)
    assert read_bsdf(tmp_path / "whole.xml").bsdf.components() == (Component.TF, Component.TB)
    flux, shares = quarters(LEANING, low_light())
    assert shares.max() > 1.2 * shares.min()
    for engine in ("tracer", "radiance"):
        again, found = quarters(sheet(LEANING, tmp_path / "whole.xml"), low_light(), engine)
        assert again == pytest.approx(flux, rel=0.04), engine
        assert found == pytest.approx(shares, abs=0.02), engine


@pytest.mark.slow
def test_below_is_above_walked_backwards() -> None:
    """A skylight turned upside down: what the matrix says of light from below, traced from above."""
    flat = named("box").replace(rise_m=0.0, entry=Lens(prisms="down", slope_deg=20.0), exit=Lens(prisms="down"))
    turned = flat.replace(entry=Lens(prisms="up"), exit=Lens(prisms="up", slope_deg=20.0))
    told = klems_of_system(flat, rays=4_000).hemispherical_by_patch(Component.TB)
    seen = klems_of_system(turned, rays=4_000).hemispherical_by_patch(Component.TF)
    assert np.sqrt(np.mean((told - seen) ** 2)) < 0.02
    assert np.corrcoef(told, seen)[0, 1] > 0.99
