"""Parameters of mechanisms, with plausible ranges and priors."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One number of a mechanism.

    Attributes
    ----------
    name, unit, meaning
        As reported.
    low, high
        Plausible range; fits do not leave it.
    sigma
        Usual size: of the Gaussian that the prior about ``centre`` is as curved as (`prior.Prior`; half of it where
        ``low == centre``).
    starts
        Values from which fits are started.
    per_unit
        Factor from the fitted number to the reported one (the fit works in lx, cd, cd/m²).
    direction
        Whether it is a direction, whose number is no size.
    """

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    sigma: float
    starts: tuple[float, ...]
    centre: float = 0.0
    per_unit: float = 1.0
    direction: bool = False

    @property
    def one_sided(self) -> bool:
        """Whether the prior is the half that begins at ``low``."""
        return self.low >= self.centre

    @property
    def width(self) -> float:
        """Typical size of a step in this parameter."""
        return min(self.sigma, (self.high - self.low) / 4)
