"""How clear and how bright a sky is: the two numbers that choose a Perez sky.

Clearness ``epsilon`` and brightness ``delta`` are defined on irradiances (Perez, Ineichen, Seals, Michalsky and
Stewart 1990, Solar Energy 44:271, eqs. 1 and 2). A station that measures illuminance gets there by the luminous
efficacies of the same paper (eqs. 7 and 8, table 4), which depend on epsilon and delta in turn, so they are iterated.
The table is quoted from two copies in Radiance (gendaylit.c and gendaymtx.c), which agree.
"""

import math
from dataclasses import dataclass
from typing import Final

from labdaq.errors import DataError

EPSILON_EDGES: Final = (1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)
"""Upper edges of the first seven clearness classes; the eighth is open."""

EPSILON_RANGE: Final = (1.0, 12.01)
DELTA_RANGE: Final = (0.01, 0.6)
"""Where the models were fitted (the limits gendaylit uses); beyond them values are clamped and flagged."""

SOLAR_CONSTANT_W_M2: Final = 1367.0
SOLAR_ILLUMINANCE_LX: Final = 127_500.0
"""Extraterrestrial normal irradiance and illuminance, as Radiance takes them."""

_DIFFUSE_EFFICACY: Final = (  # a, b (per cm of water), c (cos Z), d (ln delta); lm/W
    (97.24, -0.46, 12.00, -8.91),
    (107.22, 1.15, 0.59, -3.95),
    (104.97, 2.96, -5.53, -8.77),
    (102.39, 5.59, -13.95, -13.90),
    (100.71, 5.94, -22.75, -23.74),
    (106.42, 3.83, -36.15, -28.83),
    (141.88, 1.90, -53.24, -14.03),
    (152.23, 0.35, -45.27, -7.98),
)
_BEAM_EFFICACY: Final = (  # a, b (per cm of water), c (exp(5.73 Z - 5)), d (delta); lm/W
    (57.20, -4.55, -2.98, 117.12),
    (98.99, -3.46, -1.21, 12.38),
    (109.83, -4.90, -1.71, -8.81),
    (110.34, -5.84, -1.99, -4.56),
    (106.36, -3.97, -1.75, -6.16),
    (107.19, -1.25, -1.51, -26.73),
    (105.75, 0.77, -1.26, -34.44),
    (101.18, 1.58, -1.10, -8.29),
)


@dataclass(frozen=True, slots=True)
class Condition:
    """Clearness and brightness of a sky, inside the range of the models.

    Attributes
    ----------
    epsilon, delta
        After clamping.
    flags
        What had to be done: ``epsilon-clamped``, ``delta-clamped``, ``sun-low`` (sun below the horizon, its zenith
        angle taken as 90°), ``efficacy-not-settled``.
    """

    epsilon: float
    delta: float
    flags: tuple[str, ...] = ()


def clearness_class(epsilon: float) -> int:
    """Class 0 (overcast) to 7 (very clear) of a clearness."""
    return sum(epsilon >= edge for edge in EPSILON_EDGES)


def air_mass(zenith_rad: float) -> float:
    """Relative optical air mass at a geometric zenith angle [rad] up to 90° (Kasten 1966)."""
    return 1.0 / (math.cos(zenith_rad) + 0.15 * math.pow(93.885 - math.degrees(zenith_rad), -1.253))


def diffuse_efficacy(condition: Condition, zenith_rad: float, water_cm: float = 2.0) -> float:
    """Luminous efficacy of diffuse light [lm/W]; ``water_cm`` is the precipitable water of the air."""
    a, b, c, d = _DIFFUSE_EFFICACY[clearness_class(condition.epsilon)]
    return a + b * water_cm + c * math.cos(zenith_rad) + d * math.log(condition.delta)


def beam_efficacy(condition: Condition, zenith_rad: float, water_cm: float = 2.0) -> float:
    """Luminous efficacy of the beam [lm/W], not below 0."""
    a, b, c, d = _BEAM_EFFICACY[clearness_class(condition.epsilon)]
    return max(0.0, a + b * water_cm + c * math.exp(5.73 * zenith_rad - 5.0) + d * condition.delta)


def from_irradiances(
    normal_w_m2: float, diffuse_w_m2: float, sun_altitude_deg: float, distance_factor: float = 1.0
) -> Condition:
    """Condition of a sky with beam normal and diffuse horizontal irradiance [W/m²].

    Parameters
    ----------
    sun_altitude_deg
        Geometric altitude [deg].
    distance_factor
        (r0/r)² of the day, see `analysis.sky.sun.distance_factor`; without it delta is up to 3.5 % off.

    Raises `DataError` when an irradiance is negative or not finite, or the diffuse one is zero.
    """
    return _condition(normal_w_m2, diffuse_w_m2, sun_altitude_deg, SOLAR_CONSTANT_W_M2 * distance_factor)


def from_illuminances(
    normal_lx: float,
    diffuse_lx: float,
    sun_altitude_deg: float,
    distance_factor: float = 1.0,
    *,
    method: str = "efficacy",
    water_cm: float = 2.0,
) -> Condition:
    """Condition of a sky with beam normal and diffuse horizontal illuminance [lx].

    Parameters
    ----------
    method
        ``efficacy`` divides by Perez's luminous efficacies, iterated until they settle. ``illuminance`` puts the
        illuminances straight into the definitions, with 127.5 klx for the solar constant: no iteration, a few per
        cent lower in epsilon.
    water_cm
        Precipitable water [cm].

    Raises `DataError` as `from_irradiances` does, `ValueError` for another method.
    """
    extraterrestrial = SOLAR_ILLUMINANCE_LX * distance_factor
    condition = _condition(normal_lx, diffuse_lx, sun_altitude_deg, extraterrestrial)
    if method == "illuminance":
        return condition
    if method != "efficacy":
        raise ValueError(f"method must be 'efficacy' or 'illuminance', not {method!r}")
    zenith = _zenith_rad(sun_altitude_deg)
    to_watt = SOLAR_CONSTANT_W_M2 / SOLAR_ILLUMINANCE_LX
    beam, diffuse = normal_lx * to_watt, diffuse_lx * to_watt
    for step in range(60):
        efficacy = beam_efficacy(condition, zenith, water_cm)
        new_beam = normal_lx / efficacy if efficacy > 0.1 else 0.0
        new_diffuse = diffuse_lx / diffuse_efficacy(condition, zenith, water_cm)
        change = max(abs(new_beam - beam), abs(new_diffuse - diffuse))
        # half steps once full ones had their chance: across a class edge the efficacies jump, and full steps swing
        share = 1.0 if step < 10 else 0.5
        beam += share * (new_beam - beam)
        diffuse += share * (new_diffuse - diffuse)
        condition = from_irradiances(beam, diffuse, sun_altitude_deg, distance_factor)
        if change < 1e-6 * diffuse:
            return condition
    return Condition(condition.epsilon, condition.delta, (*condition.flags, "efficacy-not-settled"))


def _zenith_rad(sun_altitude_deg: float) -> float:
    return math.radians(min(90.0, 90.0 - sun_altitude_deg))


def _condition(normal: float, diffuse: float, sun_altitude_deg: float, extraterrestrial: float) -> Condition:
    if not (math.isfinite(normal) and math.isfinite(diffuse) and normal >= 0.0 and diffuse > 0.0):
        raise DataError(
            f"no sky has a beam of {normal:g} and diffuse light of {diffuse:g}: the beam must not be negative "
            "and the diffuse part must be positive",
            "check which reading was taken with the shading disc",
        )
    zenith = _zenith_rad(sun_altitude_deg)
    cubed = 1.041 * zenith**3
    epsilon = ((diffuse + normal) / diffuse + cubed) / (1.0 + cubed)
    delta = diffuse * air_mass(zenith) / extraterrestrial
    flags = ["sun-low"] if sun_altitude_deg < 0.0 else []
    # gendaylit's upper end is open: the class table stops at 12.01
    inside_epsilon = min(max(epsilon, EPSILON_RANGE[0]), EPSILON_RANGE[1] - 0.001)
    inside_delta = min(max(delta, DELTA_RANGE[0]), DELTA_RANGE[1])
    if inside_epsilon != epsilon:
        flags.append("epsilon-clamped")
    if inside_delta != delta:
        flags.append("delta-clamped")
    return Condition(float(inside_epsilon), float(inside_delta), tuple(flags))
