"""What the search came to: the names, their rivals, what is left beside them, and what bounds apply."""

from dataclasses import dataclass, field

import numpy as np

from analysis.explain.families import UNREST
from analysis.explain.heldout import HeldOut
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.base import Term
from analysis.explain.mechanisms.lens import LensOrientation
from analysis.explain.mechanisms.sluggish import Sluggish
from analysis.explain.odds import LIKELIER, SLOW_OR_LATE
from analysis.explain.thresholds import (
    ALIKE,
    DOUBLES,
    IMITATION,
    IMITATION_LENS,
    SAME,
    SURE,
    SURE_BELOW,
    SURE_BESIDE,
    SURE_BESIDE_BELOW,
    TEMPER,
    TEMPER_SHARE,
)
from analysis.explain.told_form import flatten_alike, of_another_lens

_TOLD = 4  # so many kinds of unnamed structure are told


@dataclass(frozen=True)
class Unnamed:
    """Structure that no catalogued mechanism explains.

    Attributes
    ----------
    along
        What it varies with, in words; the id of a conjecture.
    gain
        Nats of log evidence.
    size
        Its amplitude (relative), or the conjecture's first parameter.
    conjecture
        A law that fits it, of physics beyond the catalogue.
    single
        Whether it is a few readings that stand alone: no function of anything.
    weighed
        The hypothesis that holds it, beside the names.
    """

    along: str
    gain: float
    size: float
    conjecture: Term | None = None
    single: bool = False
    weighed: Hypothesis | None = None


@dataclass
class Conclusion:
    """What the search came to.

    Attributes
    ----------
    best
        The accepted hypothesis (may be "nothing").
    nothing, singles
        What it was compared with; singles are sorted, best first.
    unnamed
        Unnamed structure that still gains beside the best, largest gain first.
    instead
        The same without any named mechanism, where there is one.
    readings
        How many were weighed.
    one_instrument, pictures
        Whether only a meter or a camera was read, no goniometer; whether only luminances were.
    level
        What the middle reading of a roof meter has more or less than its prediction, stretched; other instruments'
        tests have gains of their own.
    taken_by_lens
        By how much (rms, relative) the usual errors of lenses seem to change an arm's readings, where nothing is named.
    nat
        So many nats, times the root of what is gained, count as one.
    unseen
        Mechanisms of instruments that the case holds no reading of; laws of those are less likely (`LIKELIER`).
    lacked
        Mechanisms that the prediction lacks by the case's own account: likelier, and asked for less (`LACKED`).
    alike
        Mechanisms that are not told apart in this case, whatever each gains.
    enough
        Formulas that by themselves have the evidence for a name.
    considered
        Further sets of names with their evidence, less what a name more has to bring.
    shares
        How probable a name is beside others, among all that could have been added to those.
    contradicted, shown
        Random effects that repeated readings speak against (and how), and those that they show by themselves.
    outside
        How tests that were left out are predicted by what is kept.
    withdrawn
        Whether the best set was withdrawn for what it says of them.
    """

    best: Hypothesis
    nothing: Hypothesis
    singles: list[Hypothesis]
    verdict: str = "no-mismatch"
    probability: dict[str, float] = field(default_factory=dict)
    alternatives: list[tuple[tuple[str, ...], float]] = field(default_factory=list)
    indistinguishable: list[tuple[str, str]] = field(default_factory=list)
    unnamed: list[Unnamed] = field(default_factory=list)
    instead: list[Unnamed] = field(default_factory=list)
    readings: int = 1000
    one_instrument: bool = False
    pictures: bool = False
    level: float = 0.0
    taken_by_lens: float = 0.0
    nat: float = TEMPER
    unseen: frozenset[str] = frozenset()
    lacked: frozenset[str] = frozenset()
    alike: frozenset[str] = frozenset()
    enough: frozenset[str] = frozenset()
    considered: list[tuple[tuple[str, ...], float]] = field(default_factory=list)
    shares: dict[tuple[frozenset[str], str], float] = field(default_factory=dict)
    trail: list[str] = field(default_factory=list)
    contradicted: dict[str, str] = field(default_factory=dict)
    shown: set[str] = field(default_factory=set)
    outside: HeldOut | None = None
    withdrawn: bool = False

    @property
    def kept(self) -> Hypothesis:
        """What corrects the prediction: what is not named corrects nothing."""
        return self.best if self.verdict in {"explained", "partly-explained"} else self.nothing

    @property
    def not_claimed(self) -> list[tuple[tuple[str, ...], float]]:
        """What else may be the cause, and how probably; where nothing is claimed, the best set leads the list."""
        if self.verdict != "unexplained" or not self.best.ids:
            return self.alternatives
        leading = (self.best.ids, min(self.probability.values(), default=0.0))
        others = [item for item in self.alternatives if item[0] != self.best.ids]  # a double's share is told as its own
        return sorted([leading, *others], key=lambda item: -item[1])

    @property
    def either(self) -> dict[str, tuple[str, ...]]:
        """Names of the best set that do no better than their doubles, and those: which of them it is, is open.

        So is a further name, if another may as well stand beside the first, or a lone one's only near rival.
        """
        told = {name: [d for pair in self.indistinguishable if name in pair for d in pair] for name in self.best.ids}
        open_to = {self.best.last: (self.best.open[0],)} if self.best.open else {}
        known = {name: (*open_to.get(name, ()), *self.doubles(name)) for name in told}
        found = {name: tuple(d for d in known[name] if d in others) for name, others in told.items()}
        return {name: alike for name, alike in found.items() if alike}

    def doubles(self, name: str) -> tuple[str, ...]:
        """Mechanisms that are one and the same number as a given one, or do the same to all readings of this case.

        (Below a tube alone, lenses that are turned are an arm that is turned the other way; below several wells the arm
        is likelier, `likelier.by_itself`.) Instruments that no reading is of are none.
        """
        known = {other for pair in DOUBLES if name in pair for other in pair}
        mine = self._by_itself(name)
        same = {h.ids[0] for h in self.singles if mine and len(h.ids) == 1 and not h.wanders and self._same(mine, h)}
        alike = self.alike if name in self.alike else frozenset()
        return tuple(sorted((known | same | alike) - {name} - self.unseen))

    def _by_itself(self, name: str) -> Hypothesis | None:
        return next((h for h in self.singles if h.ids == (name,) and not h.wanders), None)

    def _same(self, one: Hypothesis, other: Hypothesis) -> bool:
        """Whether two singles do as well as each other, and the same: less apart than such a share of what they do."""
        if any(LensOrientation.is_an_arms(t) for h in (one, other) for t in h.fit.terms):
            return False
        change = one.fit.residual - self.nothing.fit.residual
        apart = one.fit.residual - other.fit.residual
        alike = float(np.linalg.norm(apart)) < SAME * float(np.linalg.norm(change)) or flatten_alike(one, other)
        return alike and abs(one.evidence - other.evidence) < ALIKE

    @property
    def ruled_out(self) -> dict[str, str]:
        """What repeated readings speak against, beside all that is named: what they show alone may be named itself."""
        return {name: why for name, why in self.contradicted.items() if name not in self.best.ids}

    @property
    def imitation(self) -> float:
        """How many times a name's gain a smooth function must gain to speak against it."""
        return IMITATION_LENS if of_another_lens(self.best) else IMITATION

    def rivals_of_names(self, unnamed: list[Unnamed]) -> list[Unnamed]:
        """What of unnamed structure speaks against a name, rather than to stand beside it.

        Below a skylight not a few single readings: there an image of the sun lies elsewhere, and the law of the others
        is what it was.
        """
        return [u for u in unnamed if self.one_instrument or not u.single]

    @property
    def unnamed_alone(self) -> float:
        """Best gain [nats] of a smooth function of nobody's making in place of all names; 0 where there is none."""
        return max((u.gain for u in self.rivals_of_names(self.instead) if u.conjecture is None), default=0.0)

    @property
    def law_alone(self) -> float:
        """The same of a law outside the catalogue; minus infinity where there is none."""
        return max((self._of_a_law(u) for u in self.instead if u.conjecture is not None), default=-np.inf)

    def law_odds(self, gain: float, nats: float) -> float:
        """Log odds of the best such law against a name that gains so much; so many nats count as one."""
        laws = [u for u in self.instead if u.conjecture is not None]
        return max(((self._of_a_law(u) - gain) / nats - self._likelier(u) for u in laws), default=-np.inf)

    def _of_a_law(self, law: Unnamed) -> float:
        """What a law gains; the scatter that tells a clock under broken cloud is there beside a slow meter, too."""
        clocks = [h for h in self.singles if h.ids == (UNREST.name,)]
        plain = [h.evidence for h in clocks if not h.wanders]
        scattered = self.best.first == UNREST.name and any(x.wander is UNREST for x in self.best.wanders)
        if law.along != Sluggish.id or not plain or not scattered:
            return law.gain
        return law.gain + max(h.evidence for h in clocks) - plain[0]

    def _likelier(self, law: Unnamed) -> float:
        """How much less likely a law is than a name; a slow meter is hardly less likely than a clock that is off."""
        return SLOW_OR_LATE if law.along == Sluggish.id and self.best.first == UNREST.name else LIKELIER

    @property
    def unnamed_told(self) -> list[Unnamed]:
        """The most promising of unnamed structure; first a law that does as well as all names, with what it gains."""
        gain = self.best.evidence - self.nothing.evidence
        least = gain - self.temper(gain)
        laws = [
            u for u in self.instead if u.conjecture is not None and u.gain > least and self.verdict == "unexplained"
        ]
        return laws[:1] + [u for u in self.unnamed[:_TOLD] if u.along not in {law.along for law in laws[:1]}]

    @property
    def left_against(self) -> float:
        """What is left of that beside the best [nats], at least 0."""
        return max([0.0, *(u.gain for u in self.rivals_of_names(self.unnamed))])

    @property
    def sure(self) -> float:
        """How probable a name must be to be claimed."""
        return SURE if self.one_instrument else SURE_BELOW

    @property
    def sure_beside(self) -> float:
        """What share a further name must have among all that could be added in its place."""
        return SURE_BESIDE if self.one_instrument else SURE_BESIDE_BELOW

    def temper(self, gain: float) -> float:
        """How many nats count as one for the first name, beside what that gains."""
        return temper(gain, self.nat)


def temper(gain: float, nat: float = TEMPER) -> float:
    """How many nats count as one beside a gain: evidence for one form against another wanders by the gain's root.

    But by no more than a share of it: what a form has wrong grows with what it does.
    """
    return min(by_root(gain, nat), max(TEMPER_SHARE * gain, nat))


def by_root(gain: float, nat: float = TEMPER) -> float:
    """How many nats count as one against nothing at all."""
    return nat * float(np.sqrt(max(gain, 1.0)))
