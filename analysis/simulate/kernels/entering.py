"""The rays that fall on a cover, one by one instead of traced."""

import numpy as np

from analysis.simulate.kernels.arrays import TURN_C, TURN_S, Floats, Light, Numbers
from analysis.simulate.kernels.counting import ONE, ZERO
from analysis.simulate.kernels.geometry import land
from analysis.simulate.kernels.jit import kernel
from analysis.simulate.kernels.launch import A1, A2, A3, direction, even, source_at
from analysis.simulate.kernels.maps import mix, stream, uniform
from analysis.simulate.kernels.paths import RAY_STEP
from analysis.simulate.kernels.shade import shaded


@kernel
def entering(
    geo: Numbers, facets: Floats, obstructions: Floats, light: Light, seed: np.uint64, count: int, out: Floats
) -> None:
    """Fill ``out`` (count, 7): place [m], direction of travel, and flux [lm] of a source's first member.

    Frame of the site. Places, cells and discs are drawn as `paths.trace` draws them; a ray that misses, or that an
    obstruction stops, has no flux.
    """
    base = mix(seed)
    state = stream(base, ZERO)
    shift, state = uniform(state)
    s1, state = uniform(state)
    s2, state = uniform(state)
    s3, state = uniform(state)
    s4, state = uniform(state)
    s5, state = uniform(state)
    source = ZERO
    for i in range(count):
        state = stream(mix(base + np.uint64(i) * RAY_STEP), ONE)
        place = (i + shift) / count
        source = source_at(light, place, source)
        dx, dy, dz, state = direction(light, source, i, s4, s5, state)
        out[i, 3], out[i, 4], out[i, 5] = dx, dy, dz
        dx, dy = geo[TURN_C] * dx + geo[TURN_S] * dy, geo[TURN_C] * dy - geo[TURN_S] * dx
        area = 0.0
        if dz < 0.0:
            x, y, z, _, _, _, area, _ = land(geo, facets, dx, dy, dz, even(s1, i, A1), even(s2, i, A2), even(s3, i, A3))
            if shaded(obstructions, x, y, z, dx, dy, dz):
                area = 0.0
            out[i, 0], out[i, 1], out[i, 2] = geo[TURN_C] * x - geo[TURN_S] * y, geo[TURN_S] * x + geo[TURN_C] * y, z
        out[i, 6] = area * light.flux[source, light.span[source, 0]]
