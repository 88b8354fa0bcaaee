"""Predict the photometry of recorded sessions under their own skies.

Sessions of one system at one distance are traced together: their skies share rays (`analysis.simulate.variants`).
Writes ``derived/simulated.ies`` and its parts ``simulated-sun.ies`` and ``simulated-sky.ies``, near-field intensities
at the arm's distance in a black room; and ``simulate.json``, which says how they were made.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import labdaq
from analysis.photometry import Distribution
from analysis.process.daylight import SessionDaylight, daylight_of, issued
from analysis.process.derived import SIMULATE, rewrite, write_account
from analysis.simulate.ies import write_prediction
from analysis.simulate.predict import C_DEG, GAMMA_DEG
from analysis.simulate.prediction import Prediction, SunAndSky
from analysis.simulate.system import System, find
from analysis.simulate.variants import Outcome, Parts, variants
from labdaq.errors import ConfigError, LabdaqError
from labdaq.session import Session

FORMAT: Final = "labdaq-simulate/1"
SIMULATED: Final = "simulated.ies"
PILOT: Final = 100_000
MOST: Final = 2_000_000
"""Rays for each sun at most: some 3 seconds on two cores, and rms errors of 0.4 to 0.8 % a direction for the three
named systems."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """How to simulate.

    Attributes
    ----------
    system
        Instead of the ones that the sessions name.
    change
        Applied to each system before it is traced, e.g. the settings of the command line.
    precision
        Relative statistical error to reach, root mean square over the brighter directions, with up to `MOST` rays.
    rays
        Rays for each sun, instead of a precision.
    max_bounces
        Cut rays after so many wall reflections.
    """

    system: str | None = None
    change: Callable[[System], System] | None = None
    precision: float = 0.005
    rays: int | None = None
    seed: int = 1
    threads: int = 0
    max_bounces: int | None = None


@dataclass(frozen=True)
class _Job:
    session: Session
    system: System
    light: SessionDaylight

    @property
    def key(self) -> tuple[System, float]:
        return self.system, self.session.station.goniometer.distance_m


def simulate_sessions(paths: Sequence[Path], wish: Wish | None = None) -> list[dict[str, Any]]:
    """Predict each session and write the files; return the accounts in the order of ``paths``.

    Raises one `LabdaqError` with all mistakes before anything is traced: a session that was not processed, a system
    that is not known.
    """
    wish = wish or Wish()
    jobs = _jobs(paths, wish)
    accounts: dict[Path, dict[str, Any]] = {}
    for key in dict.fromkeys(job.key for job in jobs):
        together = [job for job in jobs if job.key == key]
        outcome, rays = _traced(together, wish)
        for number, job in enumerate(together):
            accounts[job.session.path] = _written(job, outcome, number, rays, wish)
    return [accounts[path] for path in paths]


def _jobs(paths: Sequence[Path], wish: Wish) -> list[_Job]:
    jobs: list[_Job] = []
    mistakes: list[LabdaqError] = []
    for path in dict.fromkeys(paths):
        try:
            session = Session.open(path)
            jobs.append(_Job(session, _system(session, wish), daylight_of(session)))
        except LabdaqError as error:
            mistakes.append(error)
    if mistakes:
        first = mistakes[0]
        first.message = "\n".join(error.message for error in mistakes)
        raise first
    return jobs


def _system(session: Session, wish: Wish) -> System:
    name = wish.system or session.header.system
    try:
        system = find(name)
    except ConfigError as error:
        raise ConfigError(
            f"{session.path}: its system '{name}' is none that labdaq knows: {error.message}",
            "describe it in a TOML file, and give that as SYSTEM",
        ) from error
    return wish.change(system) if wish.change else system


def _traced(jobs: Sequence[_Job], wish: Wish) -> tuple[Outcome, int]:
    """Trace the jobs' tests together, with as many rays as the precision needs by a pilot run's error.

    More rays are smoothed less, so the error falls with their cube root: the law of the best kernel estimate in two
    dimensions (Silverman 1986, Density Estimation, section 4.3).
    """
    system, distance_m = jobs[0].key
    tests = [job.light.daylight for job in jobs]

    def run(rays: int) -> Outcome:
        made = variants(
            system,
            tests,
            [],
            distance_m=distance_m,
            rays=rays,
            seed=wish.seed,
            threads=wish.threads,
            gamma_deg=GAMMA_DEG,
            c_deg=C_DEG,
        )
        return made.baseline if wish.max_bounces is None else made.again(max_bounces=wish.max_bounces)

    if wish.rays is not None:
        return run(wish.rays), wish.rays
    pilot = run(PILOT)
    worst = max(_part(pilot.near, k).worst_relative() for k in range(len(tests)))
    rays = int(min(MOST, PILOT * (worst / wish.precision) ** 3))
    return (run(rays), rays) if rays > PILOT else (pilot, PILOT)


def _part(parts: Parts, number: int) -> SunAndSky:
    """One test's sun and sky."""
    return SunAndSky(
        Distribution(GAMMA_DEG, C_DEG, parts.sun[number]),
        Distribution(GAMMA_DEG, C_DEG, parts.sky[number]),
        parts.sun_uncertainty[number],
        parts.sky_uncertainty[number],
    )


def _written(job: _Job, outcome: Outcome, number: int, rays: int, wish: Wish) -> dict[str, Any]:
    system, distance_m = job.key
    facts = {"rays": rays, "seed": wish.seed, "max_bounces": wish.max_bounces}
    far, near = _part(outcome.far, number), _part(outcome.near, number)
    made = Prediction(system, job.light.daylight, "tracer", far, near, distance_m, facts)
    day = job.light.daylight

    def fill(folder: Path) -> dict[str, Any]:
        files = write_prediction(folder / SIMULATED, made, "near", issued(job.session), parts=True)
        account = {
            "format": FORMAT,
            "session": job.session.header.name,
            "software": {"labdaq": labdaq.__version__},
            "files": [path.name for path in files],
            "engine": "tracer",
            "field": "near",
            "distance_m": distance_m,
            **facts,
            "sky": job.light.source,
            "sun_altitude_deg": day.sun_altitude_deg,
            "sun_azimuth_deg": day.sun_azimuth_deg,
            "global_lx": day.beam_lx + day.diffuse_lx,
            "diffuse_lx": day.diffuse_lx,
            "flux_lm": near.total.flux(),
            "flux_sun_lm": near.sun.flux(),
            "uncertainty": near.worst_relative(),
            "system": dataclasses.asdict(system),
        }
        write_account(folder / SIMULATE, account)
        return account

    return rewrite(job.session.path, (SIMULATE,), fill)
