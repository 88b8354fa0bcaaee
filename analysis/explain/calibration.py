"""What a probability is worth: how often names that were as sure proved right.

Claims are decided by probabilities that are careful. Of the 149 that were made blind on the cases of five other
authors, those below .6 were right three times of six, those between .6 and .7 four of six, those between .7 and .9 49
of 50, and those above 85 of 87: so what is told is sharper than what decides.
"""

from typing import Final

from scipy.special import expit, logit

from analysis.explain.conclusion import Conclusion
from analysis.explain.thresholds import RELIABLE

_SHARPER: Final = 1.5
"""Log odds are told as so many times what decides."""
_MOST: Final = 0.97
"""Names as sure as any can be were right this often."""


def stated(probability: float) -> float:
    """The probability to tell for one that decides; both grow together, and .95 of the latter is as sure as can be."""
    return _MOST * float(expit(_SHARPER * logit(min(probability / RELIABLE, 1.0))))


def state(found: Conclusion) -> None:
    """Give names that are told the probability to tell, and leave the rest for what else may be the cause."""
    if found.verdict not in {"explained", "partly-explained"} or not found.probability:
        return
    sure = max(found.probability.values())
    rest = (1.0 - stated(sure)) / (1.0 - sure)
    found.probability = {name: stated(p) for name, p in found.probability.items()}
    found.alternatives = [(ids, rest * p) for ids, p in found.alternatives]
