"""How much evidence a name is asked for [nats]: as the first, beside others, and as a rival of another.

What looks like a simulation's own errors is asked for more than what does not.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from analysis.explain.conclusion import Conclusion
from analysis.explain.families import CLOUD, PATTERN, UNREST
from analysis.explain.fit import Fit
from analysis.explain.form_error import OF_CASE
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.aureole import CircumsolarAureole
from analysis.explain.mechanisms.base import Stage, Term
from analysis.explain.mechanisms.goniometer import COffset, GammaOffset, NearField
from analysis.explain.mechanisms.roof_meters import MeterTilt
from analysis.explain.mechanisms.sensor_heads import ChannelGain
from analysis.explain.mechanisms.well import WallScatter
from analysis.explain.search import Search
from analysis.explain.small_turns import mixture
from analysis.explain.thresholds import (
    DOUBLES,
    EVEN,
    EVEN_COSINE,
    EVEN_GAIN,
    EVEN_LEAST,
    EVEN_LENS,
    EVEN_PICTURE,
    EVEN_READINGS,
    FAR_AHEAD,
    FIRST_BY_LENS,
    HOLDS_LAWS,
    LACKED,
    LEAST_EFFECT,
    LEAST_EFFECT_FAR_AHEAD,
    LEAST_EFFECT_FIRST,
    LEAST_EFFECTS_OF_ARM,
    LEAST_MINUTES,
    MISFIT_LENS,
    MISFIT_LIKE_A_LENS,
    MISFIT_OF_TWO,
    MISFIT_STRONG,
    MOST_MISFIT,
    NAME_FIRST,
    NAME_FIRST_BELOW,
    NAME_FIRST_CLOUD,
    NAME_FIRST_FAR,
    NAME_FIRST_LENS,
    NAME_FIRST_RANDOM,
    NAME_PATTERN,
    NAME_SECOND,
    NAME_SECOND_BELOW,
    NAME_SECOND_EXPOSURES,
    NAME_SECOND_LENS,
    NAME_SECOND_ONE,
    NAME_SECOND_RANDOM,
    NAME_SECOND_SPLIT,
    NAME_STANDING_IN,
    NAME_STRETCHED,
    NEVER,
    RIGHT_LENS,
    THIRD,
    WRONG_LENS,
)
from analysis.explain.told_form import of_another_lens
from analysis.explain.trace_settings import STRETCH_OF

_OF_THE_SUN: Final = frozenset({Stage.SUN_AND_SKY, Stage.ROOF_METERS, Stage.TIME})
"""What acts here acts alike on all readings under one sun, as a simulation's own error does."""
_NO_LAWS_OF_LEVEL: Final = frozenset({"projection-error", "vignetting", "clock-offset"})
"""What changes a picture by place or time: no random function of the level holds it."""
_NO_LENS_DOES: Final = frozenset({UNREST.name, "sky-sun-ratio", "saturation"})
"""A lens is wrong at all hours and under all skies, and does not end at a level."""
_LEFT_BY: Final = {
    COffset.id: UNREST.name,
    NearField.id: CircumsolarAureole.id,
    CircumsolarAureole.id: NearField.id,
    MeterTilt.id: UNREST.name,
    UNREST.name: MeterTilt.id,
}
"""Names that the form of another leaves something like."""
ONE_PATTERN: Final = frozenset({"lens-orientation", "lens-anisotropy"})
"""A prediction that knows no pattern has none that lies wrongly. (Of ten other authors' 844 cases none
hides both, on one system or on two.)"""
_ADD: Final = frozenset[str]().union(*DOUBLES)
_POINTING: Final = frozenset({GammaOffset.id, COffset.id})
_EVEN: Final = {"meter-gain": EVEN_GAIN, ChannelGain.id: EVEN_GAIN, "meter-cosine": EVEN_COSINE}


def first(h: Hypothesis, found: Conclusion, few: float) -> float:
    """What a first mechanism must gain over "nothing", with so much of a shutter's bound (`share_of_few`).

    Below a skylight that is more where the simulation's lens is wrong by more than usual beside it (`WRONG_LENS`), but
    not of what the prediction lacks by the case's own account, nor of what repeated readings show; no lens is wrong at
    one sensor alone, or as a clock is.
    Nor does one add the same to all sensors, in the dark corners as under the images: such an offset is asked for
    `NAME_FIRST_LENS`.
    (Where a sensor's gain led, in five of 200 by three other authors, it was true; so were walls that scatter in nine
    cases of nine, by eight authors, where they led with more than 10 nats; in three of a ninth author's they were not.
    Offsets led with 8 nats and more in six of 166 by seven authors: five of 27 and more were true, one of 15 not.)
    """
    lens = h.fit.hyper.lens
    never_wrong = {ChannelGain.id, WallScatter.id, *found.lacked, *found.shown}
    bends = h.fit.bending > 0.0  # its evidence is less already
    far_wrong = not found.one_instrument and lens > WRONG_LENS and not (bends or set(h.ids) <= never_wrong)
    if not far_wrong or far_ahead(h, found):
        return _first(h, found, few)
    return max(_first(h, found, few), NAME_FIRST_LENS if _on_all(h.fit) else FIRST_BY_LENS * lens)


def far_ahead(h: Hypothesis, found: Conclusion) -> bool:
    """Whether it is a name that no lens looks like, below a skylight and far ahead of all others (`FAR_AHEAD`)."""
    if found.one_instrument or len(h.ids) != 1 or not set(h.ids) <= _NO_LENS_DOES:
        return False
    nothing = found.nothing.evidence
    others = max((o.evidence for o in found.singles if not set(h.ids) & set(o.ids)), default=nothing)
    return h.evidence - max(others, nothing) > FAR_AHEAD * float(np.sqrt(max(h.evidence - nothing, 0.0)))


def _first(h: Hypothesis, found: Conclusion, few: float) -> float:
    doubtful = {Stage.TIME} if found.one_instrument else _OF_THE_SUN
    if absurd(h.fit):
        return NEVER
    if set(h.ids) & found.lacked:
        return LACKED
    if any(t.branch.stands_in for t in h.fit.terms):
        return NAME_STANDING_IN
    if blurs(h.fit):
        return NAME_FIRST_FAR
    if any(stretches(t) for t in h.fit.terms):
        return NAME_STRETCHED
    if _outermost(h.fit.terms) or any(t.mechanism.stage in doubtful or t.tests is not None for t in h.fit.terms):
        return NAME_FIRST_LENS
    if any(t.mechanism.like_a_lens for t in h.fit.terms):
        return NAME_FIRST_BELOW if h.fit.hyper.lens < RIGHT_LENS else NAME_FIRST_LENS
    if _patterned(h):
        return NAME_PATTERN
    if h.wanders:
        usual = NAME_FIRST_CLOUD if h.wanders[-1].wander is CLOUD else few * NAME_FIRST_RANDOM
        return NAME_FIRST if h.last in found.shown else usual
    if found.one_instrument:
        return NAME_FIRST
    return NAME_FIRST_BELOW


def beside(best: Hypothesis, base: Hypothesis, found: Conclusion, new: str, random: bool, share: float = 0.0) -> float:
    """What the further mechanism ``new`` of ``best`` must gain beside ``base``.

    What the forms of ``base`` leave, many could take: so it counts for less, the larger the ``share`` of ``new`` among
    all that could be added (`share_of`); but another lens's errors look like a lens, and a random function takes all.
    """
    added = [t for t in best.fit.terms if t.mechanism.id == new]
    held = HOLDS_LAWS * max(base.evidence - found.nothing.evidence, 0.0)
    left = max(misfit(h, found.nothing) for h in (base, found.best))
    times = THIRD if len(base.ids) > 1 else 1.0
    open_share = min((1.0 - share) / (1.0 - found.sure_beside), 1.0)
    if set(best.ids) >= ONE_PATTERN:
        return NEVER
    if new in found.lacked:
        return times * LACKED + left * open_share
    if any(t.branch.stands_in for t in added):
        return times * NAME_STANDING_IN + left
    left_by_it = _LEFT_BY.get(new) in base.ids and not all(t.branch.of_case for t in added)
    if left_by_it or blurs(best.fit, new):
        return times * NAME_FIRST_FAR + left
    if any(stretches(t) for t in added):
        return times * NAME_STRETCHED + left
    if new == PATTERN.name and _patterned(best):
        return times * NAME_PATTERN + left
    if random and found.pictures:
        return times * NAME_SECOND_EXPOSURES + (0.0 if set(base.ids) <= _NO_LAWS_OF_LEVEL else held)
    if random:
        return times * NAME_SECOND_RANDOM + held + left
    if any(t.tests is not None for t in added):  # the likest of hundreds
        return times * NAME_SECOND_RANDOM + left
    if any(t.mechanism.like_a_lens and not t.branch.of_case for t in added):
        return times * NAME_SECOND_LENS + left
    if new == ChannelGain.id and len(base.ids) == 1 and not found.one_instrument and not _outermost(added):
        return NAME_SECOND_ONE
    least = even(found, new, best) if found.one_instrument else 0.0
    return times * max(_second(added, found, new), least) + left * open_share


def mistaken(base: Hypothesis, new: str, evidence: float, found: Conclusion) -> bool:
    """Whether one of ``base`` is likely what the form of ``new`` leaves, which was added to it.

    It must gain as much over ``new`` alone as if it had been added to that.
    """
    alone = max((h.evidence for h in found.singles if h.ids == (new,)), default=-np.inf)
    left = any(_LEFT_BY.get(t.mechanism.id) == new and not t.branch.of_case for t in base.fit.terms)
    return left and evidence - alone < NAME_FIRST_FAR


def _second(added: list[Term], found: Conclusion, new: str) -> float:
    if found.one_instrument:
        return NAME_SECOND_SPLIT if any(t.mechanism.stage is Stage.SUN_AND_SKY for t in added) else NAME_SECOND
    if _outermost(added) or any(t.mechanism.stage in _OF_THE_SUN and not t.branch.of_case for t in added):
        return NAME_SECOND_LENS
    return NAME_SECOND_ONE if new == ChannelGain.id else NAME_SECOND_BELOW


def even(found: Conclusion, name: str, h: Hypothesis) -> float:
    """What a name of ``h`` gains on one instrument where it is as likely wrong as right [nats].

    What a prediction has wrong adds up from reading to reading, the less, the less it is wrong beside ``h``.
    """
    readings = float(np.clip(found.readings, *EVEN_READINGS)) / 1000.0
    lens = float(np.clip(h.fit.hyper.lens / EVEN_LENS, EVEN_LEAST, 1.0))
    return _EVEN.get(name, EVEN_PICTURE if found.pictures else EVEN) * readings * lens


def least_effect(h: Hypothesis, found: Conclusion) -> float:
    """By how much a name must change the readings (rms, relative), as the first or beside others."""
    alone, further = LEAST_EFFECTS_OF_ARM if h.last in _POINTING else (LEAST_EFFECT_FIRST, LEAST_EFFECT)
    if far_ahead(h, found) or h.last in found.lacked:
        return LEAST_EFFECT_FAR_AHEAD
    return alone if len(h.ids) == 1 else further


def more_as_rival(h: Hypothesis, found: Conclusion) -> float:
    """How many nats more than others a single is asked for: by so much less it speaks against another name."""
    cloud = any(x.wander is CLOUD for x in h.wanders) and CLOUD.name not in found.shown
    return _first(h, found, 1.0) - NAME_FIRST_BELOW if cloud or blurs(h.fit) or absurd(h.fit) else 0.0


def share_of_few(search: Search) -> float:
    """Share of a threshold that guards against ripple: where there are few readings, ripple cannot add up."""
    return float(np.clip(np.sqrt(len(search.scene.readings) / 1000.0), 0.25, 1.0))


def is_a_moment(h: Hypothesis) -> bool:
    """Whether a clock is off by no more than two instruments differ that were never meant to read at one moment."""
    return any(t.mechanism.id == UNREST.name and abs(h.fit.theta[k]) < LEAST_MINUTES for t, k in h.fit.placed)


def misfit(h: Hypothesis, nothing: Hypothesis) -> float:
    """Evidence [nats] that forms as wrong as those of ``h`` may be leave for others to take."""
    gain = max(h.evidence - nothing.evidence, 0.0)
    if of_another_lens(h):
        return MISFIT_LENS * gain
    if _patterned(h) or any(t.mechanism.like_a_lens and not t.branch.of_case for t in h.fit.terms):
        return MISFIT_LIKE_A_LENS * gain
    wrong = max((_wrong(t) for t in h.fit.terms), default=0.0)
    mixed = max((mixture(t.branch.value, h.fit.theta[k:]) for t, k in h.fit.placed), default=0.0)
    share = max(MISFIT_OF_TWO if len(h.ids) > 1 else MISFIT_STRONG, MISFIT_LIKE_A_LENS * mixed)
    return max(min(wrong**2 * gain, MOST_MISFIT), share * gain)


def _outermost(terms: Iterable[Term]) -> bool:
    """Whether one is about an arm's first or last sensor."""
    return any(t.branch.outermost for t in terms)


def _patterned(h: Hypothesis) -> bool:
    """Whether a lens's pattern is read off the recordings."""
    return any(x.wander is PATTERN for x in h.wanders)


def _on_all(fit: Fit) -> bool:
    """Whether one number is added to all readings, by an offset in the dark or a leak of light from no side."""
    return set(fit.ids) <= _ADD and all(len(t.parameters) == 1 for t in fit.terms)


def stretches(term: Term) -> bool:
    """Whether a lens is stretched."""
    return any(p.name == STRETCH_OF for p in term.parameters)


def _wrong(term: Term) -> float:
    """How wrong a form may be, relative to its effect; one that the case brings is the prediction's own."""
    return min(term.mechanism.form_error, OF_CASE) if term.branch.of_case else term.mechanism.form_error


def blurs(fit: Fit, only: str = "") -> bool:
    """Whether a change (of one mechanism ``only``) is hardly more than a blur (`Mechanism.blurs`)."""
    mine = [(t, k) for t, k in fit.placed if only in {"", t.mechanism.id}]
    return any(t.mechanism.blurs(fit.theta[k : k + len(t.parameters)], t.branch) for t, k in mine)


def absurd(fit: Fit) -> bool:
    """Whether a change is one that nothing makes (`Mechanism.absurd`)."""
    return any(t.mechanism.absurd(fit.theta[k : k + len(t.parameters)], t.branch) for t, k in fit.placed)
