"""Motion in time: pieces of constant acceleration, on a clock's nanoseconds. Positions in counts."""

import math
from dataclasses import dataclass

from labdaq.clock import NS


@dataclass(frozen=True, slots=True)
class Leg:
    """A piece of constant acceleration.

    Attributes
    ----------
    seconds
        How long it lasts [s]; may be infinite.
    position, velocity, acceleration
        At its beginning [counts, counts/s, counts/s²].
    """

    seconds: float
    position: float
    velocity: float
    acceleration: float

    def at(self, seconds: float) -> tuple[float, float]:
        """Position and velocity ``seconds`` after its beginning."""
        position = self.position + self.velocity * seconds + self.acceleration * seconds**2 / 2
        return position, self.velocity + self.acceleration * seconds

    @property
    def end(self) -> tuple[float, float]:
        """Position and velocity at its end."""
        return self.at(self.seconds)


@dataclass(frozen=True, slots=True)
class Profile:
    """A movement that begins at ``begin_ns`` and ends at rest, unless its last leg is infinite."""

    begin_ns: int
    legs: tuple[Leg, ...]

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return sum(leg.seconds for leg in self.legs)

    @property
    def end_ns(self) -> float:
        """When it ends; may be infinite."""
        return self.begin_ns + self.seconds * NS

    def at(self, mono_ns: float) -> tuple[float, float]:
        """Position and velocity [counts, counts/s] at a time; before the beginning where it will begin."""
        after_s = max(0.0, (mono_ns - self.begin_ns) / NS)
        for leg in self.legs:
            if after_s < leg.seconds:
                return leg.at(after_s)
            after_s -= leg.seconds
        return self.legs[-1].end[0], 0.0


def rest(begin_ns: int, position: float) -> Profile:
    """Stay where it is."""
    return Profile(begin_ns, (Leg(0.0, position, 0.0, 0.0),))


def stop(position: float, velocity: float, deceleration: float) -> list[Leg]:
    """Come to rest."""
    if velocity == 0:
        return [Leg(0.0, position, 0.0, 0.0)]
    return [Leg(abs(velocity) / deceleration, position, velocity, -math.copysign(deceleration, velocity))]


def change_speed(
    position: float, velocity: float, target: float, acceleration: float, deceleration: float
) -> list[Leg]:
    """Go from one velocity to another, through zero if they differ in sign."""
    legs = []
    if velocity * target < 0:
        legs = stop(position, velocity, deceleration)
        position, velocity = legs[-1].end[0], 0.0
    rate = acceleration if abs(target) > abs(velocity) else deceleration
    if target != velocity:
        legs.append(Leg(abs(target - velocity) / rate, position, velocity, math.copysign(rate, target - velocity)))
    return legs


def move(
    position: float, velocity: float, target: float, speed: float, acceleration: float, deceleration: float
) -> list[Leg]:
    """Go to ``target`` with a trapezoidal (or, when it is near, triangular) speed.

    A movement under way in the wrong direction, or too fast to stop in time, stops first and comes back.
    """
    braking = math.copysign(velocity**2 / (2 * deceleration), velocity)
    if velocity * (target - position) < 0 or abs(braking) > abs(target - position):
        legs = stop(position, velocity, deceleration)
        return legs + move(legs[-1].end[0], 0.0, target, speed, acceleration, deceleration)
    distance = target - position
    if distance == 0:
        return [Leg(0.0, position, 0.0, 0.0)]
    sign = math.copysign(1.0, distance)
    if abs(velocity) > speed:  # a slower move was ordered: first slow down to it
        slow = change_speed(position, velocity, sign * speed, acceleration, deceleration)
        return slow + move(slow[-1].end[0], sign * speed, target, speed, acceleration, deceleration)
    highest = math.sqrt(
        (2 * acceleration * deceleration * abs(distance) + deceleration * velocity**2) / (acceleration + deceleration)
    )
    top = min(speed, highest)
    speed_up = Leg((top - abs(velocity)) / acceleration, position, velocity, sign * acceleration)
    slow_down_length = top**2 / (2 * deceleration)
    cruise_length = max(0.0, abs(target - speed_up.end[0]) - slow_down_length)
    cruise = Leg(cruise_length / top, speed_up.end[0], sign * top, 0.0)
    slow_down = Leg(top / deceleration, target - sign * slow_down_length, sign * top, -sign * deceleration)
    return [speed_up, cruise, slow_down]
