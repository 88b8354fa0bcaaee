"""Distributions in closed form, and a session that a station would record under them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.photometry import Distribution
from analysis.photometry.lm63 import FileGeneration, write_lm63
from labdaq.clock import NS, ClockState, VirtualClock, utc_text
from labdaq.reading import Flag, Instrument, Reading
from labdaq.recorder import Recorder
from labdaq.records import Certificate, Ended, Header, TakenReading
from labdaq.script import Script
from labdaq.station import Station
from labdaq.units import Quantity, Unit
from labdaq.virtual_time import run_virtual

START = 1_279_804_320 * NS  # 2010-07-22T13:12:00Z
GAMMAS = (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0)
PLANES = tuple(22.5 * k for k in range(16))
KEYWORDS = {"TEST": "T", "TESTLAB": "tests", "ISSUEDATE": "2010-07-22", "MANUFAC": "none"}
ARM = Instrument(name="goniophotometer", model="arm", calibration="ARM-1")
ROOF = Instrument(name="roof", model="CL-200", calibration="CL-1")

Intensity = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def sky_part(gamma_deg: ArrayLike, c_deg: ArrayLike) -> NDArray[np.float64]:
    """A cosine lobe of 800 cd."""
    gamma, c = np.broadcast_arrays(np.radians(gamma_deg), c_deg)
    return 800.0 * np.clip(np.cos(gamma), 0.0, None) + 0.0 * c


def lobe(at_gamma: float, at_c: float, height: float, width: float = 18.0) -> Intensity:
    """A round lobe about a direction, cut off at the horizon."""

    def intensity(gamma_deg: ArrayLike, c_deg: ArrayLike) -> NDArray[np.float64]:
        g, c = np.broadcast_arrays(np.radians(gamma_deg), np.radians(c_deg))
        g0, c0 = np.radians(at_gamma), np.radians(at_c)
        cosine = np.cos(g) * np.cos(g0) + np.sin(g) * np.sin(g0) * np.cos(c - c0)
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        return height * np.exp(-0.5 * (angle / width) ** 2) * np.clip(np.cos(g), 0.0, None)

    return intensity


def distribution(of: Intensity, step: float = 2.5) -> Distribution:
    """On a grid that is fine against the lobes."""
    gamma, c = np.arange(0.0, 90.01, step), np.arange(0.0, 360.01, step)
    table = of(gamma[None, :], c[:, None])
    table[-1] = table[0]
    return Distribution(gamma, c, table, dict(KEYWORDS))


def on_arm(of: Intensity) -> Distribution:
    """As the arm sees it: ten gammas, sixteen planes, and a row of zeros at 90."""
    gamma, c = np.append(GAMMAS, 90.0), np.append(PLANES, 360.0)
    table = of(gamma[None, :], np.mod(c, 360.0)[:, None])
    table[:, -1] = 0.0
    return Distribution(gamma, c, table, dict(KEYWORDS))


def write_ies(path: Path, made: Distribution, **more: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    kept = Distribution(made.gamma_deg, made.c_deg, made.candela, made.keywords | more)
    write_lm63(path, kept, generation=FileGeneration.SIMULATED, digits=17)
    return path


def session_header(
    test: str = "T18", *, name: str = "", station: Station | None = None, system: str = "box", sky: str = "clear"
) -> Header:
    return Header(
        name=name or f"a-{test}",
        test=test,
        system=system,
        sky=sky,
        started=utc_text(START),
        started_utc_ns=START,
        clock=ClockState(source="virtual", synchronised=False),
        boot_id="boot",
        station=(station or Station.built_in()).model_dump(mode="json"),
        script=Script(test=test, system=system).model_dump(mode="json"),
        station_file={},
        script_file={},
        instruments=(ARM, ROOF),
        certificates=(
            Certificate(id="ARM-1", instrument="goniophotometer", date="2010-01-01", factor=1.02),
            Certificate(id="CL-1", instrument="roof", date="2010-01-01", factor=0.99),
        ),
        software={"labdaq": "0"},
    )


def record(folder: Path, header: Header, light: Intensity) -> Path:
    """Take a test under ``light``: all heads in each plane every 9 s, the roof every 2 s; one reading is over range."""

    async def take() -> Path:
        clock = VirtualClock(START)
        recorder = Recorder.create(folder, header, clock, inline=True)
        try:
            for k in range(72):
                for channel, lux in (("sky.global", 45_000.0 + 10 * k), ("sky.diffuse", 17_000.0)):
                    recorder.post(_reading(clock, channel, lux, ROOF))
                if k % 4 == 0 and k // 4 < len(PLANES):
                    plane = PLANES[k // 4]
                    for gamma in GAMMAS:
                        spoilt = (gamma, plane) == (45.0, 90.0)
                        lux = None if spoilt else float(light(np.array(gamma), np.array(plane))) / 2.6**2
                        at = {"gamma_deg": gamma, "c_deg": plane}
                        recorder.post(_reading(clock, f"gonio.g{gamma:g}", lux, ARM, at))
                await clock.sleep(2.25)
            await recorder.synced()
            await recorder.seal(Ended(outcome="finished", arm="parked"), clock.utc_ns())
        finally:
            await recorder.close()
        return recorder.path

    return run_virtual(take())


def _reading(
    clock: VirtualClock, channel: str, lux: float | None, instrument: Instrument, at: dict[str, float] | None = None
) -> TakenReading:
    return TakenReading(
        step="x",
        reading=Reading(
            channel=channel,
            quantity=Quantity.ILLUMINANCE,
            value=lux,
            unit=Unit.LUX,
            uncertainty=None if lux is None else 0.025 * lux,
            utc_ns=clock.utc_ns(),
            mono_ns=clock.mono_ns(),
            clock=clock.state(),
            instrument=instrument,
            duration_s=0.5,
            flags=(Flag.OVER_RANGE,) if lux is None else (),
            at=at or {},
        ),
    )
