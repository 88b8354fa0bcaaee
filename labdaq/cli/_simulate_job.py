"""What ``labdaq simulate`` does, without the words of its command line."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from labdaq.cli._simulate_vary import file_of, parse_varied, told
from labdaq.clock import SystemClock, utc_ns_of, utc_text
from labdaq.errors import ConfigError, DataError


@dataclass(frozen=True)
class Job:
    """The command line's options; see `labdaq.cli.simulate`."""

    system: str
    out: Path
    sky: str
    global_lx: float | None
    diffuse_lx: float | None
    sun: str | None
    time: str | None
    site: str
    engine: Literal["tracer", "radiance"]
    distance: float | None
    room: str | None
    directions: Literal["fine", "arm"]
    no_shields: bool
    settings: tuple[str, ...]
    orientation: float | None
    mirrored: bool
    isotropic: bool
    max_bounces: int | None
    precision: float
    rays: int | None
    seed: int
    threads: int
    parts: bool
    name: str
    ray_set: Path | None
    export: Path | None
    vary: tuple[str, ...] = ()
    series: Path | None = None


def run(job: Job) -> dict[str, Any]:
    """Predict, write the files, and return the report. Raises a `LabdaqError`."""
    from analysis.simulate.ies import write_prediction
    from analysis.simulate.lens_file import bright_lenses
    from analysis.simulate.tally import Field

    _check(job)
    system = system_of(job)
    notes = bright_lenses(system)
    made, varied = _under_daylight(job, system) if job.ray_set is None else (_under_rays(job, system), [])
    field: Field = "far" if job.distance is None else "near"
    issued = utc_text(SystemClock().utc_ns())[:10]
    files = write_prediction(job.out, made, field, issued, parts=job.parts)
    variants = []
    for variant in varied:
        file = file_of(job.out, variant.facts["variant"])
        variants.append(told(variant, field, write_prediction(file, variant, field, issued, parts=job.parts)))
    given: dict[str, Any] = {} if job.ray_set is None else {"ray_set": str(job.ray_set)}
    given |= {"variants": variants} if variants else {}
    return given | _report(made, field, files) | {"notes": list(notes)}


def _check(job: Job) -> None:
    """Refuse options that do not go together, before any work is done."""
    if job.room is not None and job.distance is None:
        raise ConfigError("--room is what sensors at a distance see", "give --distance")
    if job.engine == "radiance" and (job.max_bounces is not None or job.isotropic):
        raise ConfigError("--max-bounces and --isotropic are settings of the tracer", "leave them out, or --engine")
    if job.vary and (job.engine == "radiance" or job.ray_set is not None):
        raise ConfigError("--vary is for the tracer under a daylight", "leave out --engine radiance and --ray-set")


def _under_daylight(job: Job, system: Any) -> tuple[Any, list[Any]]:
    """The prediction under a daylight, and those of its variants."""
    from analysis.simulate.predict import ARM_C_DEG, ARM_GAMMA_DEG, C_DEG, GAMMA_DEG, predict
    from analysis.simulate.varied import predict_varied

    gamma_deg, c_deg = (ARM_GAMMA_DEG, ARM_C_DEG) if job.directions == "arm" else (GAMMA_DEG, C_DEG)
    how: dict[str, Any] = {
        "distance_m": job.distance or 0.0,
        "room": _room(job),
        "precision": job.precision,
        "rays": job.rays or 0,
        "seed": job.seed,
        "max_bounces": job.max_bounces,
        "threads": job.threads,
        "gamma_deg": gamma_deg,
        "c_deg": c_deg,
    }
    changes_ = parse_varied(job.vary)
    day = daylight_of(job)
    if changes_:
        return predict_varied(system, day, changes_, **how)
    return predict(system, day, engine=job.engine, **how), []


def _under_rays(job: Job, system: Any) -> Any:
    """The prediction for rays of a file; daylight and engine have no say."""
    from analysis.simulate.predict import predict_rays
    from analysis.simulate.rays import read_rays
    from analysis.simulate.tracer import Settings

    assert job.ray_set is not None
    odd = {"--global": job.global_lx, "--diffuse": job.diffuse_lx, "--sun": job.sun, "--time": job.time}
    said = [option for option, value in odd.items() if value is not None]
    said += ["--engine radiance"] if job.engine == "radiance" else []
    said += ["--parts"] if job.parts else []
    said += ["--rays"] if job.rays else []
    said += ["--directions"] if job.directions != "fine" else []
    if said:
        raise ConfigError(f"{', '.join(said)}: not with --ray-set, whose rays are all the light, each traced once")
    settings = Settings(seed=job.seed, distance_m=job.distance or 0.0, max_bounces=job.max_bounces, threads=job.threads)
    rays = read_rays(job.ray_set)
    try:
        return predict_rays(system, rays, settings, room=_room(job))
    except DataError as error:  # of the rays, which do not know their file
        raise DataError(f"{job.ray_set}: {error.message}", error.hint) from error


def _report(made: Any, field: Any, files: list[Path]) -> dict[str, Any]:
    """What is told of a prediction."""
    seen, day = made.field(field), made.daylight
    peak = np.unravel_index(np.argmax(seen.total.candela), seen.total.candela.shape)
    sun = {"altitude_deg": day.sun_altitude_deg, "azimuth_deg": day.sun_azimuth_deg} if day.beam_lx > 0.0 else None
    return {
        "files": [str(path) for path in files],
        "system": made.system.name,
        "engine": made.engine,
        "field": field,
        "sun": sun,
        "global_lx": day.beam_lx + day.diffuse_lx,
        "diffuse_lx": day.diffuse_lx,
        "flux_lm": seen.total.flux(),
        "flux_sun_lm": seen.sun.flux(),
        "flux_sky_lm": seen.sky.flux(),
        "peak_cd": float(seen.total.candela[peak]),
        "peak_gamma_deg": float(seen.total.gamma_deg[peak[1]]),
        "peak_c_deg": float(seen.total.c_deg[peak[0]]),
        "uncertainty": seen.worst_relative(),
        "facts": made.facts,
    }


def system_of(job: Job) -> Any:
    """The system that the command line names and changes."""
    from analysis.simulate.system import find

    return changes(find(job.system), vars(job))


def changes(system: Any, options: Mapping[str, Any]) -> Any:
    """The system with the command line's ``settings``, ``orientation``, ``mirrored`` and ``isotropic``."""
    from analysis.simulate.changes import changed
    from analysis.simulate.system import parse_settings

    system = system.with_settings(parse_settings(options["settings"]))
    wishes: dict[str, Any] = {}
    if options["orientation"] is not None:
        wishes["rotation_deg"] = options["orientation"]
    if options["mirrored"]:
        wishes["mirrored"] = True
    if options["isotropic"]:
        wishes["isotropic"] = True
    return changed(system, wishes)


def daylight_of(job: Job) -> Any:
    """The daylight of the command line."""
    from analysis.simulate.daylight import daylight, follows_sun, sky_map
    from analysis.simulate.source import horizontal_illuminance

    path = Path(job.sky)
    is_map = path.suffix.lower() in (".hdr", ".pic", ".npz")
    sky = sky_map(path) if is_map else job.sky
    diffuse = job.diffuse_lx
    if diffuse is None:
        if not is_map:
            raise ConfigError("--diffuse is missing: a model sky needs an illuminance", "or give a calibrated map")
        diffuse = horizontal_illuminance(cast(Any, sky))
    total = diffuse if job.global_lx is None else job.global_lx
    altitude, azimuth = _sun(job, needed=total > diffuse or (not is_map and follows_sun(job.sky)))
    return daylight(altitude, azimuth, total, diffuse, sky, job.name)


def _sun(job: Job, needed: bool) -> tuple[float, float]:
    """Altitude and azimuth [deg] from --sun, or from --time and --site."""
    if job.sun is not None and job.time is not None:
        raise ConfigError("--sun and --time both say where the sun is", "leave one out")
    if job.sun is not None:
        altitude, azimuth = numbers("--sun", job.sun, (2,))
        if not -90.0 <= altitude <= 90.0:
            raise ConfigError(f"--sun: an altitude of {altitude:g} degrees")
        return altitude, azimuth
    if job.time is not None:
        from analysis.sky.sun import Site, sun_position

        place = numbers("--site", job.site, (2, 3))
        seen = sun_position(_utc_ns(job.time), Site(*place))
        return float(seen.altitude_deg), float(seen.azimuth_deg)
    if needed:
        raise ConfigError(
            "where is the sun?",
            "give --sun ALT,AZ or --time UTC; only overcast, uniform, cie:1, cie:3, cie:5, ies-overcast and maps "
            "need none",
        )
    return 90.0, 0.0


def _utc_ns(text: str) -> int:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ConfigError(f"--time: {text!r} is not a time", "write e.g. 2010-07-22T13:12:00Z") from error
    return utc_ns_of(moment if moment.tzinfo else moment.replace(tzinfo=UTC))


def numbers(option: str, text: str, counts: tuple[int, ...]) -> list[float]:
    """The numbers of an option's text, as many as one of ``counts``; raises `ConfigError`."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts or not np.all(np.isfinite(values)):
        raise ConfigError(f"{option}: {text!r} is not {' or '.join(map(str, counts))} numbers with commas between")
    return values


def _room(job: Job) -> Any:
    if job.room is None:
        return None
    from analysis.simulate.room import Room

    wall, *floor = numbers("--room", job.room, (1, 2))
    half_angle = 90.0 if job.no_shields else 60.0
    return Room(wall=wall, ceiling=wall, floor=floor[0] if floor else wall, half_angle_deg=half_angle)
