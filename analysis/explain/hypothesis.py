"""What is weighed: mechanisms that may act together, with the evidence for them."""

from dataclasses import dataclass, field

from analysis.explain.fit import Fit
from analysis.explain.thresholds import ALIKE
from analysis.explain.wander import Wandering


@dataclass(eq=False)
class Hypothesis:
    """Mechanisms together, with their evidence.

    Attributes
    ----------
    fit
        The fit of the parametric mechanisms (may be none).
    wanders
        Random effects in it, of the forms and sizes that carry most of the evidence.
    evidence
        Log evidence, mechanisms' several ways averaged, without the prior on mechanisms.
    tied
        Mechanisms added to others, and what could stand in their place.
    open
        What may as well have been added last, and how probable it is of the two; ``None`` where that is known.
    added, added_to
        The mechanism that was added last, if it is not the last of ``ids``; and the one that all others were added to,
        empty where there are no others.
    """

    fit: Fit
    evidence: float
    wanders: tuple[Wandering, ...] = ()
    ways: list[Fit] = field(default_factory=list)
    tied: tuple[tuple[str, str], ...] = ()
    open: tuple[str, float] | None = None
    added: str = ""
    added_to: str = ""

    @property
    def first(self) -> str:
        """Id of the mechanism that was there before others."""
        return self.added_to or next(iter(self.ids), "")

    @property
    def last(self) -> str:
        """Id of the mechanism that was added last (random effects stand behind formulas, whichever came first)."""
        return self.added or self.ids[-1]

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of its catalogue mechanisms."""
        random = (x.wander.name for x in self.wanders if x.wander.mechanism is not None)
        return (*self.fit.ids, *(name for name in random if name not in self.fit.ids))

    @property
    def of_case(self) -> bool:
        """Whether the case's own variant of a mechanism does as well as any other way of it."""
        least = self.fit.log_evidence - ALIKE
        return any(way.log_evidence > least and any(t.branch.of_case for t in way.terms) for way in self.ways)
