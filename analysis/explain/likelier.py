"""How much likelier one name is than another that does alike, for what the two are [log odds]."""

from collections.abc import Iterable
from typing import Final

from analysis.explain import asked
from analysis.explain.conclusion import Conclusion
from analysis.explain.families import UNREST
from analysis.explain.hypothesis import Hypothesis
from analysis.explain.mechanisms.aureole import CircumsolarAureole
from analysis.explain.mechanisms.goniometer import COffset, NearField
from analysis.explain.mechanisms.lens import LensOrientation
from analysis.explain.mechanisms.roof_meters import MeterCosine, MeterTilt
from analysis.explain.mechanisms.room import RoomInterreflection, StrayLight
from analysis.explain.mechanisms.sensors import DarkOffset, Nonlinearity
from analysis.explain.odds import (
    ARM_OR_LENSES,
    AS_WELL,
    COSINE_OR_BENT,
    FLATTENS,
    LACKED_ODDS,
    LATE_AS_TURNED,
    LATE_OR_TURNED,
    LIKELIER,
    NEAR_OR_BLURRED,
    OF_CASE_ODDS,
    ROOM_OR_LEAK,
    TILTED_OR_LATE,
    UNSEEN,
)
from analysis.explain.told_form import flattens, flattens_all, of_optics

_ENDS: Final = frozenset({"saturation", "meter-range-limit"})
_OF_ONE_INSTRUMENT: Final[dict[tuple[str, ...], float]] = {
    (MeterTilt.id, UNREST.name): TILTED_OR_LATE,
    (MeterCosine.id, Nonlinearity.id): COSINE_OR_BENT,
    (MeterCosine.id, DarkOffset.id): COSINE_OR_BENT,
}


def than(found: Conclusion, rival: tuple[str, ...]) -> float:
    """How much likelier the first name is than a rival that gains as much; of a set, than what it has in its place."""
    instead = tuple(m for m in rival if m not in found.best.ids)
    return _ends(found, instead) + _brought(found, instead) + _beside(found, instead)


def _brought(found: Conclusion, rival: tuple[str, ...]) -> float:
    """How much likelier the first name is than a rival, where the case brings the change that one of them makes.

    The other's must be a change of optics that we traced on a lens like the case's, or put into a formula. A rival that
    the case brings must do nearly as well (`AS_WELL`): were it true, its form would take all there is.
    """
    singles = {h.ids[0]: h for h in found.singles if len(h.ids) == 1 and len(h.fit.terms) == 1}
    both = [singles.get(found.best.first), singles.get(rival[0]) if len(rival) == 1 else None]
    own = [h is not None and h.of_case for h in both]
    loose = [h is not None and not h.of_case and of_optics(h.fit.terms[0]) for h in both]
    gains = [0.0 if h is None else h.evidence - found.nothing.evidence for h in both]
    as_well = gains[1] > AS_WELL * gains[0]
    return OF_CASE_ODDS * (float(own[0] and loose[1]) - float(own[1] and loose[0] and as_well))


def _ends(found: Conclusion, rival: tuple[str, ...]) -> float:
    """How much likelier the first name is than a rival, where one is a range that ends and the other flattens alike.

    Neither, if that end makes all readings too small.
    """
    bent = next((h for h in found.singles if h.ids == (Nonlinearity.id,)), None)
    names = {found.best.first, *rival}
    if bent is None or not flattens(bent) or len(rival) > 1 or not names & _ENDS or Nonlinearity.id not in names:
        return 0.0
    if any(h.ids and set(h.ids) <= names and flattens_all(h) for h in (found.best, *found.singles)):
        return 0.0
    return FLATTENS if found.best.first in _ENDS else -FLATTENS


def _beside(found: Conclusion, rival: tuple[str, ...]) -> float:
    """How much likelier the first name is than a rival for what they are (`by_itself`)."""
    first = found.best.first
    return by_itself(found, first, rival) - (by_itself(found, rival[0], (first,)) if len(rival) == 1 else 0.0)


def beforehand(found: Conclusion, names: frozenset[str]) -> float:
    """Log odds of names that are added to others, against any: of what the prediction lacks, or of no instrument."""
    return LACKED_ODDS * bool(names & found.lacked) - unseen(found, names)


def beside(h: Hypothesis, other: Hypothesis) -> float:
    """How much likelier what one set adds to a first name is than what another adds."""
    names = h.last, other.last
    if Nonlinearity.id not in names or not _ENDS & set(names):
        return 0.0
    bent, end, sign = (h, other, -1.0) if names[0] == Nonlinearity.id else (other, h, 1.0)
    return sign * FLATTENS if flattens(bent) and not flattens_all(end) else 0.0


def by_itself(found: Conclusion, name: str, other: tuple[str, ...]) -> float:
    """Log odds of one name against another that does alike, before any evidence.

    On a roof a tilt for a clock, or a cosine response for a bent one; below a skylight a near field for a sun without a
    disc, a room for a leak that follows the daylight, a late clock for an arm's azimuth, that for lenses turned below
    long wells alone; and what the prediction lacks by the case's own account for anything.
    """
    pair = name, *other
    if found.one_instrument:
        return _OF_ONE_INSTRUMENT.get(pair, 0.0)
    alone = {h.ids[0]: h for h in found.singles if len(h.ids) == 1}
    if name in found.lacked:
        return LACKED_ODDS
    if pair == (NearField.id, CircumsolarAureole.id) and other[0] in alone:
        return NEAR_OR_BLURRED if asked.blurs(alone[other[0]].fit) else 0.0
    if pair == (RoomInterreflection.id, StrayLight.id) and other[0] in alone:
        return ROOM_OR_LEAK if any(t.branch.facts for t in alone[other[0]].fit.terms) else 0.0
    if pair == (COffset.id, LensOrientation.id) and other[0] in alone:
        return ARM_OR_LENSES if any(map(LensOrientation.is_an_arms, alone[other[0]].fit.terms)) else 0.0
    if pair == (UNREST.name, COffset.id) and set(pair) <= set(alone):
        late, turned = (alone[m].evidence - found.nothing.evidence for m in pair)
        return LATE_OR_TURNED if late > LATE_AS_TURNED * turned else 0.0
    return 0.0


def seen(found: Conclusion, name: str, other: tuple[str, ...]) -> float:
    """Log odds of one name against another for what was read: an instrument that no reading is of is less likely."""
    return unseen(found, other) - unseen(found, (name,))


def unseen(found: Conclusion, names: Iterable[str]) -> float:
    """Log odds against names of instruments that no reading is of: they act on others by the sun's share alone."""
    odds = (LIKELIER if name == MeterTilt.id else UNSEEN for name in names if name in found.unseen)
    return max(odds, default=0.0)
