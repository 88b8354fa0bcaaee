"""Make one case of roof meters: draw some days, conceal something in one meter, and write what the log would hold."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, utc_text
from simulators.trial import roof, roof_dials
from simulators.trial.dials import relative, rms_change, setting_for
from simulators.trial.files import COLUMNS, number, parts, toml, utc
from simulators.trial.made import Made, Order
from simulators.trial.rivals import rivals
from simulators.trial.roof import RoofCampaign, RoofDial, RoofStation, RoofTest, RoofWorld
from simulators.trial.truth import Concealed, Truth

Floats = NDArray[np.float64]

SAME: Final[dict[str, tuple[str, ...]]] = {"meter-range-limit": ("saturation",)}
"""By id: the same physics under the catalogue's other name for it."""


@dataclass(frozen=True)
class _Laid:
    dial: RoofDial
    setting: float
    effect: float


def make(order: Order) -> Made:
    """Make the case that was ordered; raises `ValueError` where an ordered cause has no place in any campaign."""
    rng = np.random.default_rng(order.seed)
    for _ in range(20):
        station = RoofStation(roof.draw(rng), rng)
        laid = _lay(order, station, rng)
        if laid is not None:
            return _made(order, station, laid, rng)
    raise ValueError(f"no campaign could be drawn that conceals {', '.join(order.conceal)}")


def _lay(order: Order, station: RoofStation, rng: np.random.Generator) -> list[_Laid] | None:
    laid = []
    for name, wanted in zip(order.conceal, order.effects, strict=True):
        maker = roof_dials.INSIDE.get(name) or roof_dials.OUTSIDE[name]
        dial = maker(rng, station)
        setting, reached = setting_for(station, dial, wanted, RoofWorld())
        if reached < 5e-4:
            return None
        laid.append(_Laid(dial, setting, reached))
    return laid


def _made(order: Order, station: RoofStation, laid: list[_Laid], rng: np.random.Generator) -> Made:
    world = RoofWorld()
    for one in laid:
        world = one.dial.apply(world, one.setting)
    clean, predicted = station.read(world), station.predict()
    unspoilt = station.read(RoofWorld())
    plain = [sun + sky for sun, sky in predicted]
    c = station.campaign
    measured = [_noisy(c, values, rng) for values in clean]
    shown = predicted if c.against_model else [_seen(c, two, rng) for two in predicted]
    kept, withheld = _withhold(order, c, rng)
    floor = station.floor
    per_record = [relative(a, b, floor) for a, b in zip(clean, unspoilt, strict=True)]
    truth = Truth(
        case=order.name,
        kind="roof",
        seed=order.seed,
        content=order.content,
        concealed=tuple(_told(station, one, rng) for one in laid),
        effect_percent=100.0 * rms_change(clean, unspoilt, floor, free_gain=False) if laid else 0.0,
        mismatch_percent=100.0 * rms_change(clean, plain, floor, free_gain=False),
        nuisance_percent=100.0 * rms_change(unspoilt, plain, floor, free_gain=False),
        free_gain=False,
        floor=floor,
        clean=tuple(np.concatenate([clean[k] for k in kept])),
        change=tuple(np.concatenate([per_record[k] for k in kept])),
        withheld_clean=tuple(np.concatenate([clean[k] for k in withheld])) if withheld else (),
        care={"noise": c.noise, "floor_lx": c.floor_lx, "model_ripple": c.model_ripple},
        notes={"site": c.site_name, "against": "model" if c.against_model else "second meter"},
    )
    files = _files(c, kept, measured, shown, with_readings=True)
    back = _files(c, withheld, measured, shown, with_readings=False) if withheld else {}
    return Made(order, files, back, truth)


def _told(station: RoofStation, one: _Laid, rng: np.random.Generator) -> Concealed:
    dial = one.dial
    on, off = (station.read(dial.apply(RoofWorld(), x)) for x in (one.setting, 0.0))
    change = [relative(a, b, station.floor) for a, b in zip(on, off, strict=True)]
    alike: tuple[str, ...] = ()
    if dial.inside:
        others = {name: maker for name, maker in roof_dials.INSIDE.items() if name != dial.id}
        alike = rivals(station, others, RoofWorld(), change, station.campaign.noise, rng)
    return Concealed(
        id=dial.id,
        stage=dial.stage,
        inside=dial.inside,
        effect_percent=100.0 * one.effect,
        raw_percent=100.0 * one.effect,
        parameters=dial.report(one.setting),
        equivalents=(*SAME.get(dial.id, ()), *alike),
        notes=dict(dial.notes),
    )


def _noisy(c: RoofCampaign, values: Floats, rng: np.random.Generator) -> Floats:
    """Readings as logged: noise, and rounded to what the display shows."""
    level = values + rng.normal(size=len(values)) * np.hypot(c.noise * values, c.floor_lx)
    return np.maximum(0.0, np.round(level / c.resolution_lx) * c.resolution_lx)


def _seen(c: RoofCampaign, two: tuple[Floats, Floats], rng: np.random.Generator) -> tuple[Floats, Floats]:
    """The reference meter's global and shaded readings, with its own noise; sun part by difference."""
    sun, sky = two
    total = (sun + sky) * (1.0 + c.noise * rng.normal(size=len(sun)))
    shaded = sky * (1.0 + c.noise * rng.normal(size=len(sun)))
    shaded = np.minimum(shaded, total)
    return total - shaded, shaded


def _withhold(order: Order, c: RoofCampaign, rng: np.random.Generator) -> tuple[list[int], list[int]]:
    every = list(range(len(c.tests)))
    if not order.withhold or len(every) < 4:
        return every, []
    back = sorted(int(k) for k in rng.choice(every, size=max(1, len(every) // 5), replace=False))
    return [k for k in every if k not in back], back


def _files(
    c: RoofCampaign,
    chosen: list[int],
    measured: list[Floats],
    shown: list[tuple[Floats, Floats]],
    with_readings: bool,
) -> dict[str, str]:
    lines = [COLUMNS]
    for k in chosen:
        test = c.tests[k]
        for i, t in enumerate(test.times_ns):
            value = float(measured[k][i])
            over = c.range_max_lx is not None and value > c.range_max_lx
            total, beam, rest = parts(float(shown[k][0][i]), float(shown[k][1][i]))
            rounding = c.resolution_lx / 12.0**0.5
            reference = 1.0 if c.against_model else 2.0**0.5  # the other meter's noise is in the comparison as well
            sigma = float(np.hypot(np.hypot(reference * c.noise * float(total), c.floor_lx), rounding))
            cells = [
                test.name, utc_text(int(t)), "roof.global", "", "", "" if over or not with_readings else number(value),
                number(sigma, 4), total, beam, rest,
            ]  # fmt: skip
            lines.append(",".join(cells))
    return {"case.toml": toml(_document(c, [c.tests[k] for k in chosen])), "records.csv": "\n".join(lines) + "\n"}


def _document(c: RoofCampaign, tests: list[RoofTest]) -> dict[str, object]:
    channel: dict[str, object] = {
        "id": "roof.global",
        "kind": "illuminance-meter",
        "quantity": "illuminance",
        "unit": "lx",
        "resolution": c.resolution_lx,
    }
    if c.range_max_lx is not None:
        channel["range_max"] = c.range_max_lx
    return {
        "format": "labdaq-case/1",
        "title": f"Roof meter, {c.site_name}",
        "site": {
            "latitude_deg": c.site.latitude_deg,
            "longitude_deg": c.site.longitude_deg,
            "elevation_m": c.site.elevation_m,
        },
        "simulation": {
            "engine": "sky model" if c.against_model else "second illuminance meter beside it",
            "includes": [],
        },
        "channel": [channel],
        "test": [_test(test) for test in tests],
    }


def _test(test: RoofTest) -> dict[str, object]:
    middle = int(test.times_ns[len(test.times_ns) // 2])
    sun = test.light.sun(middle)
    diffuse = test.light.diffuse(middle)
    return {
        "id": test.name,
        "start": utc(int(test.times_ns[0]) - NS),
        "end": utc(int(test.times_ns[-1]) + NS),
        "sky": test.sky,
        "sun_altitude_deg": round(float(np.degrees(np.arcsin(sun.direction[2]))), 4),
        "sun_azimuth_deg": round(float(np.degrees(np.arctan2(sun.direction[0], sun.direction[1])) % 360.0), 4),
        "global_illuminance_lx": round(sun.normal_lx * float(sun.direction[2]) + diffuse, 1),
        "diffuse_illuminance_lx": round(diffuse, 1),
    }
