"""Haze that goes on forwards, as light that a lens scatters in part."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.cases.model import Floats
from analysis.explain.densities import densities
from analysis.explain.fields import C_DEG, GAMMA_DEG, solid_angle
from analysis.explain.geometry import blurred
from analysis.explain.scattering import SCATTERERS, partly
from analysis.explain.trace_settings import on_top, scatterer, settings_of
from analysis.simulate.changes import changed
from analysis.simulate.lens_shift import SIDE, cells
from analysis.simulate.system import SYSTEMS, System
from tests.analysis.explain.test_shift_lens import SKEWED, predicted, system_with


def flux(light: Floats) -> float:
    return float(np.sum(light * solid_angle()))


def light(seed: int) -> Floats:
    return np.random.default_rng(seed).random((2, len(C_DEG), len(GAMMA_DEG)))


@given(st.floats(0.0, 0.4), st.integers(0, 2**31), st.integers(1, 2), st.floats(0.1, 10.0))
def test_haze_takes_no_light(share: float, seed: int, lenses: int, bright: float) -> None:
    base, wholes = light(seed), [bright * light(seed + k + 1) for k in range(lenses)]
    assert flux(partly(base, wholes, share)) == pytest.approx(flux(base))


@given(st.floats(0.0, 1.0), st.integers(0, 2**31))
def test_light_of_one_lens_adds(share: float, seed: int) -> None:
    base, whole = light(seed), light(seed + 1)
    scattered = partly(base, [whole], 1.0)
    np.testing.assert_allclose(scattered, whole * flux(base) / flux(whole), rtol=1e-6, atol=1e-12)
    mixed = (1.0 - share) * base + share * scattered
    np.testing.assert_allclose(partly(base, [whole], share), mixed, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("kind", "places"), [("top", ["entry"]), ("box", ["entry", "exit"]), ("tube", ["exit"])])
def test_each_lens_is_made_one_that_scatters(kind: str, places: list[str]) -> None:
    """Of densities of shifts; supposed prisms are none, nor is the clear dome of a tube."""
    assert densities(SYSTEMS[kind]) == []
    system = system_with(kind, SKEWED)
    assert densities(system) == places
    settings = settings_of(system)
    for place in places:
        for scatters, (width, kept) in SCATTERERS.items():
            setting = scatterer(place, scatters)
            assert setting in settings and setting not in settings_of(SYSTEMS[kind])
            made = changed(system, on_top(system, dict(setting)))
            lens = getattr(made, place)
            assert (lens.kind, lens.kept) == ("shift", kept)
            assert rms_width(lens.shifts) == pytest.approx(width, rel=0.1)
            others = [p for p in ("entry", "exit") if p != place]
            plain = changed(system, {})
            assert all(getattr(made, p) == getattr(plain, p) for p in others)


def rms_width(shifts: tuple[float, ...]) -> float:
    density = np.array(shifts).reshape(SIDE, SIDE)
    return float(np.sqrt(np.sum(density * cells()[:, None] ** 2) / density.sum()))


@pytest.mark.timeout(300)  # where nothing is compiled yet, that takes most of it
def test_a_share_of_the_light_is_a_share_of_the_lens() -> None:
    """Whether light is mixed or the shifts of which a lens consists."""
    base = system_with("top", SKEWED)
    scattering = changed(base, on_top(base, dict(scatterer("entry", "forwards"))))
    own, wide = (np.array(s.entry.shifts) / np.sum(s.entry.shifts) for s in (base, scattering))
    share = 0.3
    mixed = System.with_settings(base, {"entry.shifts": tuple(((1.0 - share) * own + share * wide).tolist())})
    # few rays make a direction rough, and each lens draws its own
    seen, whole, both = (blurred(predicted(system), 8.0)[:, :, :30] for system in (base, scattering, mixed))
    added = (1.0 - share) * seen + share * whole
    floor = 0.05 * added.max(axis=(1, 2), keepdims=True)
    assert np.std(np.log((both + floor) / (added + floor))) < 0.1
    assert np.std(np.log((seen + floor) / (added + floor))) > 0.15
