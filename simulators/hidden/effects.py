"""Everything that may conceal itself in a station, as one frozen description that can be laid over any world.

The parts are those of the chain: source, optics, room, arm, heads. A neutral `Hidden` changes nothing. An emulated
world applies `source` to its light (`SourceFaults.over`), builds its `Bench` from `room` and `arm`, takes its
skylight's response through `optics`, and passes what the heads see through `heads` (`heads.read`).
"""

from dataclasses import dataclass, field

from simulators.hidden.arm import ArmFaults
from simulators.hidden.bench import RoomFaults
from simulators.hidden.heads import HeadFaults
from simulators.hidden.light_faults import SourceFaults
from simulators.hidden.skylight import Defect
from simulators.hidden.tracer import Answer


@dataclass(frozen=True)
class OpticsFaults:
    """How a skylight differs from the one that was simulated.

    Attributes
    ----------
    answer
        Another wall, haze, dirt.
    turn_deg
        The lens patterns are turned by this, counter-clockwise seen from above [deg].
    aligned
        Share of the lens whose pattern lies as it should; the rest lies anyhow.
    defect, defect_share, fogged
        Something broken in one place, how thoroughly (0..1), and whether it scatters instead of swallowing.
    """

    answer: Answer = field(default_factory=Answer)
    turn_deg: float = 0.0
    aligned: float = 1.0
    defect: Defect = field(default_factory=Defect)
    defect_share: float = 0.0
    fogged: bool = False


@dataclass(frozen=True)
class Hidden:
    """All that is concealed in a station; ``optics`` lists (system, faults), systems not listed are sound."""

    source: SourceFaults = field(default_factory=SourceFaults)
    optics: tuple[tuple[str, OpticsFaults], ...] = ()
    room: RoomFaults = field(default_factory=RoomFaults)
    arm: ArmFaults = field(default_factory=ArmFaults)
    heads: HeadFaults = field(default_factory=HeadFaults)

    def optics_of(self, system: str) -> OpticsFaults:
        """Faults of one system's optics."""
        return dict(self.optics).get(system, OpticsFaults())
