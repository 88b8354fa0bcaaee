"""The arm on its motor: where it is at any instant, and where that lets the sensors look."""

from collections import deque
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS
from simulators.goniophotometer.motion import Leg, Profile, rest

Floats = NDArray[np.float64]

COUNTS_PER_REVOLUTION: Final = 10_000
LAG_NS: Final = 4_000_000
"""The motor follows its command by about this much [ns]."""


class ArmResponse(Protocol):
    """How the arm carries its sensors; the hook for concealed physics of angles (offset, backlash, handedness)."""

    def __call__(self, gamma_deg: Floats, c_deg: float, approach: int) -> tuple[Floats, float]:
        """True gammas (n,) and C [deg] of the sensors.

        Given are the nominal gammas, C as the motor's encoder has it, and from which side it came there: +1 with C
        rising, -1 falling, 0 if it never moved.
        """
        ...


def straight_arm(gamma_deg: Floats, c_deg: float, approach: int) -> tuple[Floats, float]:
    """An arm that is where it should be."""
    return gamma_deg, c_deg


@dataclass(frozen=True, slots=True)
class BentArm:
    """An arm with offsets and backlash.

    Attributes
    ----------
    gamma_offset_deg, c_offset_deg
        Added to the nominal angles.
    backlash_deg
        Play of the drive: the arm trails its motor by half of it.
    mirrored
        C runs the other way round.
    """

    gamma_offset_deg: float = 0.0
    c_offset_deg: float = 0.0
    backlash_deg: float = 0.0
    mirrored: bool = False

    def __call__(self, gamma_deg: Floats, c_deg: float, approach: int) -> tuple[Floats, float]:
        """True gammas and C [deg]."""
        c = c_deg + self.c_offset_deg - approach * self.backlash_deg / 2
        return gamma_deg + self.gamma_offset_deg, (-c if self.mirrored else c) % 360.0


class Arm:
    """The motor shaft and what hangs on it, in mechanical counts: 0 at C = 0, rising with C.

    It remembers enough of its movements to say where it was a few seconds ago.
    """

    def __init__(self, mono_ns: int, counts: float) -> None:
        self._profiles: deque[Profile] = deque([rest(mono_ns, counts)], maxlen=16)
        self._approach: deque[int] = deque([0], maxlen=16)

    @property
    def profile(self) -> Profile:
        """The movement ordered last."""
        return self._profiles[-1]

    def order(self, profile: Profile) -> None:
        """Begin another movement."""
        net = profile.at(min(profile.end_ns, profile.begin_ns + 3600 * NS))[0] - profile.legs[0].position
        self._approach.append(int(np.sign(net)) or self._approach[-1])
        self._profiles.append(profile)

    def commanded(self, mono_ns: int) -> tuple[float, float]:
        """Ordered position and velocity [counts, counts/s]."""
        return self._at(mono_ns).at(mono_ns)

    def actual(self, mono_ns: int) -> tuple[float, float]:
        """True position and velocity [counts, counts/s]."""
        return self._at(mono_ns - LAG_NS).at(mono_ns - LAG_NS)

    def c_deg(self, mono_ns: int) -> float:
        """C of the motor shaft [deg, in 0-360)."""
        return self.actual(mono_ns)[0] * 360.0 / COUNTS_PER_REVOLUTION % 360.0

    def approach(self, mono_ns: int) -> int:
        """From which side it came where it was at a time: the sign of its last movement."""
        profile, side = self._profiles[0], self._approach[0]
        for later, later_side in zip(self._profiles, self._approach, strict=True):
            if later.begin_ns <= mono_ns:
                profile, side = later, later_side
        velocity = profile.at(mono_ns)[1]
        return int(np.sign(velocity)) or side

    def displace(self, mono_ns: int, counts: float) -> None:
        """Put the arm elsewhere at once (an operator's hand, a missed step)."""
        self.order(Profile(mono_ns, (Leg(0.0, counts, 0.0, 0.0),)))

    def _at(self, mono_ns: int) -> Profile:
        chosen = self._profiles[0]
        for profile in self._profiles:
            if profile.begin_ns <= mono_ns:
                chosen = profile
        return chosen
