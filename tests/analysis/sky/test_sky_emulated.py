"""The emulated camera's pictures through the whole chain: two parties that share no code agree on sky and sun."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from analysis.hdr.fisheye import Lens
from analysis.hdr.merged import Exposure
from analysis.sky.process import Readings, SkyRecipe, SkyTest, process_sky
from analysis.sky.sun import GREENWOOD
from labdaq.clock import NS
from simulators.camera.darkroom import Optics, Shot, develop
from simulators.camera.files import ExposureData
from simulators.camera.lens import NOMINAL_VIGNETTING
from simulators.camera.shutters import COOLPIX
from simulators.world.emulated import EmulatedWorld

START = 1_279_805_520 * NS  # 2010-07-22 13:32 UTC
UP = np.array([0.0, 0.0, 1.0])
WIDTH, HEIGHT = 640, 480


@pytest.mark.parametrize(("kind", "suffix", "limit"), [("dng", ".dng", 0.01), ("jpeg:95", ".jpg", 0.03)])
@pytest.mark.parametrize("literal", [True, False])
def test_sky_and_sun_of_the_emulated_world(kind: str, suffix: str, limit: float, literal: bool, tmp_path: Path) -> None:
    world, optics = EmulatedWorld(), Optics()
    instants = [START + 9 * NS * k for k in range(len(COOLPIX))]
    shots = []
    for k, (shutter, utc_ns) in enumerate(zip(COOLPIX, instants, strict=True)):
        data = ExposureData(
            "NIKON", "E5700", "2010:07:22 09:32:00", shutter.nominal_s, Fraction(4), 100, False, Fraction(6)
        )
        seconds = float(shutter.nominal_s) if literal else shutter.ladder_s
        picture = develop(world, optics, Shot(k + 1, utc_ns, seconds, WIDTH, HEIGHT, (kind,), data), seed=1)[0]
        path = tmp_path / f"{k:02d}{suffix}"
        path.write_bytes(picture.data)
        shots.append(Exposure(path, when_s=9.0 * k))  # the times come from the files' Exif

    def roof(shaded: float, share: float) -> Readings:
        values = [world.roof_illuminance(UP, t, shaded) for t in instants]
        return Readings.of(instants, values, share * np.mean(values))

    zenith = [float(world.sky_luminance(UP[None, :], t)[0]) for t in instants]
    radius = optics.lens.circle * HEIGHT / 2.0
    lens = Lens(HEIGHT / 2.0, WIDTH / 2.0, radius, optics.lens.field_deg / 2.0, vignetting=NOMINAL_VIGNETTING)
    middle = instants[len(instants) // 2]
    test = SkyTest(
        shots,
        middle,
        GREENWOOD,
        roof(0.0, 0.01),
        roof(5.0, 0.01),
        Readings.of(instants, zenith, 0.02 * zenith[0]),
        lens,
    )
    done = process_sky(test, SkyRecipe(pixels=192))
    assert done.record["flags"] == []
    sun = world.sun(middle)
    assert done.sun.altitude_deg == pytest.approx(sun.altitude_deg, abs=0.01)
    assert done.sun.normal_illuminance_lx == pytest.approx(sun.normal_illuminance_lx, rel=0.005)
    diffuse = np.mean([world.roof_illuminance(UP, t, 0.267) for t in instants])
    assert done.sky.horizontal_illuminance() == pytest.approx(diffuse, rel=0.006)
    here = done.seen.known & (done.sky.directions[..., 2] > 0.1)
    truth = world.sky_luminance(done.sky.directions[here], middle)
    error = done.sky.luminance[here] / truth - 1.0
    assert float(np.sqrt(np.mean(error**2))) < limit
    assert done.record["zenith"]["ratio_meter_to_map"] == pytest.approx(1.0, abs=limit)
