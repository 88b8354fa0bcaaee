"""What ``labdaq simulate --series`` does."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from labdaq.errors import ConfigError

OPTIONS: Final = ("system", "series", "out", "as_json", "sky", "site", "distance", "settings", "orientation",
                  "mirrored", "isotropic", "rays", "seed", "threads")  # fmt: skip
"""Options that mean something with --series; the table tells the others."""


def run_series(options: Mapping[str, Any], out: Path) -> dict[str, Any]:
    """Read the table, predict each moment, write the table to ``out``, and return a report. Raises a `LabdaqError`."""
    from analysis.simulate.series import RAYS, read_moments, series
    from analysis.simulate.system import find
    from analysis.sky.sun import Site
    from labdaq.cli._simulate_job import changes, numbers
    from labdaq.whole_file import write_whole_bytes

    if Path(options["sky"]).suffix.lower() in (".hdr", ".pic", ".npz"):
        raise ConfigError(f"--sky: the map {options['sky']} is of one moment", "name a model for a series")
    moments = read_moments(options["series"], Site(*numbers("--site", options["site"], (2, 3))))
    system = changes(find(options["system"]), options)
    made = series(
        system,
        moments,
        options["sky"],
        distance_m=options["distance"] or 0.0,
        rays=options["rays"] or RAYS,
        seed=options["seed"],
        threads=options["threads"],
    )
    write_whole_bytes(out, table(made).encode())
    flux = made.sun.flux + made.sky.flux
    error = np.hypot(made.sun.flux_uncertainty, made.sky.flux_uncertainty)
    lit = flux > 0.0
    return {
        "file": str(out),
        "system": system.name,
        "moments": len(flux),
        "lit": int(lit.sum()),
        "suns": int((moments.beam_lx > 0.0).sum()),
        "flux_lm_mean": float(flux.mean()),
        "flux_lm_max": float(flux.max()),
        "uncertainty": float(np.sqrt(np.mean((error[lit] / flux[lit]) ** 2))) if lit.any() else 0.0,
        "notes": list(moments.notes),
    }


def table(made: Any) -> str:
    """The result as CSV, a line for each moment."""
    m, sun, sky = made.moments, made.sun, made.sky
    columns: dict[str, Any] = {"time": m.times} if any(m.times) else {}
    columns |= {"sun_altitude_deg": m.altitude_deg, "sun_azimuth_deg": m.azimuth_deg}
    columns |= {"global_lx": m.beam_lx + m.diffuse_lx, "diffuse_lx": m.diffuse_lx}
    for name, unit in (("flux", "lm"), ("nadir", "cd"), *([("below", "lx")] if made.distance_m > 0.0 else [])):
        a, b = getattr(sun, name), getattr(sky, name)
        error = np.hypot(getattr(sun, f"{name}_uncertainty"), getattr(sky, f"{name}_uncertainty"))
        columns |= {f"{name}_{unit}": a + b, f"{name}_uncertainty_{unit}": error}
        columns |= {f"{name}_sun_{unit}": a, f"{name}_sky_{unit}": b}
    words = [[value if isinstance(value, str) else f"{value:.6g}" for value in values] for values in columns.values()]
    return "".join(",".join(row) + "\n" for row in [list(columns), *zip(*words, strict=True)])


def in_words(report: Mapping[str, Any]) -> str:
    """The report for who reads along."""
    return (
        f"{report['file']}\n  {report['system']}: {report['moments']} moments, {report['lit']} with light, "
        f"{report['suns']} with a sun; {report['flux_lm_mean']:.4g} lm in the mean, at most "
        f"{report['flux_lm_max']:.4g} lm; uncertainty of a flux {100 * report['uncertainty']:.2g} % rms"
    )
