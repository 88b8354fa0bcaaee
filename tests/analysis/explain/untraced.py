"""A simulator that has traced nothing."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.cases.model import Floats
from analysis.explain.look import Likened
from analysis.explain.retrace import Path


@dataclass
class Untraced:
    """All that is known is the sky's part of the light (T, P, G) [cd], and what systems look like, if told."""

    sky: Floats | None = None
    systems: Mapping[str, Likened] = field(default_factory=dict)

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        return ()

    def aureole(self, width_deg: float) -> Floats | None:
        return None

    def near_field(self) -> tuple[Floats, Floats] | None:
        return None

    def sky_part(self) -> Floats | None:
        return self.sky

    def traced_systems(self) -> Mapping[str, Likened]:
        return self.systems


class Turning(Untraced):
    """A simulation that knows paths of turned lenses, and nothing else."""

    def __init__(self, *paths: Path) -> None:
        super().__init__()
        self.turns = paths

    def paths(self, mechanism: str) -> tuple[Path, ...]:
        return self.turns if mechanism == "lens-orientation" else ()
