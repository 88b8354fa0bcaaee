"""What a further mechanism promises beside others, before both are fitted together."""

from pathlib import Path

import numpy as np
import pytest

from analysis.explain.fit import MIDDLE, Fitter
from analysis.explain.mechanisms.catalogue import BY_ID
from analysis.explain.mechanisms.states import terms_of
from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from tests.analysis.explain.roof import roof_case
from tests.analysis.explain.test_mechanisms import acted


@pytest.mark.parametrize(
    ("first", "second"), [("nonlinearity", "meter-gain"), ("dark-offset", "meter-gain"), ("meter-gain", "dark-offset")]
)
def test_a_first_mechanism_gives_back_what_it_took_of_the_second(
    roof: Scene, tmp_path: Path, first: str, second: str
) -> None:
    """Alone it takes both; held where it was fitted, it would leave the other nothing to explain."""
    names = {m: terms_of(BY_ID[m], roof)[0] for m in (first, second)}
    read = roof.readings.simulated.copy()
    for name, term in names.items():
        size = 0.06 if name == "meter-gain" else term.parameters[0].starts[-1]
        read *= acted(roof, name, term.branch.label, *(size for _ in term.parameters)) / roof.readings.simulated
    case = roof_case(tmp_path / "case", {"velux": read[:22], "konica": read[22:]})
    fitter = Fitter(Scene(Readings.of(case)))
    one, other = (terms_of(BY_ID[m], fitter.scene)[0] for m in (first, second))
    alone = fitter.fit((one,), np.array([p.starts[0] for p in one.parameters]), MIDDLE)
    ((drop, start),) = fitter.promises((other,), MIDDLE, alone)
    both = fitter.fit((one, other), np.concatenate([alone.theta, start]), MIDDLE)
    assert drop > 20.0
    assert drop == pytest.approx(alone.objective - both.objective, rel=0.1)
