"""What a skylight sends into the room: traced once for the sky, and for each sun that is asked for.

The sky's light is a sum over a few hundred places in the sky (`simulators.hidden.responses`). A sun is traced for
itself, at instants a few minutes apart, and interpolated in between. Both are kept on disk.
"""

import os
import threading
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simulators.hidden.effects import OpticsFaults
from simulators.hidden.maps import Field, smooth
from simulators.hidden.responses import Response
from simulators.hidden.skylight import Skylight, box, top, tube
from simulators.hidden.store import Store, cache_folder, key
from simulators.hidden.symmetry import SkyNodes, sky_from_map, symmetries
from simulators.hidden.tracer import Answer, trace

Floats = NDArray[np.float64]

BLUR_DEG: Final = 4.0 * 2.0**0.5
"""Slope errors are 4 degrees rms about each of two axes; `simulators.hidden.lens` takes the rms of both together."""


def _moulded(skylight: Skylight) -> Skylight:
    """With the slope errors of the laboratory's sheets."""
    entry, leaving = (replace(lens, blur_deg=BLUR_DEG) for lens in (skylight.entry, skylight.exit))
    return replace(skylight, entry=entry, exit=leaving)


NOMINAL: Final = {"top": _moulded(top()), "box": _moulded(box()), "tube": _moulded(tube())}
"""The skylights as they are when nothing is wrong with them."""
SKY_ACROSS: Final = 29
"""Places across the sky's map: one every 5.6 degrees."""
SKY_RAYS: Final = 48_000
"""For each of them where the skylight has all eight symmetries."""
SUN_RAYS: Final = 1_600_000
"""For a sun in the zenith; low suns get more, as fewer of their rays come through."""
MOST_SUN_RAYS: Final = 5_000_000
RECIPE: Final = 2
"""Raise when suns on disk are to be traced anew."""
NODES: Final = 96
SMOOTHING_DEG: Final = 1.2
"""Of a high sun's light; a low sun's is fainter and broader, and smoothed a little more."""


def skylight_with(system: str, faults: OpticsFaults) -> Skylight:
    """The skylight of that name with what is wrong with it; soiling comes with the tracing."""
    skylight = NOMINAL[system]
    answer = faults.answer
    if answer.wall_reflectance is not None:
        skylight = replace(skylight, wall_reflectance=answer.wall_reflectance)
    if answer.wall_scatter and skylight.wall_finish == "specular":
        skylight = replace(skylight, wall_scatter=answer.wall_scatter)
    if answer.haze:
        entry, leaving = (replace(lens, haze=answer.haze) for lens in (skylight.entry, skylight.exit))
        skylight = replace(skylight, entry=entry, exit=leaving)
    return skylight.turned(faults.turn_deg) if faults.turn_deg else skylight


@dataclass(frozen=True)
class Halo:
    """Light about the sun: rms-like scale of a Gaussian, exp(-(angle / scale_deg)²), and its share of the beam."""

    scale_deg: float = 4.0
    share: float = 0.0


@dataclass
class Tracing:
    """One skylight; may be asked from several threads.

    Attributes
    ----------
    skylight, soiling
        What is traced, and the optical depth of the dirt on its cover.
    halo
        Where a share of the sun's light comes from.
    effort
        Multiplies the numbers of rays.
    folder
        Where traced light is kept; the user's cache by default.
    threads
        How many suns are traced at a time.
    """

    skylight: Skylight
    soiling: float = 0.0
    halo: Halo = field(default_factory=Halo)
    effort: float = 1.0
    folder: Path = field(default_factory=cache_folder)
    threads: int = field(default_factory=lambda: os.cpu_count() or 1)
    _suns: dict[bytes, Field] = field(default_factory=dict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @property
    def _answer(self) -> Answer:
        return Answer(soiling=self.soiling)

    @cached_property
    def sky(self) -> Response:
        """Response to the sky; traced when it is not on disk."""
        rays = max(1000, int(self.effort * SKY_RAYS * min(8, 2 * len(symmetries(self.skylight))) / 8))
        name = key(self.skylight, rays, SKY_ACROSS, self.soiling, "world")
        place = self.folder / f"{self.skylight.kind}-{name}"
        store = Store(self.skylight, rays, place, across=SKY_ACROSS, nominal=self._answer, threads=self.threads)
        return Response(store, np.array(store.base()))

    def suns(self, directions: Iterable[Floats]) -> list[Field]:
        """Light below for 1 lx facing each of some suns, those that are missing traced on all cores."""
        wanted = [np.round(np.asarray(d, dtype=np.float64), 9) for d in directions]
        found = [self._suns.get(d.tobytes()) for d in wanted]
        if all(one is not None for one in found):
            return [one for one in found if one is not None]
        with self._lock:
            missing = {d.tobytes(): d for d in wanted if d.tobytes() not in self._suns}
            if len(self._suns) > 300:
                self._suns.clear()
                missing = {d.tobytes(): d for d in wanted}
            with ThreadPoolExecutor(max(1, min(self.threads, len(missing)))) as pool:
                self._suns |= dict(zip(missing, pool.map(self._sun, missing.values()), strict=True))
            return [self._suns[d.tobytes()] for d in wanted]

    def _sun(self, direction: Floats) -> Field:
        rays = int(self.effort * min(MOST_SUN_RAYS, SUN_RAYS / max(0.05, float(direction[2])) ** 0.7))
        name = key(
            self.skylight, rays, NODES, RECIPE, self.soiling, [self.halo.scale_deg, self.halo.share], direction.tolist()
        )
        path = self.folder / f"{self.skylight.kind}-suns" / f"{name}.npy"
        if path.is_file():
            return Field(np.load(path).astype(np.float64))
        seed = int.from_bytes(direction.tobytes()[:7], "little")
        width = SMOOTHING_DEG + 0.6 * (1.0 - float(direction[2]))
        values = sharp(trace(self.skylight, direction, rays, seed, (self._answer,)).flux[0], width)
        if self.halo.share:
            wide = trace(
                self.skylight, direction, rays // 3, seed, (self._answer,), self.halo.scale_deg, aureole_power=0.5
            )
            values = (1.0 - self.halo.share) * values + self.halo.share * sharp(wide.flux[0], width)
        _save(path, values.astype(np.float32))
        return Field(values.astype(np.float32).astype(np.float64))


def sharp(flux: Floats, width_deg: float) -> Floats:
    """Smooth counted flux by a kernel of fourth order, which leaves peaks as high as they are to second order.

    Twice a Gaussian less one of twice its variance: the second moments cancel.
    """
    return 2.0 * smooth(flux, width_deg, NODES) - smooth(flux, width_deg * 2.0**0.5, NODES)


def _save(path: Path, values: NDArray[np.float32]) -> None:
    """Write beside the final name, then rename, so that no half of it is ever read."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = path.parent / f".{path.name}.{os.getpid()}.{threading.get_ident()}"
    with made.open("wb") as file:
        np.save(file, values)
    made.replace(path)


class Cells:
    """Places within the cells that a response's nodes stand for, to average a sky's luminance over each."""

    def __init__(self, nodes: SkyNodes) -> None:
        steps = (np.arange(3) - 1.0) / 3.0
        points = (nodes.where[:, None, :] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, 9, 2)) * nodes.step
        self._above = np.sum(points**2, axis=-1) < 1.999
        self._directions = sky_from_map(np.where(self._above[..., None], points, 0.0))
        self._weight = self._above / self._above.sum(axis=1, keepdims=True)
        up = nodes.directions[:, 2] * nodes.solid_angle
        self._even = float(np.pi / up.sum())

    @property
    def directions(self) -> Floats:
        """Unit vectors (n, 9, 3)."""
        return self._directions

    def mean(self, luminance: Floats) -> Floats:
        """Mean luminance of each cell (n,), such that the nodes together give an even sky's illuminance."""
        return np.asarray(np.sum(luminance * self._weight, axis=1) * self._even)
