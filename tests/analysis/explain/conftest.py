"""Scenes that many tests read and none changes."""

import pytest

from analysis.explain.readings import Readings
from analysis.explain.scene import Scene
from analysis.explain.variants import retraced_of
from tests.analysis.explain.campaign import NONE, make_case
from tests.analysis.explain.roof import roof_case, sky_case


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """The campaign below, predicted in the far field and recorded without flaw."""
    case = make_case(tmp_path_factory.mktemp("arm") / "case", flaws=NONE, change={"simulation": {"field": "far"}})
    return Scene(Readings.of(case), retraced_of(case))


@pytest.fixture(scope="session")
def roof(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Two meters over two days."""
    case = roof_case(tmp_path_factory.mktemp("roof") / "case", {})
    return Scene(Readings.of(case), retraced_of(case))


@pytest.fixture(scope="session")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A fisheye's luminances under four skies."""
    case = sky_case(tmp_path_factory.mktemp("picture") / "case")
    return Scene(Readings.of(case), retraced_of(case))
