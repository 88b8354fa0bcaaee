"""Real recordings beside the project, read in place."""

from pathlib import Path

import pytest


def recording(name: str) -> Path:
    """Path of a recording in the shared data folder; the test is skipped, saying so, where it is absent."""
    for folder in Path(__file__).parents:
        place = folder / "shared" / "data" / name
        if place.exists():
            return place
    pytest.skip(f"the recording shared/data/{name} is not here")
