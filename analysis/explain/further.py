"""What stands beside a name: a second and a third are added while the evidence carries them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from analysis.explain import asked
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import CLOUD, PATTERN, named_wanders
from analysis.explain.fit import Extra
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.likelier import beforehand, unseen
from analysis.explain.repeats import repeats
from analysis.explain.search import Search
from analysis.explain.thresholds import (
    ALIKE,
    BASES,
    HOLDS_LAWS,
    NAME_FIRST_BELOW,
    NAME_OF_TWO,
    RUNNER_UP,
    SHOWN,
)
from analysis.explain.verdict import share_of


@dataclass
class Beside:
    """What could be added to a set of names.

    Attributes
    ----------
    base
        The names.
    alone
        Their evidence, the better of two: their forms' errors allowed for, as beside others, or not.
    candidates
        Sets of one name more, best first, on the same scale.
    """

    base: Hypothesis
    alone: float
    candidates: list[Hypothesis]

    def whole(self, h: Hypothesis) -> float:
        """Evidence of a candidate on the common scale, on which the base's own is its evidence."""
        return self.base.evidence + h.evidence - self.alone


def grow(search: Search, found: Conclusion) -> None:
    """Add a second and a third mechanism while the evidence carries them.

    Of two that act together a third may imitate the sum better than either does alone: so the runners-up are bases too,
    but nothing that leans on whatever is there and would not be named first, and nothing that no physics makes.
    """
    nothing = found.nothing.evidence
    least = nothing + min(RUNNER_UP * (found.best.evidence - nothing), found.best.evidence - nothing - 15.0)
    few = asked.share_of_few(search)
    near = [h for h in found.singles[:BASES] if h.ids and h.evidence > least]
    near = [h for h in near if not _leans(h) or h.evidence - nothing > asked.first(h, found, few)]
    near = [h for h in near if not asked.absurd(h.fit)]
    bases = near if found.best in near else [found.best, *near]
    for _ in range(2):
        tried = _by_any_way([_beside(search, found, base) for base in bases])
        grown = [g for b in tried if (g := _one_more(search, found, b)) is not None]
        if not grown:
            return
        gain, best = max(grown, key=lambda item: _less_unseen(found, item[1]))
        doubtful = any(found.shares.get((_others(best.ids, m), m), 1.0) < found.sure_beside for m in best.ids)
        if doubtful or not _each_gains(found, tried, best):
            found.best = next(h for h in found.singles if set(h.ids) <= set(best.ids) and h.ids)
            return  # beside one of the two, another might stand for the other
        found.trail.append(f"{' + '.join(best.ids)} beats its parts by {gain:.1f} nats")
        found.best = best
        if best.open:
            return
        bases = [best]


def _leans(h: Hypothesis) -> bool:
    """Whether it is a random effect, or a form that stands in for others.

    (A share of the beam that is the sky's, which had 32 nats of 90, took a sensor's gain to itself, which was right.)
    """
    return bool(h.wanders) or any(t.branch.stands_in for t in h.fit.terms)


def name_two_together(search: Search, found: Conclusion, few: float) -> None:
    """Where no name gains enough by itself, two may that together gain it and each beside the other what a second must.

    Two that act together hide each other: either alone leaves what the other does, and counts for less beside that.
    Where a third does alone what two do together, two are no better known than one. (An aureole that had 58 nats, and
    was not told, for little was sure of it, left a clock and a wall that were told for 56.)
    """
    nothing = found.nothing.evidence
    bases = [h for h in found.singles[:BASES] if not h.wanders and h.evidence - nothing > NAME_FIRST_BELOW]
    tried = _by_any_way([_beside(search, found, base) for base in bases if not asked.absurd(base.fit)])
    grown = [g[1] for b in tried if (g := _one_more(search, found, b)) is not None]
    alone = {h.ids[0]: h.evidence for h in reversed(found.singles) if len(h.ids) == 1}
    told = [h for h in grown if h.evidence - nothing > asked.first(h, found, few)]
    third = max((h.evidence for h in found.singles if not h.wanders), default=nothing)
    told = [h for h in told if h.evidence > third]
    told = [h for h in told if min(h.evidence - alone.get(m, nothing) for m in h.ids) > NAME_OF_TWO]
    found.best = max(told, key=lambda h: h.evidence, default=found.nothing)


def _beside(search: Search, found: Conclusion, base: Hypothesis) -> Beside:
    """What could be added to ``base``: mechanisms and random effects, but nothing that no physics makes."""
    extra = search.allowed(base)
    alone = max(search.reweighed(base, extra), base.fit.log_evidence)
    candidates = search.beside(base, extra) + wandering_beside(search, found, base, extra)
    return Beside(base, alone, [h for h in candidates if not asked.absurd(h.fit)])


def _by_any_way(tried: list[Beside]) -> list[Beside]:
    """The same, where each set counts for as much as it does by the best way to it.

    What its forms may have wrong is allowed for of the names it was added to alone.
    """
    best: dict[frozenset[str], float] = {}
    for b in tried:
        for h in b.candidates:
            best[frozenset(h.ids)] = max(b.whole(h), best.get(frozenset(h.ids), -np.inf))
    for b in tried:
        for h in b.candidates:
            h.evidence += best[frozenset(h.ids)] - b.whole(h)
    return tried


def _one_more(search: Search, found: Conclusion, beside: Beside) -> tuple[float, Hypothesis] | None:
    """A set with one mechanism more, if that is accepted; evidence is put on the common scale of `Conclusion`."""
    base, alone, candidates = beside.base, beside.alone, beside.candidates
    if not candidates:
        return None
    seen = [h for h in candidates if search.least_effect(h) > asked.least_effect(h, found) and not asked.is_a_moment(h)]
    best = _likeliest(found, seen or candidates, base, alone)
    gain = best.evidence - alone
    (new,) = set(best.ids) - set(base.ids)
    share, needed = _asked_for(found, beside, best)
    open_to = _in_its_place(found, beside, best, seen) if share < found.sure_beside else None
    if open_to:
        share = open_to[1]
    # what gains too little to be told does not say either that others would do as well
    found.shares[frozenset(base.ids), new] = share if gain >= needed else 1.0
    found.considered.append((best.ids, base.evidence + gain - 0.5 * needed))
    if not seen or gain < needed or base.evidence + gain < found.best.evidence + needed:
        return None
    if share < found.sure_beside or _no_more_a_cloud(search, best):
        return None
    if asked.mistaken(base, new, base.evidence + gain, found):
        return None
    near = max(ALIKE, found.temper(gain))
    tied = (h for h in candidates if h.last in found.doubles(new) and abs(h.evidence - best.evidence) < near)
    tied_too = base.tied + tuple((new, h.last) for h in tied)
    if open_to:
        best = replace(best, open=open_to[0])
        tied_too += ((new, open_to[0][0]),)
    return gain, replace(best, tied=tied_too, added_to=base.first, evidence=base.evidence + gain)


def _in_its_place(
    found: Conclusion, beside: Beside, best: Hypothesis, seen: list[Hypothesis]
) -> tuple[tuple[str, float], float] | None:
    """What may as well be added to the first name as the likeliest, and how probable of the two; and that it is either.

    Both gain what is asked of them, and nothing else comes near. Neither is a random effect, which takes whatever is
    left. (Beside other authors' first names six were so: five times one of the two was true.)
    """
    base, added = beside.base, set(best.ids) - set(beside.base.ids)
    same = {*added, *(d for m in added for d in found.doubles(m))}
    others = [h for h in seen if h is not best and not same & set(h.ids)]
    rival = max(others, key=lambda h: h.evidence, default=None)
    if base.ids != found.best.ids or rival is None or rival.wanders != base.wanders or best.wanders != base.wanders:
        return None
    if rival.evidence - beside.alone < _asked_for(found, beside, rival)[1]:
        return None
    gain, rest = best.evidence - beside.alone, [h for h in beside.candidates if h is not rival]
    of_the_two = float(expit((rival.evidence - best.evidence) / found.temper(gain)))
    return (rival.last, of_the_two), share_of(found, best, base, rest, gain)


def _asked_for(found: Conclusion, beside: Beside, h: Hypothesis) -> tuple[float, float]:
    """How probable what a candidate adds is among all that could be added, and how many nats are asked of it."""
    base, gain = beside.base, h.evidence - beside.alone
    (new,) = set(h.ids) - set(base.ids)
    random = len(h.wanders) > len(base.wanders) and h.last not in found.shown
    share = share_of(found, h, base, beside.candidates, gain)
    return share, asked.beside(h, base, found, new, random, share)


def _each_gains(found: Conclusion, tried: list[Beside], best: Hypothesis) -> bool:
    """Whether each name of a set gains beside the others what a further one must, where one was sought beside those.

    (A response that bends had 17 nats beside a clock, for which it was asked 20; but the clock 510 beside it.)
    """
    ways = [(b, h) for b in tried for h in b.candidates if set(h.ids) == set(best.ids)]
    return all(h.evidence - b.alone >= _asked_for(found, b, h)[1] for b, h in ways)


def _no_more_a_cloud(search: Search, h: Hypothesis) -> bool:
    """Whether a cloud that was there first is none beside what was added: repeated readings no longer show it."""
    return any(x.wander is CLOUD and repeats(search.scene, h.fit, x).contradict for x in h.wanders)


def _likeliest(found: Conclusion, candidates: list[Hypothesis], base: Hypothesis, alone: float) -> Hypothesis:
    """The best of what could be added to ``base``, which has some evidence ``alone``.

    No instrument that no reading is of, if another is hardly behind it; but what the prediction lacks by the case's own
    account, if it is hardly behind another.
    """
    nats = found.temper(max(h.evidence for h in candidates) - alone)
    ids = frozenset(base.ids)
    return max(candidates, key=lambda h: h.evidence + nats * beforehand(found, frozenset(h.ids) - ids))


def _less_unseen(found: Conclusion, h: Hypothesis) -> float:
    """Evidence of a set, less what is thought of instruments that no reading is of."""
    return h.evidence - found.temper(max(h.evidence - found.nothing.evidence, 0.0)) * unseen(found, h.ids)


def _others(ids: tuple[str, ...], name: str) -> frozenset[str]:
    return frozenset(ids) - {name}


def wandering_beside(search: Search, found: Conclusion, base: Hypothesis, extra: tuple[Extra, ...]) -> list[Hypothesis]:
    """``base`` with each of the catalogue's random effects that repeated readings do not contradict."""
    tried = {m.id for m in search.mechanisms} - set(base.ids)
    kept = []
    for h in search.each_wandering(base, named_wanders(search.scene, tried), extra):
        wander = h.wanders[-1].wander
        told = repeats(search.scene, base.fit, h.wanders[-1]) if wander is CLOUD else None
        if told and told.contradict:
            found.contradicted[wander.name] = "readings of one direction at several moments of a test do not show it"
            continue
        if told and told.told > SHOWN:
            found.shown.add(wander.name)
        elif not base.ids and wander is not PATTERN:
            h.evidence -= HOLDS_LAWS * max(h.evidence - base.evidence, 0.0)
        kept.append(h)
    return kept
