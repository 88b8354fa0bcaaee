"""Laplace's approximation to the evidence about a fit.

MacKay 2003, Information Theory, Inference, and Learning Algorithms, ch. 27-28.
"""

import numpy as np
from scipy.special import log_ndtr

from analysis.cases.model import Floats
from analysis.explain.parameter import Parameter
from analysis.explain.prior import Prior


def laplace(gram: Floats, log_det: float, theta: Floats, parameters: tuple[Parameter, ...]) -> float:
    """Log evidence of a fit at some sizes, one Newton step beyond its parameters included.

    ``gram`` is that of the Jacobian's columns and the residual, ``log_det`` the covariance's.
    One-sided priors have twice the density, and the part of the posterior beyond the end is cut off.
    """
    n = len(parameters)
    base = -0.5 * (gram[n, n] + log_det)
    if n == 0:
        return float(base)
    prior = Prior.of(parameters)
    precision = precision_of(gram, prior, theta)
    slope = gram[:n, n] + prior.pull(theta)
    step = np.linalg.solve(precision, slope)
    step = inside(theta + step, parameters) - theta
    gain = slope @ step - 0.5 * step @ precision @ step
    _, log_det = np.linalg.slogdet(precision)
    value = base + prior.log_density - 0.5 * prior.value(theta) + gain - 0.5 * log_det
    spread = np.sqrt(np.diag(np.linalg.inv(precision)))
    for k, p in enumerate(parameters):
        if p.one_sided:
            value += np.log(2.0) + log_ndtr((theta[k] + step[k] - p.low) / spread[k])
    return float(value)


def precision_of(gram: Floats, prior: Prior, theta: Floats) -> Floats:
    """Of the parameters (P, P): what the readings say (``gram``'s last is the residual's) and what was thought."""
    return np.asarray(gram[:-1, :-1] + np.diag(prior.precision(theta)))


def inside(theta: Floats, parameters: tuple[Parameter, ...]) -> Floats:
    """Parameters (P,) kept within their ranges."""
    if not parameters:
        return theta
    return np.clip(theta, [p.low for p in parameters], [p.high for p in parameters])
