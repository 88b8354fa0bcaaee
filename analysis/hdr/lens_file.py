"""The file in which a person describes the camera's lens (TOML).

::

    [lens]
    centre = [1849.7, 2838.7]     # row and column of the axis in the full picture [pixel]
    radius = 1835.3               # distance from it at which edge_deg is seen [pixel]
    edge_deg = 90.0
    projection = "equisolid"      # or "equidistant", "polynomial" with coefficients = [c1, c3, ...]
    up_azimuth_deg = 0.0          # azimuth towards which the picture's top points
    east_at_right = false
    vignetting = [0.176, -0.529]  # 1 + v1 u² + v2 u⁴ ..., u = angle / edge; of the aperture used, or for each one:
    # vignetting = { "5.6" = [0.176, -0.529], "8" = [0.15, -0.45] }

    [luminance]
    scale = 25.1                  # cd/m² for a signal of one per second; leave out when unknown
    row = [0.2126, 0.7152, 0.0722]

Only ``centre`` and ``radius`` must be there.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from analysis.hdr.bracket import Crop
from analysis.hdr.fisheye import Lens
from labdaq.errors import ConfigError, Problems

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LensSection(_Strict):
    """``[lens]``."""

    centre: tuple[Finite, Finite]
    radius: Positive
    edge_deg: Annotated[float, Field(gt=0.0, le=180.0)] = 90.0
    projection: Literal["equidistant", "equisolid", "polynomial"] = "equidistant"
    coefficients: tuple[Finite, ...] = (1.0,)
    up_azimuth_deg: Finite = 0.0
    east_at_right: bool = False
    vignetting: tuple[Finite, ...] | dict[str, tuple[Finite, ...]] = ()


class LuminanceSection(_Strict):
    """``[luminance]``."""

    scale: Positive | None = None
    row: tuple[Finite, Finite, Finite] | None = None


class LensFile(_Strict):
    """A lens file."""

    lens: LensSection
    luminance: LuminanceSection = LuminanceSection()

    @property
    def crop(self) -> Crop:
        """The part of the picture that holds the circle, with two pixels to spare (even, for mosaics)."""
        row, column = self.lens.centre
        reach = self.lens.radius + 2.0
        top, left = int(max(0.0, row - reach)) // 2 * 2, int(max(0.0, column - reach)) // 2 * 2
        return Crop(top, left, int(row + reach + 1) // 2 * 2 - top, int(column + reach + 1) // 2 * 2 - left)

    def lens_in(self, crop: Crop, f_number: float | None = None) -> Lens:
        """The lens in the coordinates of a part of the picture, with the vignetting of an aperture.

        Raises `ValueError` for a lens that cannot be, and `ConfigError` when the vignetting is given by aperture, but
        not for this one.
        """
        part = self.lens
        return Lens(
            part.centre[0] - crop.top,
            part.centre[1] - crop.left,
            part.radius,
            part.edge_deg,
            part.projection,
            part.coefficients,
            part.up_azimuth_deg,
            part.east_at_right,
            self.vignetting_at(f_number),
        )

    def vignetting_at(self, f_number: float | None) -> tuple[float, ...]:
        """Vignetting coefficients at an aperture; raises `ConfigError` when the file has none for it."""
        table = self.lens.vignetting
        if not isinstance(table, dict):
            return table
        for name, coefficients in table.items():
            if f_number is not None and abs(float(name) / f_number - 1.0) < 0.03:
                return coefficients
        used = "an unknown aperture" if f_number is None else f"f/{f_number:g}"
        raise ConfigError(
            f"the lens file has vignetting for f/{', f/'.join(table)}, but the exposures were taken at {used}",
            "measure it at that aperture; vignetting of another is several per cent off at the rim",
        )

    @field_validator("lens")
    @classmethod
    def _apertures_are_numbers(cls, lens: LensSection) -> LensSection:
        if isinstance(lens.vignetting, dict):
            for name in lens.vignetting:
                if not name.replace(".", "", 1).isdigit() or float(name) <= 0.0:
                    raise ValueError(f"vignetting: '{name}' is no aperture; write \"5.6\" = [...]")
        return lens


def read_lens(path: Path) -> LensFile:
    """Read a lens file; raises `ConfigError` that lists all its mistakes."""
    problems = Problems(str(path))
    try:
        found = LensFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
        for name in found.lens.vignetting if isinstance(found.lens.vignetting, dict) else ("1",):
            found.lens_in(found.crop, float(name))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        for mistake in error.errors():
            problems.add(".".join(str(word) for word in mistake["loc"]), mistake["msg"])
    except (tomllib.TOMLDecodeError, ValueError) as error:
        problems.add("file" if isinstance(error, tomllib.TOMLDecodeError) else "lens", str(error))
    else:
        return found
    problems.raise_if_any(ConfigError, "see the example in analysis/hdr/lens_file.py")
    raise AssertionError("unreachable")
