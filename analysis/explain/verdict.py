"""The verdict: what the search came to, and how surely each name is right."""

from dataclasses import replace

import numpy as np
from scipy.special import expit

from analysis.explain import asked, likelier
from analysis.explain.conclusion import Conclusion, by_root, temper
from analysis.explain.heldout import HeldOut
from analysis.explain.hypers import Hyper
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.odds import LIKELIER
from analysis.explain.thresholds import (
    AHEAD,
    ALIKE,
    APART,
    AS_BADLY,
    DOUBTFUL,
    HALF_WORSE,
    LEAST_ROUGH,
    LEFT_OF_LENS,
    LEFT_OF_RANDOM,
    LEFT_OF_STRONG,
    LEFT_OVER,
    LENS_ALONE,
    LEVEL_ALONE,
    MOST_MISFIT,
    OF_THREE,
    OTHER_LENS,
    PLACED,
    RELIABLE,
    ROUGH,
    ROUGH_ALONE,
    ROUGH_ONE,
    STRONG,
    SURE_ALONE,
    TEMPER_RANDOM,
    UNNAMED,
    UNNAMED_ALONE,
    UNNAMED_ALONE_ONE,
    WORSE,
)
from analysis.explain.told_form import traced


def first_of(named: list[Hypothesis], found: Conclusion) -> Hypothesis:
    """The first name of those with the evidence for one, best first: the best.

    But that which is likelier than the best (`likelier.by_itself`, `likelier.seen`) if the best is hardly ahead of it.
    """
    best = named[0]
    nats = found.temper(best.evidence - found.nothing.evidence)
    for other in named[1:]:
        name = other.ids[0]
        odds = likelier.by_itself(found, name, best.ids) + likelier.seen(found, name, best.ids)
        if best.evidence - other.evidence < odds * nats:
            return other
    return best


def decide(found: Conclusion, few: float) -> None:
    """Set the verdict, probabilities, and what cannot be told apart."""
    told = found.rivals_of_names(found.unnamed) if found.best.ids else found.unnamed
    left = max((u.gain for u in told), default=0.0)
    # what bends to ripple counts for less beside other names; what may be left grows with all that it explains
    told_by_fit = found.best.fit.log_evidence + found.best.fit.bending
    gain = max(found.best.evidence, told_by_fit) - found.nothing.evidence
    rough = _rougher(found, ROUGH_ONE if found.one_instrument else ROUGH if found.best.ids else ROUGH_ALONE)
    imitated = found.unnamed_alone > found.imitation * gain + UNNAMED
    beaten = found.law_alone > gain + AHEAD * float(np.sqrt(max(gain, 0.0)))
    if not found.best.ids:
        off = (found.one_instrument and abs(found.level) > LEVEL_ALONE) or found.taken_by_lens > LENS_ALONE
        least = UNNAMED_ALONE_ONE if found.one_instrument else UNNAMED_ALONE
        found.verdict = "unexplained" if left > few * least or rough or off else "no-mismatch"
    elif left > _may_be_left(found, gain) or (rough and gain < STRONG):
        void = (rough and gain < LEAST_ROUGH) or (gain < STRONG and _another_lens(found))
        known = asked.far_ahead(found.best, found) or found.best.first in found.lacked
        sure = known and left <= _may_be_left(found, gain)
        wrong = imitated or beaten or (void and not sure)
        found.verdict = "unexplained" if wrong else "partly-explained"
    elif imitated or beaten:
        found.verdict = "unexplained"
    elif not found.best.fit.ids and not found.one_instrument and not set(found.best.ids) <= found.shown:
        # a random effect predicts no reading, and leans on ripple, unless repeats of one direction show it themselves;
        # of a camera's exposures it is all there is to say
        found.verdict = "partly-explained"
    elif _lacks_a_name(found):
        found.verdict = "partly-explained"
    else:
        found.verdict = "explained"
    _probabilities(found)
    if found.best.ids and not _is_sure(found):
        found.verdict = "unexplained"


def _is_sure(found: Conclusion) -> bool:
    return min(found.probability.values()) >= found.sure


def no_better(outside: HeldOut | None) -> bool:
    """Whether tests that were left out are predicted no better: half of them worse, and all together as badly."""
    if outside is None or len(outside.groups) < 2:
        return False
    worse = [after > WORSE * before for _, before, after in outside.groups]
    return sum(worse) >= HALF_WORSE * len(worse) and outside.after > AS_BADLY * outside.before


def stand_out(found: Conclusion, p_values: list[float]) -> None:
    """Where nothing is missing by evidence, a place that differs beyond all chance says that something is."""
    if found.verdict == "no-mismatch" and not found.one_instrument and min(p_values, default=1.0) < PLACED:
        found.verdict = "unexplained"


def _may_be_left(found: Conclusion, gain: float) -> float:
    """What unnamed structure may gain [nats] beside names whose forms are never quite right."""
    first = [t for t in found.best.fit.terms if t.mechanism.id == found.best.first]
    random = LEFT_OF_RANDOM if found.best.wanders else LEFT_OF_STRONG
    share = LEFT_OF_LENS if any(traced(t) for t in first) else random
    return UNNAMED + max(min(asked.misfit(found.best, found.nothing), MOST_MISFIT), share * gain)


def _lacks_a_name(found: Conclusion) -> bool:
    """Whether something further gains enough beside the names, and only what it is called is not sure."""
    beside = (share for (base, _), share in found.shares.items() if base == frozenset(found.best.ids))
    return min(beside, default=1.0) < found.sure_beside


def _rougher(found: Conclusion, usual: Hyper) -> bool:
    """Whether what is left is larger or rougher than simulations, or second instruments, usually leave."""
    left = found.best.fit.hyper
    return left.shape > usual.shape or left.scatter > usual.scatter or left.lens > usual.lens


def _another_lens(found: Conclusion) -> bool:
    """Whether what was simulated is another lens altogether, of which the names do not tell."""
    left = found.best.fit.hyper
    told = any(t.mechanism.like_a_lens for t in found.best.fit.terms)
    return left.shape > OTHER_LENS.shape and left.lens > OTHER_LENS.lens and not told


def share_of(found: Conclusion, best: Hypothesis, base: Hypothesis, candidates: list[Hypothesis], gain: float) -> float:
    """Probability that what ``best`` adds to ``base``, gaining so much, is the one, not the best other candidate.

    What is likelier beforehand (`likelier.beforehand`), and of two that do alike (`likelier.beside`), counts.
    """
    ids = frozenset(base.ids)
    (new,) = set(best.ids) - ids
    nats = temper(gain, found.nat)
    added = [(frozenset(h.ids) - ids, h) for h in candidates]
    rivals = [(names, h) for names, h in added if not names & {new, *found.doubles(new)}]
    odds = [likelier.beforehand(found, names) - likelier.beside(best, h) for names, h in rivals]
    others = [h.evidence + nats * ahead for (_, h), ahead in zip(rivals, odds, strict=True)]
    own = likelier.beforehand(found, frozenset({new}))
    return float(expit((best.evidence - max(others, default=base.evidence)) / nats + own))


def name_the_sure(found: Conclusion) -> bool:
    """Where the first name is doubtful: name the one that all likely sets hold, if there is one, and say so.

    That may be the first name itself, if it is doubtful only for what is left beside it, and likely sets have another
    name for that; a law outside the catalogue that does as well is a set without it. What else there is stays open: the
    verdict is ``partly-explained``. Of one instrument nothing is named so: what else is wrong with it decides how large
    the named is.
    """
    ids = found.best.ids
    if found.one_instrument or not ids or (found.probability[found.best.first] >= DOUBTFUL and _is_sure(found)):
        return False
    weighed = [(h.ids, h.evidence) for h in (found.nothing, *found.singles, found.best)] + found.considered
    likeliest, evidence = max(weighed, key=lambda item: item[1])
    nats = found.temper(evidence - found.nothing.evidence)
    weighed.append(((), found.nothing.evidence + found.law_alone - LIKELIER * nats))
    without = {m: max(e for key, e in weighed if not {m, *found.doubles(m)} & set(key)) for m in likeliest}
    surest = min(likeliest, key=lambda m: without[m])
    alone = next((h for h in found.singles if h.ids == (surest,)), None)
    left = found.left_against if set(likeliest) == set(ids) else 0.0
    sure = RELIABLE * float(expit((evidence - without[surest] - LEFT_OVER * left) / nats))
    if alone is None or (surest == found.best.first and len(likeliest) == 1) or sure < SURE_ALONE:
        return False
    found.best, found.verdict, found.probability = alone, "partly-explained", {surest: sure}
    # what stood in the first name's place stands beside this one
    alike = {surest, *found.doubles(surest)}
    found.indistinguishable = [pair for pair in found.indistinguishable if surest not in pair or set(pair) <= alike]
    return True


def _doubles_here(found: Conclusion, name: str, alone: dict[str, float]) -> list[str]:
    """A mechanism's doubles, where they do as well: a leak that follows the daylight is not a reading in the dark."""
    gain = alone.get(name, 0.0)
    near = max(ALIKE, found.temper(gain))
    return [d for d in found.doubles(name) if d in alone and (d in found.alike or abs(alone[d] - gain) < near)]


def _share(found: Conclusion, name: str) -> float:
    """How probable a name is beside others of the best set; that which was not asked about is doubtless."""
    told = found.shares.items()
    return next((s for (base, new), s in told if new == name and base < set(found.best.ids)), 1.0)


def _alone(found: Conclusion) -> dict[str, float]:
    """What each single gains over nothing [nats]."""
    nothing = found.nothing.evidence
    return {h.ids[0]: h.evidence - nothing for h in reversed(found.singles) if len(h.ids) == 1}


def _rivals(found: Conclusion, top: float, nats: float) -> dict[tuple[str, ...], float]:
    """Log odds against the first name, of all that does without it.

    Singles are compared with the best single named; those that a further name was sought beside (what came of that is
    among the sets) with all that is named; and sets with the best set that holds the first name. Instruments that the
    case holds no reading of are less likely.
    """
    ids, alone = found.best.ids, _alone(found)
    alike = {*ids, *(d for m in ids for d in _doubles_here(found, m, alone))}
    first = {found.best.first, *_doubles_here(found, found.best.first, alone)}
    rivals: dict[tuple[str, ...], float] = {}
    random = set() if found.best.wanders else {h.ids[0] for h in found.singles if h.wanders and len(h.ids) == 1}
    units = {m: min(nats, TEMPER_RANDOM) if m in random else nats for m in alone}
    whole = found.best.evidence - found.nothing.evidence if len(ids) > 1 else top
    bases = {m for base, _ in found.shares if len(base) == 1 for m in base}
    more = {h.ids[0]: asked.more_as_rival(h, found) for h in found.singles if len(h.ids) == 1}
    more = {m: max(more[m] - more.get(found.best.first, 0.0), 0.0) for m in more}
    for m, gain in alone.items():
        if m not in alike:
            rivals[m,] = (gain - more[m] - (whole if m in bases else top)) / units[m]
    sets = [(key, evidence) for key, evidence in found.considered if ids and not first & set(key)]
    best = max([found.best.evidence, *(evidence for key, evidence in found.considered if first & set(key))])
    rivals |= {key: (evidence - best) / nats for key, evidence in sets}
    return {key: odds - likelier.unseen(found, key) - likelier.than(found, key) for key, odds in rivals.items()}


def _takes_the_rest(found: Conclusion) -> bool:
    """Whether a further name, not sure enough to be told, does better beside the names than they do alone."""
    ids = set(found.best.ids)
    return any(ids < set(key) and evidence > found.best.evidence for key, evidence in found.considered)


def _probabilities(found: Conclusion) -> None:
    """Of the first name beside its best rival; of further names as they were accepted.

    A rival is any other single, a set considered without it, a law outside the catalogue, or nothing. What is left
    beside the names speaks against them by half, unless a further name would take it. Where a lone name is doubtful
    for one rival alone, which has the evidence for a name by itself, it is either of the two. (Of seven of other
    authors' silent cases two are told so, and hold it.)
    """
    ids, alone = found.best.ids, _alone(found)
    top = max((alone.get(m, 0.0) for m in ids), default=max(alone.values(), default=0.0))
    nats = found.temper(top)
    rivals = _rivals(found, top, nats)
    even = asked.even(found, found.best.first, found.best) if found.one_instrument else 0.0
    nothing = (even - top) / by_root(top, found.nat)
    sure = 0.0
    near: tuple[str, ...] = ()
    if ids:
        left = 0.0 if _takes_the_rest(found) else found.left_against
        law = found.law_odds(top if len(ids) == 1 else found.best.evidence - found.nothing.evidence, nats)
        beside = likelier.unseen(found, (found.best.first,)) + LEFT_OVER * left / by_root(top, found.nat)
        sure = RELIABLE * float(expit(-max(*rivals.values(), law, nothing) - beside))
        near = tuple(key[0] for key, r in rivals.items() if len(key) == 1 and r > -APART and sure < found.sure)
        if len(near) == len(ids) == 1 and found.enough >= {*near, *ids}:
            rest = {key: r for key, r in rivals.items() if key != near}
            either = RELIABLE * float(expit(-max(*rest.values(), law, nothing) - beside))
            if either >= found.sure:  # it is one of the two
                found.best = replace(found.best, open=(near[0], float(expit(rivals[near[0],]))))
                rivals, sure = rest, either
        found.probability = {m: sure if m == found.best.first else RELIABLE * _share(found, m) for m in ids}
        if found.one_instrument and len(ids) > 2:
            found.probability = {m: OF_THREE * p for m, p in found.probability.items()}
    share = {key: float(np.exp(r - np.logaddexp.reduce([nothing, *rivals.values()]))) for key, r in rivals.items()}
    ranked = sorted(share, key=lambda key: -share[key])[:5]
    found.alternatives = [(key, (1.0 - sure) * share[key]) for key in ranked]
    if ids:
        first = found.best.first
        alike = (*_doubles_here(found, first, alone), *near)
        found.indistinguishable += [(first, other) for other in alike if other in alone and other not in ids]
        found.indistinguishable += found.best.tied


def share_with_doubles(found: Conclusion) -> None:
    """Tell a name and the doubles that do as well among the alternatives: its probability is that of either."""
    alone = _alone(found)
    for name, alike in found.either.items():
        if found.best.open and alike == (found.best.open[0],):
            parts = np.array([1.0 - found.best.open[1], found.best.open[1]])
        else:
            gains = np.array([alone.get(m, 0.0) for m in (name, *alike)])
            parts = np.exp(gains - gains.max()) / np.sum(np.exp(gains - gains.max()))
        rest = tuple(m for m in found.best.ids if m != name)
        shares = zip((name, *alike), found.probability[name] * parts, strict=True)
        found.alternatives += [((*rest, m), float(p)) for m, p in shares]
    found.alternatives.sort(key=lambda item: -item[1])
