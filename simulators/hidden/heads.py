"""What a photometric head and its electronics make of the light that reaches them."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HeadFaults:
    """How heads differ from perfect ones; all neutral by default. Levels are in lx at the head.

    Attributes
    ----------
    dark_lx
        Reading in the dark.
    gains
        Factor per head index, for heads whose sensitivity is off.
    curve, curve_form, curve_reference_lx
        Departure from proportionality: with form ``power`` the reading is proportional to light^(1 + curve), equal
        to it at the reference; with ``parabola`` it gains curve times level over reference; with ``ranges`` it is
        (1 + curve) times too high above each third, ninth... of the reference (gain steps of an amplifier).
    end_lx, end_form
        Level at which the head saturates (0: never), and how: ``soft`` E / (1 + E / end), ``exponential`` end (1 -
        exp(-E / end)), ``clip``, or ``knee`` (proportional to 60 % of the end, then bending over to it).
    response, response_form
        Loss at 60 degrees of incidence relative to the cosine, and its course: ``sine2``, ``quartic`` or ``step``.
    corrected_tilt
        Share of γ by which the heads are mounted turned away from the aperture; the laboratory corrects for the
        cosine of that, so that only the error of their response remains (0: the error acts at the true incidence).
    lag_s
        Time constant [s] of the reading; matters only if heads are read in quick succession.
    warming_per_k, kelvin_per_hour
        Temperature coefficient, and how fast the heads warm up from the first record of a scan.
    blue
        Relative excess of the reading of skylight over that of sunlight (spectral mismatch).
    """

    dark_lx: float = 0.0
    gains: dict[int, float] = field(default_factory=dict)
    curve: float = 0.0
    curve_form: str = "power"
    curve_reference_lx: float = 1000.0
    end_lx: float = 0.0
    end_form: str = "soft"
    response: float = 0.0
    response_form: str = "sine2"
    corrected_tilt: float = 0.0
    lag_s: float = 0.0
    warming_per_k: float = 0.0
    kelvin_per_hour: float = 0.0
    blue: float = 0.0


def angular_response(cosine: Floats, loss_at_60: float, form: str) -> Floats:
    """Response relative to the cosine at an incidence, 1 at normal.

    Courses after published f2 curves of illuminance heads (they differ in where the loss begins).
    """
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    unit = math.radians(60.0)
    if form == "sine2":
        shape = np.sin(angle) ** 2 / math.sin(unit) ** 2
    elif form == "quartic":
        shape = (angle / unit) ** 4
    elif form == "step":
        shape = 2.0 / (1.0 + np.exp(-(angle - unit) / math.radians(8.0)))
        shape = shape - 2.0 / (1.0 + math.exp(unit / math.radians(8.0)))
    else:
        raise ValueError(f"no such course of an angular response: {form}")
    return np.maximum(0.0, 1.0 - loss_at_60 * shape)


def bent(level: Floats, faults: HeadFaults) -> Floats:
    """Apply the departure from proportionality."""
    if faults.curve == 0.0:
        return level
    relative = np.maximum(level, 1e-9) / faults.curve_reference_lx
    if faults.curve_form == "power":
        return level * relative**faults.curve
    if faults.curve_form == "parabola":
        return level * (1.0 + faults.curve * relative)
    if faults.curve_form == "ranges":
        steps = np.floor(np.log(relative) / math.log(3.0))
        return level * (1.0 + faults.curve) ** np.clip(steps + 4.0, 0.0, 6.0)
    raise ValueError(f"no such form of a curve: {faults.curve_form}")


def ended(level: Floats, end_lx: float, form: str) -> Floats:
    """Apply the end of the range."""
    if end_lx <= 0.0:
        return level
    relative = level / end_lx
    if form == "soft":
        return level / (1.0 + relative)
    if form == "exponential":
        return -end_lx * np.expm1(-relative)
    if form == "clip":
        return np.minimum(level, end_lx)
    if form == "knee":
        above = np.maximum(0.0, relative - 0.6) / 0.4
        return np.where(relative < 0.6, level, end_lx * (0.6 + 0.4 * np.tanh(above)))
    raise ValueError(f"no such form of an end: {form}")


def read(level: Floats, sky_share: Floats, heads: NDArray[np.int64], seconds: Floats, faults: HeadFaults) -> Floats:
    """Readings [lx] without noise of ``level`` [lx], in the order of time.

    Parameters
    ----------
    level, sky_share, heads, seconds : shape (n,)
        Illuminance, share of it that came from the sky, index of the head, and time since the first record of the
        scan [s].
    """
    value = level * (1.0 + faults.blue * (sky_share - 0.5))
    value = ended(bent(value, faults), faults.end_lx, faults.end_form)
    if faults.warming_per_k:
        value = value * (1.0 + faults.warming_per_k * faults.kelvin_per_hour * seconds / 3600.0)
    if faults.gains:
        factors = np.ones(int(heads.max()) + 1)
        for head, factor in faults.gains.items():
            if head < len(factors):
                factors[head] = factor
        value = value * factors[heads]
    value = value + faults.dark_lx
    return lagging(value, seconds, faults.lag_s) if faults.lag_s else value


def lagging(value: Floats, seconds: Floats, lag_s: float) -> Floats:
    """Each reading remembers the one before it: an exponential with time constant ``lag_s``, along the records."""
    result = value.copy()
    for i in range(1, len(value)):
        memory = math.exp(-max(0.0, float(seconds[i] - seconds[i - 1])) / lag_s)
        result[i] = value[i] + memory * (result[i - 1] - value[i])
    return result
