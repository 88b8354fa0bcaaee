"""What a run counted, and the photometry that follows: other wall reflectances and bounce limits without a new run."""

from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.simulate.kernels.arrays import RAYS
from analysis.simulate.smooth import Smoother, smooth, smoother
from analysis.simulate.system import System
from labdaq.errors import SimulationError

Floats = NDArray[np.float64]
Field = Literal["far", "near"]


@dataclass(frozen=True)
class Balance:
    """Where the light went [lm, for the first member of each cell]; the parts add up to ``entering`` exactly.

    Attributes
    ----------
    entering
        Fell on the cover.
    reflected_outside, back_to_sky
        Reflected by the cover; came back up through it.
    out
        Left through the aperture.
    absorbed_lenses, absorbed_walls
    cut
        Lost to the bounce limit.
    roulette
        Killed minus raised by Russian roulette: zero on average.
    rays
        Number of rays that fell on the cover.
    """

    entering: float
    reflected_outside: float
    out: float
    back_to_sky: float
    absorbed_lenses: float
    absorbed_walls: float
    cut: float
    roulette: float
    rays: int = 0

    @classmethod
    def of(cls, row: Floats, batches: int) -> "Balance":
        """From the kernel's mean row over batches."""
        names = [f.name for f in fields(cls)][:RAYS]  # the columns are in the order of the attributes
        lumens = {name: float(value) for name, value in zip(names, row, strict=False)}
        return cls(**lumens, rays=round(float(row[RAYS]) * batches))

    def plus(self, other: "Balance") -> "Balance":
        """Of two runs together: means by their rays."""
        rays = self.rays + other.rays
        share = self.rays / max(rays, 1)
        names = [f.name for f in fields(self)][:RAYS]
        mean = {n: share * getattr(self, n) + (1.0 - share) * getattr(other, n) for n in names}
        return Balance(**mean, rays=rays)

    @property
    def residual(self) -> float:
        """What is not accounted for, as a share of what entered (rounding only)."""
        parts = (
            self.reflected_outside + self.out + self.back_to_sky + self.absorbed_lenses + self.absorbed_walls + self.cut
        )
        return (parts + self.roulette - self.entering) / self.entering if self.entering else 0.0


@dataclass(frozen=True)
class Intensity:
    """Luminous intensity in given directions for each member of a source.

    Attributes
    ----------
    candela, uncertainty : shape (T, ...) [cd]
        Estimate and its standard uncertainty from the scatter between batches (statistics alone).
    """

    candela: Floats
    uncertainty: Floats


@dataclass(frozen=True)
class Tally:
    """Lumens counted by a run.

    Attributes
    ----------
    sharp, soft : shape (batches, boot bounces, wall bounces, fields, cells, T) [lm]
        Light of specular paths, and light that a diffuse wall sent, by direction cell. Each batch alone estimates the
        whole; field 0 is far, 1 near (by place on the sphere of ``distance_m``, or on a plane where it is ``flat``).
    """

    sharp: NDArray[Any]
    soft: NDArray[Any]
    system: System
    distance_m: float
    max_bounces: int | None
    balance: Balance
    flat: bool = False

    @property
    def members(self) -> int:
        """Number of suns or skies, T."""
        return int(self.sharp.shape[-1])

    def bounce_weights(self, wall_reflectance: float | None = None, max_bounces: int | None = None) -> Floats:
        """Factor for each (boot bounces, wall bounces) that changes wall reflectance or bounce limit; exact.

        The last class of each axis holds all larger counts and is treated as if they were equal to it; the tally is
        sized so that next to nothing lies there (`overflow`). Raises `SimulationError` for a run with black walls.
        """
        classes = max(self.sharp.shape[1], self.soft.shape[1])
        n = np.arange(self._bounces)
        weights = np.ones((classes, len(n)))
        if wall_reflectance is not None:
            before = self.system.wall.reflectance
            if before == 0.0 and wall_reflectance > 0.0:
                raise SimulationError("a run with black walls cannot be re-weighted to a higher reflectance")
            weights *= (wall_reflectance / before if before else 1.0) ** n
        if max_bounces is not None:
            weights[np.arange(classes)[:, None] + n > max_bounces] = 0.0
        return weights

    def collapsed(self, wall_reflectance: float | None = None, max_bounces: int | None = None) -> tuple[Floats, Floats]:
        """Sharp and soft lumens (batches, fields, cells, T), all bounces added up."""
        weights = self.bounce_weights(wall_reflectance, max_bounces)
        return _added(self.sharp, weights), _added(self.soft, weights)

    def overflow(self) -> float:
        """Share of the light in the last bounce class."""
        total = float(self.sharp[:, :, :, 0].sum() + self.soft[:, :, :, 0].sum())
        last = sum(float(part[:, :, -1, 0].sum()) for part in (self.sharp, self.soft) if part.shape[2] > 1)
        return last / total if total else 0.0

    def flux(self, wall_reflectance: float | None = None, max_bounces: int | None = None) -> tuple[Floats, Floats]:
        """Luminous flux [lm] out of the aperture and its standard uncertainty, shapes (T,)."""
        by_batch = sum(part[:, 0].sum(axis=1) for part in self.collapsed(wall_reflectance, max_bounces))
        values = np.asarray(by_batch)
        return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))

    def intensity(
        self,
        gamma_deg: ArrayLike,
        c_deg: ArrayLike,
        field: Field = "far",
        *,
        wall_reflectance: float | None = None,
        max_bounces: int | None = None,
        smoothing: Smoother | None = None,
        bias: bool = False,
    ) -> Intensity:
        """Intensity [cd] in directions (gamma and C broadcast), shape (T, ...).

        The uncertainty is that of statistics; with ``bias`` it includes what the smoothing may have bent.
        Raises `SimulationError` for the near field of a run that has none.
        """
        if field == "near" and self.sharp.shape[3] < 2:
            raise SimulationError("the run has no near field", "give a distance")
        use = smoothing or smoother(gamma_deg, c_deg, self.sides())
        f = 1 if field == "near" else 0
        weights = self.bounce_weights(wall_reflectance, max_bounces)
        sharp, soft = (_added(hits[:, :, :, f], weights) for hits in (self.sharp, self.soft))
        parts = [smooth(sharp, use.sharp, bias)]
        if soft.any():
            parts.append(smooth(soft, use.soft, bias))
        shape = (self.members, *use.shape)
        candela = np.maximum(sum(part[0] for part in parts), 0.0)
        variance = np.asarray(sum(part[1] ** 2 for part in parts))
        return Intensity(candela.T.reshape(shape), np.sqrt(variance).T.reshape(shape))

    def illuminance(self, x_m: ArrayLike, y_m: ArrayLike) -> tuple[Floats, Floats]:
        """Illuminance [lx] on the plane of a run that is ``flat``, with standard uncertainty, each of shape (T, ...).

        ``x_m`` and ``y_m``: places [m] from below the aperture's centre, east and north; they broadcast.
        Raises `SimulationError` for another run.
        """
        if not self.flat or self.distance_m <= 0.0:
            raise SimulationError("the run counted no plane", "trace with flat=True and a distance")
        x, y = np.broadcast_arrays(np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64))
        h = self.distance_m
        gamma = np.degrees(np.arctan2(np.hypot(x, y), h))
        seen = self.intensity(gamma, np.mod(np.degrees(np.arctan2(-x, y)), 360.0), "near")
        factor = np.cos(np.radians(gamma)) ** 3 / h**2
        return seen.candela * factor, seen.uncertainty * factor

    def by_bounce(
        self,
        gamma_deg: ArrayLike,
        c_deg: ArrayLike,
        field: Field = "far",
        smoothing: Smoother | None = None,
        *,
        boot: bool = False,
    ) -> Floats:
        """Intensity [cd] by number of wall bounces, shape (bounces, T, ...), in fixed neighbourhoods.

        With ``boot``, by number of all bounces, those on a boot included.
        """
        use = smoothing or smoother(gamma_deg, c_deg, self.sides())
        f = 1 if field == "near" else 0
        shape = (self._bounces + (max(self.sharp.shape[1], self.soft.shape[1]) - 1) * boot, self.members)
        total = np.zeros((*shape, *use.shape))
        for hits, operators in ((self.sharp, use.sharp), (self.soft, use.soft)):
            lumens = hits[:, :, :, f].mean(axis=0)  # (boot bounces, bounces, cells, T)
            counted = np.zeros((shape[0], *lumens.shape[2:]))
            for k, part in enumerate(lumens):
                counted[k * boot : k * boot + len(part)] += part
            flat = np.moveaxis(counted, 1, 0).reshape(counted.shape[1], -1)
            values = (operators[min(1, len(operators) - 1)].weights @ flat).reshape(-1, *shape)
            total += np.moveaxis(values, 0, -1).reshape(*shape, *use.shape)
        return total

    @property
    def _bounces(self) -> int:
        return max(int(self.sharp.shape[2]), int(self.soft.shape[2]))

    def sides(self) -> tuple[int, int]:
        """Direction cells along the side of the sharp and of the soft square."""
        return round(self.sharp.shape[4] ** 0.5), round(self.soft.shape[4] ** 0.5)


def _added(hits: NDArray[Any], weights: Floats) -> Floats:
    """Weighted sum over both axes of bounces, without a copy of the counts."""
    batches, classes, counts, *rest = hits.shape
    total = np.zeros((batches, *rest))
    for boot, wall in np.argwhere(weights[:classes, :counts]):
        total += weights[boot, wall] * hits[:, boot, wall]
    return total
