"""What ``labdaq simulate --export`` does."""

from typing import Any

from labdaq.cli._simulate_job import Job, daylight_of, system_of
from labdaq.clock import SystemClock, utc_text
from labdaq.errors import ConfigError

RAYS = 100_000


def export(job: Job) -> dict[str, Any]:
    """Write the folder; rays only when the options tell a daylight. Returns a report. Raises a `LabdaqError`."""
    from analysis.simulate.export.folder import write_folder
    from analysis.simulate.rays import entering

    if job.export is None or job.ray_set is not None:
        raise ConfigError("--ray-set reads rays and --export writes them", "give one of the two")
    system = system_of(job)
    is_map = job.sky.lower().endswith((".hdr", ".pic", ".npz"))
    lit = job.diffuse_lx is not None or is_map
    rays = entering(system, daylight_of(job), job.rays or RAYS, job.seed) if lit else None
    files, reasons = write_folder(job.export, system, rays, utc_text(SystemClock().utc_ns()))
    return {
        "system": system.name,
        "files": [str(path) for path in files],
        "not_written": reasons,
        "rays": 0 if rays is None else len(rays.flux_lm),
        "rays_lm": 0.0 if rays is None else float(rays.flux_lm.sum()),
    }
