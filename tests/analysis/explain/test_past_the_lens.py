"""Light that gets past the lens unbent: found as a law outside the catalogue, and located."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.answer import answer
from analysis.explain.mechanisms.base import Term, predict
from analysis.explain.mechanisms.past_the_lens import PastTheLens, lobe
from analysis.explain.mismatch import explain
from analysis.explain.scene import Scene
from tests.analysis.explain.campaign import TESTS, Floats, Rows, Sky, light, make_case

_LAW = PastTheLens()


def _through_a_crack(rows: Rows) -> Floats:
    """Light of a Gaussian spot, 5° wide (rms), where the sun's rays would go on: 3 cd for each klx of the beam."""
    gamma = 90.0 - rows.of_test(lambda t: t.sun[0])
    c = 180.0 - rows.of_test(lambda t: t.sun[1])
    one, other = np.radians(rows.gamma_deg), np.radians(gamma)
    cosine = np.cos(one) * np.cos(other) + np.sin(one) * np.sin(other) * np.cos(np.radians(rows.c_deg - c))
    away = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    beam = rows.of_test(lambda t: t.global_lx - t.diffuse_lx)
    return np.asarray(light(rows) + 0.06 * beam * np.exp(-0.5 * (away / 5.0) ** 2))


def _clear(tests: tuple[Sky, ...]) -> tuple[Sky, ...]:
    return tuple(t for t in tests if t.sky == "clear")


def test_light_through_a_crack_is_a_conjecture_and_located(tmp_path: Path) -> None:
    """Its law is told, with its width, and no name of the catalogue; where it shows, too."""
    found = answer(explain(make_case(tmp_path, _through_a_crack, tests=_clear(TESTS))))
    law = max((u for u in found["unnamed"] if "conjecture" in u), key=lambda u: float(u["nats"]))
    assert (law["along"], law["nats"] > 50.0) == ("light past the lens", True)
    assert found["verdict"] in {"unexplained", "partly-explained"}
    assert not found["mechanisms"]
    assert any("unbent" in m["statement"] for m in found["mismatch"])


@pytest.mark.parametrize(("width", "radius"), [(1.5, 0.0), (4.0, 0.0), (15.0, 0.0), (3.0, 22.0), (8.0, 50.0)])
def test_a_lobe_or_ring_holds_all_of_the_light(width: float, radius: float) -> None:
    """Its integral over the sphere is one: what is told is a share."""
    cosine = np.linspace(-1.0, 1.0, 200_001)
    shares = lobe(np.degrees(np.arccos(cosine)), width, radius)
    assert 2.0 * np.pi * np.trapezoid(shares, cosine) == pytest.approx(1.0, rel=1e-3)
    assert np.all(shares >= 0.0)


def test_it_adds_light_where_the_sun_would_shine_through_and_none_elsewhere(arm: Scene) -> None:
    assert _LAW.why_not(arm) == ""
    straight, ring = _LAW.branches(arm)
    r = arm.readings
    for branch, p, at in ((straight, [0.02, 4.0], 0.0), (ring, [0.02, 4.0, 30.0], 30.0)):
        term = Term(_LAW, branch, _LAW.parameters_in(arm, branch))
        added = predict(arm, (term,), np.array(p)) - predict(arm, (), np.zeros(0))
        look = np.radians(r.gamma_deg), np.radians(r.c_deg)
        sun = np.radians(90.0 - r.altitude_deg[r.test]), np.radians(180.0 - r.azimuth_deg[r.test])
        cosine = np.cos(look[0]) * np.cos(sun[0]) + np.sin(look[0]) * np.sin(sun[0]) * np.cos(look[1] - sun[1])
        away = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        near = np.abs(away - at) < 6.0
        assert np.all(added[near] > 0.0)
        assert np.max(added[np.abs(away - at) > 30.0]) < 1e-6 * np.max(added)
    none = Term(_LAW, straight, _LAW.parameters)
    assert predict(arm, (none,), np.array([0.0, 4.0])) == pytest.approx(predict(arm, (), np.zeros(0)))
