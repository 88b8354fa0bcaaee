"""What the reduction of a goniophotometer scan starts from: plain arrays, one entry per reading."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labdaq.errors import DataError, Problems

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def _floats(values: ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(values, dtype=np.float64))


@dataclass(frozen=True, kw_only=True)
class GonioReadings:
    """Illuminances of the arm's sensors; all arrays have shape (n,).

    Attributes
    ----------
    gamma_deg, c_deg
        Where the sensor was [deg].
    sensor
        Number of the channel, from 0.
    lux
        The reading [lx]; NaN where there is none.
    time_s
        Middle of the integration [s], on the same scale as the roof's readings.
    uncertainty_lux
        Standard uncertainty of one reading without calibration [lx]; NaN where unknown.
    """

    gamma_deg: Floats
    c_deg: Floats
    sensor: Ints
    lux: Floats
    time_s: Floats
    uncertainty_lux: Floats

    @classmethod
    def of(
        cls,
        gamma_deg: ArrayLike,
        c_deg: ArrayLike,
        lux: ArrayLike,
        time_s: ArrayLike,
        sensor: ArrayLike | None = None,
        uncertainty_lux: ArrayLike | None = None,
    ) -> "GonioReadings":
        """Make readings of lists; without ``sensor`` each gamma has its own, in rising order.

        Raises
        ------
        DataError
            Lengths differ, or an angle or a time is not finite; all mistakes at once.
        """
        arrays = {
            "gamma_deg": _floats(gamma_deg),
            "c_deg": _floats(c_deg),
            "lux": _floats(lux),
            "time_s": _floats(time_s),
        }
        n = len(arrays["lux"])
        arrays["uncertainty_lux"] = np.full(n, np.nan) if uncertainty_lux is None else _floats(uncertainty_lux)
        problems = Problems("goniometer readings")
        for name, array in arrays.items():
            if array.shape != (n,):
                problems.add(name, f"has {array.size} entries, lux has {n}")
            if name in ("gamma_deg", "c_deg", "time_s") and not np.isfinite(array).all():
                problems.add(name, f"entry {int(np.flatnonzero(~np.isfinite(array))[0])} is not a finite number")
        if n == 0:
            problems.add("lux", "there is no reading")
        problems.raise_if_any(DataError)
        channel = np.unique(arrays["gamma_deg"], return_inverse=True)[1] if sensor is None else np.asarray(sensor)
        return cls(sensor=channel.astype(np.intp), **arrays)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Which readings have a value."""
        return np.isfinite(self.lux)


@dataclass(frozen=True, kw_only=True)
class RoofReadings:
    """Global horizontal illuminance on the roof during the scan.

    Attributes
    ----------
    time_s : shape (m,)
        Increasing [s].
    lux : shape (m,)
        All positive [lx].
    relative_repeatability
        Standard uncertainty of one reading against the next, relative; the meter's calibration cancels.
    """

    time_s: Floats
    lux: Floats
    relative_repeatability: float = 0.002

    def __post_init__(self) -> None:
        problems = Problems("roof readings")
        if self.time_s.shape != self.lux.shape or self.time_s.ndim != 1 or not self.time_s.size:
            problems.add("time_s", f"shape {self.time_s.shape} beside lux of shape {self.lux.shape}")
        elif not (np.isfinite(self.time_s).all() and np.all(np.diff(self.time_s) > 0)):
            problems.add("time_s", "times must be finite and increase")
        if not np.all(self.lux > 0):  # false for NaN
            problems.add("lux", "every roof reading must be positive")
        problems.raise_if_any(DataError)

    def at(self, time_s: Floats) -> Floats:
        """Illuminance between readings, linear in time [lx]; held constant beyond the ends."""
        return np.interp(time_s, self.time_s, self.lux)

    def bend(self) -> float:
        """Largest relative error of linear interpolation: an eighth of the second difference over the value."""
        if len(self.lux) < 3:
            return 0.0
        second = np.abs(self.lux[2:] - 2 * self.lux[1:-1] + self.lux[:-2])
        return float(np.max(second / self.lux[1:-1]) / 8.0)


@dataclass(frozen=True, kw_only=True)
class DarkReadings:
    """Readings with the aperture covered.

    Attributes
    ----------
    sensor, lux : shape (k,)
        Channel and reading [lx].
    """

    sensor: Ints
    lux: Floats

    def offset(self, sensors: Ints) -> tuple[Floats, Floats]:
        """Mean dark reading and its standard uncertainty [lx] for each of the given channels.

        Raises
        ------
        DataError
            A channel was never read in the dark.
        """
        known = np.unique(self.sensor)
        missing = np.setdiff1d(sensors, known)
        if missing.size:
            raise DataError(f"no dark reading of sensor(s) {', '.join(map(str, missing))}")
        mean, error = np.zeros(known.max() + 1), np.zeros(known.max() + 1)
        for channel in known:
            values = self.lux[self.sensor == channel]
            mean[channel] = values.mean()
            # with a single dark reading its noise is unknown; its size is the cautious guess
            error[channel] = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else abs(values[0])
        return mean[sensors], error[sensors]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Factors that turn the channels' readings into lux.

    Attributes
    ----------
    factor : shape (s,)
        By channel.
    relative_uncertainty : shape (s,)
        Standard, relative, by channel.
    certificate
        Where the factors come from.
    """

    factor: Floats
    relative_uncertainty: Floats
    certificate: str = ""
