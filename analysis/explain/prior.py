"""What is thought of parameters before anything is read: usual sizes, and tails for what is unusual.

A prior is Student's t about the centre, as curved there as a Gaussian of ``sigma``: what is six times the usual costs 5
nats and not 18, for nothing tells that what hides in a recording is of the usual size (Gelman et al. 2008, doi
10.1214/08-AOAS191, take a t for coefficients for that reason).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from analysis.cases.model import Floats
from analysis.explain.parameter import Parameter

_FREEDOM = 4.0
_TAIL = _FREEDOM + 1.0
_LESS_AT_CENTRE = float(gammaln(_TAIL / 2.0) - gammaln(_FREEDOM / 2.0) - 0.5 * np.log(_TAIL / 2.0))
"""Logarithm of the density at the centre over a Gaussian's of the same curvature."""


@dataclass(frozen=True)
class Prior:
    """Independent priors of parameters (P,)."""

    centre: Floats
    sigma: Floats

    @classmethod
    def of(cls, parameters: tuple[Parameter, ...]) -> "Prior":
        """As the parameters have it."""
        return cls(np.array([p.centre for p in parameters]), np.array([p.sigma for p in parameters]))

    def value(self, theta: Floats) -> float:
        """Twice the negative log density at ``theta`` (P,), over that at the centre."""
        return float(_TAIL * np.sum(np.log1p(((theta - self.centre) / self.sigma) ** 2 / _TAIL)))

    def precision(self, theta: Floats) -> Floats:
        """Of the Gaussian that has the prior's slope at ``theta``; shape (P,)."""
        return np.asarray(1.0 / (self.sigma**2 + (theta - self.centre) ** 2 / _TAIL))

    def pull(self, theta: Floats) -> Floats:
        """Slope of the log density at ``theta``, towards the centre; shape (P,)."""
        return (self.centre - theta) * self.precision(theta)

    @property
    def log_density(self) -> float:
        """At the centre, over that of a Gaussian which is so curved there and has a volume of one."""
        return len(self.sigma) * _LESS_AT_CENTRE - float(np.sum(np.log(self.sigma)))
