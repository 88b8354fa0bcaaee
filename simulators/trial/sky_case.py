"""Make one case of a sky camera: draw brackets, conceal something in the camera, write what is compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labdaq.clock import NS, utc_text
from simulators.trial import sky, sky_dials
from simulators.trial.dials import relative, rms_change, setting_for
from simulators.trial.files import COLUMNS, number, toml, utc
from simulators.trial.made import Made, Order
from simulators.trial.rivals import rivals
from simulators.trial.sky import SkyCampaign, SkyDial, SkyStation, SkyTest, SkyWorld
from simulators.trial.truth import Concealed, Truth

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Laid:
    dial: SkyDial
    setting: float
    effect: float


def make(order: Order) -> Made:
    """Make the case that was ordered; raises `ValueError` where an ordered cause has no place in any campaign."""
    rng = np.random.default_rng(order.seed)
    for _ in range(30):
        station = SkyStation(sky.draw(rng, broken="cloud-motion" in order.conceal), rng)
        laid = _lay(order, station, rng)
        if laid is not None:
            return _made(order, station, laid, rng)
    raise ValueError(f"no campaign could be drawn that conceals {', '.join(order.conceal)}")


def _lay(order: Order, station: SkyStation, rng: np.random.Generator) -> list[_Laid] | None:
    laid = []
    for name, wanted in zip(order.conceal, order.effects, strict=True):
        dial = (sky_dials.INSIDE.get(name) or sky_dials.OUTSIDE[name])(rng, station)
        if dial is None:
            return None
        setting, reached = setting_for(station, dial, wanted, SkyWorld())
        if reached < 5e-4:
            return None
        laid.append(_Laid(dial, setting, reached))
    return laid


def _made(order: Order, station: SkyStation, laid: list[_Laid], rng: np.random.Generator) -> Made:
    world = SkyWorld()
    for one in laid:
        world = one.dial.apply(world, one.setting)
    c, floor = station.campaign, station.floor
    clean, plain, unspoilt = station.read(world), station.predict(), station.read(SkyWorld())
    measured = [_noisy(c, values, rng) for values in clean]
    every = list(range(len(c.tests)))
    back = []
    if order.withhold and len(every) >= 5:
        back = sorted(int(k) for k in rng.choice(every, size=max(1, len(every) // 5), replace=False))
    kept = [k for k in every if k not in back]
    changes = [relative(a, b, floor) for a, b in zip(clean, unspoilt, strict=True)]
    truth = Truth(
        case=order.name,
        kind="camera",
        seed=order.seed,
        content=order.content,
        concealed=tuple(_told(station, one, rng) for one in laid),
        effect_percent=100.0 * rms_change(clean, unspoilt, floor, free_gain=False) if laid else 0.0,
        mismatch_percent=100.0 * rms_change(clean, plain, floor, free_gain=False),
        nuisance_percent=100.0 * rms_change(unspoilt, plain, floor, free_gain=False),
        free_gain=False,
        floor=floor,
        clean=tuple(np.concatenate([clean[k] for k in kept])),
        change=tuple(np.concatenate([changes[k] for k in kept])),
        withheld_clean=tuple(np.concatenate([clean[k] for k in back])) if back else (),
        care={"noise": c.noise, "sky_ripple": c.sky_ripple, "test_gain": c.test_gain},
        notes={"site": c.site_name, "against": "model" if c.against_model else "luminance meter"},
    )
    files = _files(c, kept, measured, plain, with_readings=True)
    return Made(order, files, _files(c, back, measured, plain, with_readings=False) if back else {}, truth)


def _told(station: SkyStation, one: _Laid, rng: np.random.Generator) -> Concealed:
    dial = one.dial
    alike: tuple[str, ...] = ()
    if dial.inside:
        on, off = (station.read(dial.apply(SkyWorld(), x)) for x in (one.setting, 0.0))
        change = [relative(a, b, station.floor) for a, b in zip(on, off, strict=True)]
        others = {name: maker for name, maker in sky_dials.INSIDE.items() if name != dial.id}
        alike = rivals(station, others, SkyWorld(), change, station.campaign.noise, rng)
    return Concealed(
        id=dial.id,
        stage=dial.stage,
        inside=dial.inside,
        effect_percent=100.0 * one.effect,
        raw_percent=100.0 * one.effect,
        parameters=dial.report(one.setting),
        equivalents=alike,
        notes=dict(dial.notes),
    )


def _noisy(c: SkyCampaign, values: Floats, rng: np.random.Generator) -> Floats:
    gain = 1.0 + c.test_gain * rng.normal()
    return values * gain + rng.normal(size=len(values)) * np.hypot(c.noise * values, c.floor_cdm2)


def _files(
    c: SkyCampaign, chosen: list[int], measured: list[Floats], predicted: list[Floats], with_readings: bool
) -> dict[str, str]:
    lines = [COLUMNS]
    for k in chosen:
        test = c.tests[k]
        for i in range(len(test.directions)):
            value, expected = float(measured[k][i]), float(predicted[k][i])
            sigma = float(np.hypot(c.noise * expected, c.floor_cdm2))
            towards = (360.0 - float(test.azimuths_deg[i])) % 360.0
            cells = [
                test.name, utc_text(test.middle_ns), "camera.sky", f"{90.0 + test.altitudes_deg[i]:g}", f"{towards:g}",
                number(value) if with_readings else "", number(sigma, 4), number(expected), "", "",
            ]  # fmt: skip
            lines.append(",".join(cells))
    return {"case.toml": toml(_document(c, [c.tests[k] for k in chosen])), "records.csv": "\n".join(lines) + "\n"}


def _document(c: SkyCampaign, tests: list[SkyTest]) -> dict[str, object]:
    return {
        "format": "labdaq-case/1",
        "title": f"Sky luminance by camera, {c.site_name}",
        "site": {
            "latitude_deg": c.site.latitude_deg,
            "longitude_deg": c.site.longitude_deg,
            "elevation_m": c.site.elevation_m,
        },
        "simulation": {
            "engine": "sky model" if c.against_model else "luminance meter beside it",
            "includes": [],
        },
        "channel": [{"id": "camera.sky", "kind": "camera", "quantity": "luminance", "unit": "cd/m2"}],
        "test": [_test(test) for test in tests],
    }


def _test(test: SkyTest) -> dict[str, object]:
    sun, diffuse = test.light.sun(test.middle_ns), test.light.diffuse(test.middle_ns)
    return {
        "id": test.name,
        "start": utc(test.start_ns),
        "end": utc(test.start_ns + 40 * NS),
        "sky": test.sky,
        "sun_altitude_deg": round(float(np.degrees(np.arcsin(sun.direction[2]))), 4),
        "sun_azimuth_deg": round(float(np.degrees(np.arctan2(sun.direction[0], sun.direction[1])) % 360.0), 4),
        "global_illuminance_lx": round(sun.normal_lx * float(sun.direction[2]) + diffuse, 1),
        "diffuse_illuminance_lx": round(diffuse, 1),
    }
