"""Two instruments that exchanged their places: sensors wired crosswise, or meters under each other's name."""

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Branch, Mechanism, Stage
from analysis.explain.scene import Light, Scene
from analysis.explain.series import looks_one_way

_UNLIKE = 0.01
"""Predictions that differ by less (rms, relative) cannot tell whether two instruments were exchanged."""


class ChannelSwap(Mechanism):
    """Two sensors are wired crosswise."""

    other_light = True

    id = "channel-swap"
    stage = Stage.GONIOMETER
    leaves_out = "Two sensors are wired crosswise."
    source = "records of channel a hold the readings of sensor b and the other way round"
    tie_breaker = "cover one sensor and see which channel goes dark"
    kinds = ("goniometer", "roof", "sky")
    in_one_test = True

    def branches(self, scene: Scene) -> tuple[Branch, ...]:
        """All pairs on the arm that look at different gammas; on the roof, of instruments that read different light."""
        r = scene.readings
        angle = {int(k): float(np.median(r.gamma_deg[r.channel == k])) for k in np.unique(r.channel[scene.is_gonio])}
        names = r.case.channels
        ids = sorted(angle, key=lambda k: angle[k])
        arm = [
            Branch(f"{names[a].id} and {names[b].id}", (a, b, angle[a], angle[b]))
            for a, b in combinations(ids, 2)
            if not math.isclose(angle[a], angle[b])
        ]
        above = [Branch(f"{names[a].id} and {names[b].id}", (a, b)) for a, b in _above(scene)]
        return (*arm, *above)

    def why_not(self, scene: Scene) -> str:
        """One channel cannot be swapped."""
        return "" if self.branches(scene) else "there are no two channels that read different light at the same times"

    def illuminate(self, scene: Scene, light: Light, p: Floats, branch: Branch) -> None:
        """On the arm, look where the other sensor was."""
        if len(branch.value) == 2:
            return
        a, b, angle_a, angle_b = branch.value
        channel = scene.readings.channel
        shift = np.where(channel == a, angle_b - angle_a, np.where(channel == b, angle_a - angle_b, 0.0))
        light.gamma_deg = light.gamma_deg + shift
        light.moved = True

    def respond(self, scene: Scene, values: Floats, p: Floats, branch: Branch) -> Floats:
        """On the roof, read what the other instrument would have read at that moment."""
        if len(branch.value) == 4:
            return values
        made = values.copy()
        for mine, other in _both(scene, *branch.value):
            t = scene.readings.utc_ns
            made[mine] = np.interp(t[mine], t[other], values[other])
            made[other] = np.interp(t[other], t[mine], values[mine])
        return made

    def statement(self, p: Floats, branch: Branch) -> str:
        """Name the two."""
        return f"The sensors of {branch.label} are wired crosswise."


def _both(scene: Scene, a: int, b: int) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Rows of two channels in each test that has both, in the order of time."""
    r = scene.readings
    found = []
    for k in np.intersect1d(r.test[r.channel == a], r.test[r.channel == b]):
        rows = [np.flatnonzero((r.test == k) & (r.channel == c)) for c in (a, b)]
        mine, other = (each[np.argsort(r.utc_ns[each])] for each in rows)
        found.append((mine, other))
    return found


def _above(scene: Scene) -> list[tuple[int, int]]:
    """Pairs of roof meters, and of luminance meters that look one way each, whose predictions differ."""
    r = scene.readings
    if not r.has_times:
        return []
    steady = [int(k) for k in np.unique(r.channel[~scene.is_gonio]) if looks_one_way(scene, int(k))]
    kind = {k: r.kind[r.channel == k][0] for k in steady}
    return [(a, b) for a, b in combinations(steady, 2) if kind[a] == kind[b] and _unlike(scene, a, b)]


def _unlike(scene: Scene, a: int, b: int) -> bool:
    r, off = scene.readings, [0.0]
    for mine, other in _both(scene, a, b):
        seen = np.interp(r.utc_ns[mine], r.utc_ns[other], r.simulated[other])
        off += np.square(seen / np.maximum(r.simulated[mine], r.floor[mine]) - 1.0).tolist()
    return float(np.sqrt(np.mean(off))) > _UNLIKE
