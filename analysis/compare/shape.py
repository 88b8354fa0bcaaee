"""How far two distributions differ in light and in shape, and how much of that the recording's noise explains."""

from dataclasses import dataclass

import numpy as np

from analysis.cases.model import Floats


@dataclass(frozen=True)
class Agreement:
    """Measured against simulated intensity over the same directions.

    Attributes
    ----------
    directions
        How many.
    flux_measured, flux_simulated
        Through the solid angle they stand for [lm].
    flux_ratio, flux_ratio_uncertainty
        Simulated over measured; standard uncertainty from the recording's noise.
    shape_difference
        Half the integral of the absolute difference of both distributions, each divided by its own flux: the share of
        the light that goes elsewhere, 0 (same shape) to 1 (nothing in common).
    shape_uncertainty
        Its standard uncertainty from the recording's noise.
    shape_noise
        What it would be on average if the shapes were the same and the recording noisy.
    rms_percent
        Root mean square difference over root mean square recording, over the solid angle [%].
    rms_scaled_percent
        The same after the simulation is scaled by the factor that makes it least [%].
    scale
        That factor.
    chi2_per_direction
        Mean squared difference in units of the noise; NaN where noise is not given.
    """

    directions: int
    flux_measured: float
    flux_simulated: float
    flux_ratio: float
    flux_ratio_uncertainty: float
    shape_difference: float
    shape_uncertainty: float
    shape_noise: float
    rms_percent: float
    rms_scaled_percent: float
    scale: float
    chi2_per_direction: float


def agreement(measured: Floats, noise: Floats, simulated: Floats, solid_angle: Floats) -> Agreement | None:
    """Compare intensities (D,) [cd] with their noise [cd] and solid angles [sr].

    Directions without one of both are left out; ``None`` when none is left, or no light is in one of them.

    Notes
    -----
    The shape difference D = ½ Σ |m_k - s_k| with m_k = Ω_k I_k / Φ is the total variation distance. A small change of
    reading k changes it by ½ Ω_k/Φ (t_k - Σ t_j m_j), where t_k is the slope of the expected absolute value of a
    difference d with Gaussian noise σ, erf(d / (σ √2)) (the folded normal distribution: Leone, Nelson and Nottingham
    1961, Technometrics 3:543); uncorrelated noise adds in squares.
    """
    there = np.isfinite(measured) & np.isfinite(simulated)
    i, u, s, w = measured[there], noise[there], simulated[there], solid_angle[there]
    flux, predicted = float(w @ i), float(w @ s)
    if not (flux > 0 and predicted > 0):
        return None
    ratio = predicted / flux
    d = w * (i / flux - s / predicted)
    sigma = w * u / flux
    slope = _slope(d, sigma)
    change = 0.5 * w / flux * (slope - float(slope @ (w * i)) / flux)
    square = float(w @ (i * i))
    scale = float(w @ (i * s)) / float(w @ (s * s))
    return Agreement(
        directions=int(there.sum()),
        flux_measured=flux,
        flux_simulated=predicted,
        flux_ratio=ratio,
        flux_ratio_uncertainty=ratio * float(np.linalg.norm(w * u)) / flux,
        shape_difference=0.5 * float(np.abs(d).sum()),
        shape_uncertainty=float(np.linalg.norm(change * u)),
        shape_noise=0.5 * float(np.sqrt(2.0 / np.pi) * sigma.sum()),
        rms_percent=100.0 * float(np.sqrt(w @ (s - i) ** 2 / square)),
        rms_scaled_percent=100.0 * float(np.sqrt(w @ (scale * s - i) ** 2 / square)),
        scale=scale,
        chi2_per_direction=float(np.mean(((s - i) / u) ** 2)) if np.all(u > 0) else float("nan"),
    )


def _slope(d: Floats, sigma: Floats) -> Floats:
    """erf(d / (σ √2)); the sign where there is no noise."""
    from scipy.special import erf

    with np.errstate(divide="ignore", invalid="ignore"):
        soft = erf(d / (sigma * np.sqrt(2.0)))
    return np.asarray(np.where(sigma > 0, soft, np.sign(d)), dtype=np.float64)


@dataclass(frozen=True)
class Rings:
    """Difference against gamma: (simulated - measured) / measured of the means over C, all arrays of shape (G,).

    Attributes
    ----------
    gamma_deg
        [deg]
    percent, uncertainty
        Of the ring as a whole, and its standard uncertainty from the recording's noise [%].
    lowest, highest
        Over the single planes [%].
    """

    gamma_deg: Floats
    percent: Floats
    uncertainty: Floats
    lowest: Floats
    highest: Floats


def rings(gamma: Floats, measured: Floats, noise: Floats, simulated: Floats) -> Rings:
    """The difference against gamma (report, figure 90); a negative number says that the simulation is too low.

    Arrays have shape (D,); rings without light in the recording give NaN.
    """
    there = np.isfinite(measured) & np.isfinite(simulated)
    found: list[tuple[float, ...]] = []
    for g in np.unique(gamma):
        k = there & (gamma == g)
        i, s, u = measured[k], simulated[k], noise[k]
        total = float(i.sum())
        if total <= 0:
            found.append((float(g), *[float("nan")] * 4))
            continue
        lit = i > 0
        single = 100.0 * (s[lit] - i[lit]) / i[lit]
        value = float(s.sum()) / total
        error = 100.0 * value * float(np.linalg.norm(u)) / total
        found.append((float(g), 100.0 * (value - 1.0), error, float(single.min()), float(single.max())))
    columns = np.array(found, dtype=np.float64).reshape(-1, 5).T
    return Rings(*columns)
