"""Random effects and unnamed structure, as covariances.

Some physics has no formula for its values, only for how they go together: a cloud that drifts is a smooth random
function of time. The same form serves for what the catalogue does not hold: "some smooth function of direction,
fixed in the room, that nobody has named" is a hypothesis like any other and can win against the named ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.fit import Extra
from analysis.explain.mechanisms.base import Mechanism
from analysis.explain.scene import Scene

Columns = Callable[[Scene, float], Floats]
"""Independent unit effects (N, K) of a random function with a correlation length, on a scene's rows (`along`)."""

_OF_THE_FORM = 0.3
"""Standard deviation of the logarithm of a random effect's size: two recordings, or two forms, differ by that."""


@dataclass(frozen=True)
class Wander:
    """A random effect: amplitude times a correlated random function of some coordinates.

    Attributes
    ----------
    name
        Id of a catalogue mechanism, or the name of an unnamed family.
    along
        The coordinates it is a function of, in words.
    forms
        Its effects; where it may have several forms (smooth, rough), each of them.
    amplitudes, lengths
        Relative standard deviations and correlation lengths to try.
    mechanism
        The catalogue's mechanism, or ``None`` for unnamed structure.
    """

    name: str
    along: str
    forms: tuple[Columns, ...]
    amplitudes: tuple[float, ...]
    lengths: tuple[float, ...]
    mechanism: Mechanism | None = None

    def sizes(self) -> list["Wandering"]:
        """The effect in each of its forms, at each amplitude and length."""
        return [Wandering(self, a, x, k) for k in range(len(self.forms)) for x in self.lengths for a in self.amplitudes]


@dataclass(frozen=True)
class Wandering:
    """A random effect of one form and size.

    Attributes
    ----------
    wander
        The random effect.
    amplitude, length
        Relative standard deviation, and correlation length.
    form
        Which of its forms.
    log_sd
        Standard deviations of the logarithms of amplitude and length.
    """

    wander: Wander
    amplitude: float
    length: float = 1.0
    form: int = 0
    log_sd: tuple[float, float] = (_OF_THE_FORM, _OF_THE_FORM)

    def extra(self, scene: Scene) -> Extra:
        """The effect on a scene."""
        return Extra(scene.remember(self.wander.forms[self.form], self.length), self.amplitude)

    @property
    def told(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Amplitude and length with their standard uncertainties: moments of log-normal distributions."""
        return _log_normal(self.amplitude, self.log_sd[0]), _log_normal(self.length, self.log_sd[1])


def _log_normal(median: float, log_sd: float) -> tuple[float, float]:
    """Mean and standard deviation of a quantity whose logarithm is normal."""
    mean = median * float(np.exp(log_sd**2 / 2.0))
    return mean, mean * float(np.sqrt(np.expm1(log_sd**2)))


def likeliest(sizes: Sequence[Wandering], weights: Floats) -> Wandering:
    """The form that carries most of ``weights`` (K,; their sum is one), at the mean of its sizes, and how sure that is.

    Amplitude and length vary by factors, so means and deviations are those of logarithms. They hold what other forms
    would tell, and half a step of the sizes that are tried.
    """
    wander = sizes[0].wander
    forms = np.array([x.form for x in sizes])
    best = int(np.argmax(np.bincount(forms, weights=weights)))
    logs = np.log([(x.amplitude, x.length) for x in sizes])
    mean = np.average(logs, axis=0, weights=weights * (forms == best))
    steps = np.array([_step(wander.amplitudes), _step(wander.lengths)])
    sd = np.sqrt(weights @ (logs - mean) ** 2 + steps**2 / 12.0 + _OF_THE_FORM**2)
    amplitude, length = np.exp(mean)
    return Wandering(wander, float(amplitude), float(length), best, (float(sd[0]), float(sd[1])))


def _step(tried: tuple[float, ...]) -> float:
    """Mean step of the logarithm between values that are tried; of one alone, as if its neighbours were thrice it."""
    return float(np.log(tried[-1] / tried[0])) / (len(tried) - 1) if len(tried) > 1 else float(np.log(3.0))
