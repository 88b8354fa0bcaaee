"""The files of a goniometer's case: case.toml, records.csv, simulated distributions and variants."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import utc_text
from simulators.trial.campaign import Test
from simulators.trial.files import COLUMNS, ies, number, parts, toml, utc
from simulators.trial.made import Order
from simulators.trial.station import Flaws, Station, World
from simulators.trial.stock import DESIGNS

Floats = NDArray[np.float64]

GRID_GAMMAS = np.arange(0.0, 90.01, 2.5)
GRID_PLANES = np.arange(0.0, 360.0, 7.5)


@dataclass(frozen=True)
class Written:
    """Readings and predictions of all tests [cd], (p * g,) each; predictions as sun and sky part."""

    measured: list[Floats]
    predicted: list[tuple[Floats, Floats]]


@dataclass(frozen=True)
class _Style:
    """How complete the laboratory's files are."""

    maps: bool
    variants: tuple[tuple[str, dict[str, float | bool | str], Flaws], ...]
    missing: float
    range_max: float | None
    parts: bool


def case_files(
    station: Station,
    world: World,
    written: Written,
    chosen: list[int],
    order: Order,
    rng: np.random.Generator,
    measured_too: bool,
) -> dict[str, str]:
    """Return the case's files by relative path; withheld tests (``measured_too`` false) have no readings."""
    style = _style(station, world, np.random.default_rng([order.seed, 77]))
    tests = [station.campaign.tests[k] for k in chosen]
    files: dict[str, str] = {}
    variants: list[dict[str, object]] = []
    if style.maps:
        for test in tests:
            _add_maps(files, "simulated", station, world.flaws, test)
        for number_, (mechanism, setting, flaws) in enumerate(style.variants):
            folder = f"simulated/variant-{number_ + 1}"
            mine = [t for t in tests if _concerns(station, mechanism, t)]
            for test in mine:
                _add_maps(files, folder, station, flaws, test)
            table = {t.name: {"sun": f"{folder}/{t.name}-sun.ies", "sky": f"{folder}/{t.name}-sky.ies"} for t in mine}
            if mine:
                variants.append({"mechanism": mechanism, "setting": setting, "simulated": table})
    files["case.toml"] = toml(_document(station, world, tests, style, variants))
    files["records.csv"] = _records(station, written, chosen, style, rng, measured_too)
    return files


def _style(station: Station, world: World, rng: np.random.Generator) -> _Style:
    maps = bool(rng.random() < 0.75) and world.flaws.room is None
    variants = _variants(station, world.flaws, rng) if maps and rng.random() < 0.55 else ()
    brightest = max(float(r.max()) for r in station.read(world))
    draw = rng.random()
    range_max = None if draw < 0.6 else brightest * float(rng.uniform(1.5, 8.0))
    if draw > 0.94:
        range_max = brightest * float(rng.uniform(0.4, 0.9))
    missing = float(rng.uniform(0.002, 0.02)) if rng.random() < 0.2 else 0.0
    return _Style(maps, variants, missing, range_max, parts=bool(rng.random() < 0.93))


def _variants(
    station: Station, flaws: Flaws, rng: np.random.Generator
) -> tuple[tuple[str, dict[str, float | bool | str], Flaws], ...]:
    """Some of the settings a careful simulator would try, whatever is concealed."""
    wall = {s: DESIGNS[d].wall_reflectance for s, d in station.campaign.systems.items()}
    lowest = min(wall.values())
    found: list[tuple[str, dict[str, float | bool | str], Flaws]] = []
    tries: list[tuple[str, dict[str, float | bool | str], Flaws]] = [
        ("lens-orientation", {"rotation_deg": angle}, replace(flaws, turn_deg=angle)) for angle in (10.0, 45.0)
    ]
    limit = int(rng.choice([3, 6, 14]))
    other = limit if flaws.max_bounces == 0 else 0
    tries.append(("bounce-truncation", {"max_bounces": other}, replace(flaws, max_bounces=other)))
    if len(set(wall.values())) == 1:
        step = float(rng.choice([-0.05, 0.01]))
        value = round(lowest + step, 3)
        tries.append(("wall-reflectance", {"wall_reflectance": value}, _answered(flaws, wall_reflectance=value)))
    tries.append(("wall-scatter", {"wall_scatter": 0.05}, _answered(flaws, wall_scatter=0.05)))
    tries.append(("near-field", {"field": "near" if flaws.far else "far"}, replace(flaws, far=not flaws.far)))
    tries.append(("lens-anisotropy", {"isotropic": not flaws.isotropic}, replace(flaws, isotropic=not flaws.isotropic)))
    tries.append(("lens-haze", {"haze": 0.05}, _answered(flaws, haze=0.05)))
    for one in tries:
        if rng.random() < 0.6 and any(_concerns(station, one[0], t) for t in station.campaign.tests):
            found.append(one)
    return tuple(found)


def _answered(flaws: Flaws, **changes: float) -> Flaws:
    return replace(flaws, answer=replace(flaws.answer, **changes))  # type: ignore[arg-type]


def _concerns(station: Station, mechanism: str, test: Test) -> bool:
    """Whether a variant of that mechanism can be simulated for a test's system."""
    design = DESIGNS[station.campaign.systems[test.system]]
    if mechanism == "lens-orientation":
        return design.round
    return mechanism != "wall-scatter" or design.wall_finish == "specular"


def _add_maps(files: dict[str, str], folder: str, station: Station, flaws: Flaws, test: Test) -> None:
    design = DESIGNS[station.campaign.systems[test.system]]
    if design.wall_finish != "specular" and flaws.answer.wall_scatter:
        flaws = replace(flaws, answer=replace(flaws.answer, wall_scatter=None))
    size = np.array([design.width_m, design.length_m])
    sun, sky = station.predicted_maps(flaws, test, GRID_GAMMAS, GRID_PLANES)
    for part, table in (("sun", sun), ("sky", sky)):
        keywords = {
            "TEST": f"{test.name} {part} part",
            "TESTLAB": "simulation",
            "ISSUEDATE": utc_text(test.start_ns)[:10],
            "MANUFAC": "generated",
            "LUMCAT": test.system,
            "_SUNALT": f"{test.altitude_deg:.3f}",
            "_SUNAZ": f"{test.azimuth_deg:.3f}",
            "_DISTANCE": "far field" if flaws.far else f"{station.campaign.distance_m:.4f} m",
        }
        text = ies(GRID_GAMMAS, GRID_PLANES, table, keywords, design.round, size)
        files[f"{folder}/{test.name}-{part}.ies"] = text


def _document(
    station: Station, world: World, tests: list[Test], style: _Style, variants: list[dict[str, object]]
) -> dict[str, object]:
    c = station.campaign
    flaws = world.flaws
    includes = ["near-field"] if not flaws.far else []
    if flaws.room is not None:
        includes.append("room-interreflection")
    used = {t.system for t in tests}
    return {
        "format": "labdaq-case/1",
        "title": f"Goniometer campaign, {c.site_name}",
        "site": {
            "latitude_deg": c.site.latitude_deg,
            "longitude_deg": c.site.longitude_deg,
            "elevation_m": c.site.elevation_m,
        },
        "room": {"size_m": list(c.room_m)},
        "goniometer": {
            "distance_m": c.distance_m,
            "gammas_deg": [float(g) for g in c.gammas_deg],
            "c_planes_deg": [float(p) for p in c.planes_deg],
            "sensor_half_angle_deg": 60.0,
        },
        "simulation": {
            "engine": "forward ray tracing",
            "field": "far" if flaws.far else "near",
            "includes": includes,
            "max_bounces": flaws.max_bounces,
        },
        "system": [_system(s, d) for s, d in c.systems.items() if s in used],
        "channel": [_channel(float(g), style.range_max) for g in c.gammas_deg],
        "test": [_test(t, style.maps) for t in tests],
        "variant": variants,
    }


def _system(name: str, design: str) -> dict[str, object]:
    d = DESIGNS[design]
    aperture: dict[str, object] = {"shape": "rectangle", "size_m": [d.width_m, d.length_m]}
    if d.round:
        aperture = {"shape": "disc", "diameter_m": d.width_m}
    return {
        "id": name,
        "kind": d.kind,
        "aperture": aperture,
        "well_depth_m": d.depth_m,
        "wall_reflectance": d.wall_reflectance,
        "wall_finish": d.wall_finish,
        "lens": "prismatic",
    }


def _channel(gamma: float, range_max: float | None) -> dict[str, object]:
    found: dict[str, object] = {
        "id": f"gonio.g{gamma:02.0f}",
        "kind": "goniometer",
        "quantity": "luminous_intensity",
        "unit": "cd",
    }
    if range_max is not None:
        found["range_max"] = float(f"{range_max:.3g}")
    return found


def _test(test: Test, maps: bool) -> dict[str, object]:
    found: dict[str, object] = {
        "id": test.name,
        "system": test.system,
        "start": utc(test.start_ns),
        "end": utc(test.end_ns),
        "sky": test.sky,
        "sun_altitude_deg": round(test.altitude_deg, 4),
        "sun_azimuth_deg": round(test.azimuth_deg, 4),
        "global_illuminance_lx": round(test.global_lx, 1),
        "diffuse_illuminance_lx": round(test.light.diffuse(test.middle_ns), 1),
    }
    if maps:
        found["simulated"] = {
            "sun": f"simulated/{test.name}-sun.ies",
            "sky": f"simulated/{test.name}-sky.ies",
        }
    return found


def _records(
    station: Station, written: Written, chosen: list[int], style: _Style, rng: np.random.Generator, measured_too: bool
) -> str:
    c = station.campaign
    area = c.distance_m**2
    lines = [COLUMNS]
    for k in chosen:
        test = c.tests[k]
        values = written.measured[k].reshape(test.times_ns.shape)
        sun, sky = (part.reshape(test.times_ns.shape) for part in written.predicted[k])
        for i, plane in enumerate(c.planes_deg):
            for j, gamma in enumerate(c.gammas_deg):
                value = float(values[i, j])
                over = style.range_max is not None and value > float(f"{style.range_max:.3g}")
                gone = not measured_too or over or (style.missing > 0.0 and rng.random() < style.missing)
                sigma = float(np.hypot(c.care.noise * max(value, 0.0), c.care.floor_lx * area))
                if not measured_too:
                    sigma = float(np.hypot(c.care.noise * (sun[i, j] + sky[i, j]), c.care.floor_lx * area))
                total, beam, rest = parts(float(sun[i, j]), float(sky[i, j]))
                cells = [
                    test.name, utc_text(int(test.times_ns[i, j])), f"gonio.g{gamma:02.0f}", f"{gamma:g}", f"{plane:g}",
                    "" if gone else number(value), number(sigma, 4), total,
                    *((beam, rest) if style.parts else ("", "")),
                ]  # fmt: skip
                lines.append(",".join(cells))
    return "\n".join(lines) + "\n"
