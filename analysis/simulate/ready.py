"""Make ready what simulations need once: compiled kernels, and the scatter tables of the three systems' lenses.

    python3 -m analysis.simulate.ready

Whoever simulates first waits a minute or two for them, unless this was run before. They are kept in the cache
(`analysis.simulate.store`).
"""

from analysis.simulate.daylight import daylight
from analysis.simulate.predict import ARM_C_DEG, ARM_GAMMA_DEG, predict
from analysis.simulate.rays import entering
from analysis.simulate.system import SYSTEMS


def make_ready() -> None:
    """Predict each system once with few rays, in each way that has kernels of its own."""
    day = daylight(50.0, 130.0, 80_000.0, 20_000.0, "perez")
    for system in SYSTEMS.values():
        predict(system, day, distance_m=2.6, rays=2_000, gamma_deg=ARM_GAMMA_DEG, c_deg=ARM_C_DEG)
        entering(system, day, rays=1_000)


if __name__ == "__main__":
    make_ready()
