"""What a case holds: the set-up, the records, and where the predicted distributions lie."""

from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, model_validator

from analysis.photometry.distribution import Distribution
from analysis.photometry.lm63 import read_lm63
from labdaq.errors import DataError

USUAL_ARM_M = 2.6
"""Distance of the sensors where a case does not give it [m]: that of the emulated arm and of docs/cases.md."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORMAT = "labdaq-case/1"

UNITS: dict[str, tuple[str, ...]] = {
    "luminous_intensity": ("cd", "kcd"),
    "illuminance": ("lx", "klx", "fc"),
    "luminance": ("cd/m2", "cd/m²", "kcd/m2", "kcd/m²", "fL"),
}
"""Units a channel of that quantity may be in."""

_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Fraction = Annotated[float, Field(ge=0, le=1)]


class _Part(BaseModel):
    """A table of case.toml; keys that the format does not know are kept aside, not refused."""

    model_config = ConfigDict(frozen=True, extra="allow")


class Site(_Part):
    """Where the laboratory stands [deg, deg north and east positive; m]."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]
    elevation_m: float = 0.0


class Room(_Part):
    """The dark room: east-west, north-south, height [m]; the aperture is in the centre of its ceiling."""

    size_m: tuple[_Positive, _Positive, _Positive]


class Goniometer(_Part):
    """The arm: distance from the aperture's centre to each sensor [m], its angles, the shields' half angle [deg]."""

    distance_m: _Positive | None = None
    gammas_deg: tuple[float, ...] = ()
    c_planes_deg: tuple[float, ...] = ()
    sensor_half_angle_deg: Annotated[float, Field(gt=0, le=90)] = 90.0


class Simulation(_Part):
    """How the prediction was made: ``field`` far or near, mechanisms it ``includes``, bounce limit (0 = none known)."""

    engine: str = ""
    field: Literal["far", "near"] = "far"
    includes: tuple[str, ...] = ()
    max_bounces: Annotated[int, Field(ge=0)] = 0


class Aperture(_Part):
    """The opening towards the room: a rectangle (east-west, north-south) or a disc [m]."""

    shape: Literal["rectangle", "disc"]
    size_m: tuple[_Positive, _Positive] | None = None
    diameter_m: _Positive | None = None

    @model_validator(mode="after")
    def _has_its_size(self) -> "Aperture":
        if self.shape == "rectangle" and self.size_m is None:
            raise ValueError("a rectangle needs size_m = [east-west, north-south]")
        if self.shape == "disc" and self.diameter_m is None:
            raise ValueError("a disc needs diameter_m")
        return self

    @property
    def area_m2(self) -> float:
        """Area of the opening [m²]."""
        if self.size_m is not None and self.shape == "rectangle":
            return self.size_m[0] * self.size_m[1]
        assert self.diameter_m is not None
        return float(np.pi * self.diameter_m**2 / 4)


class System(_Part):
    """What hung in the roof, as the simulation assumed it."""

    id: str
    kind: Literal["top", "box", "tube"] | None = None
    aperture: Aperture | None = None
    well_depth_m: Annotated[float, Field(ge=0)] | None = None
    wall_reflectance: _Fraction | None = None
    wall_finish: Literal["specular", "diffuse"] | None = None
    lens: str | None = None


class Channel(_Part):
    """One instrument's channel; above ``range_max`` [unit] it cannot read; it shows steps of ``resolution`` [unit]."""

    id: str
    kind: Literal["goniometer", "illuminance-meter", "luminance-meter", "camera"]
    quantity: Literal["luminous_intensity", "illuminance", "luminance"]
    unit: str
    range_max: _Positive | None = None
    resolution: Annotated[float, Field(ge=0)] | None = None

    @model_validator(mode="after")
    def _unit_fits(self) -> "Channel":
        if self.unit not in UNITS[self.quantity]:
            raise ValueError(
                f"unit '{self.unit}' does not fit {self.quantity}; use one of {', '.join(UNITS[self.quantity])}"
            )
        return self


class Parts(_Part):
    """Files of a predicted distribution, relative to the case: the parts apart, or the total alone."""

    sun: str | None = None
    sky: str | None = None
    total: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The files that are named."""
        return tuple(name for name in (self.sun, self.sky, self.total) if name is not None)


class Test(_Part):
    """One test: a system under one sky. Sun angles are for the middle of the test [deg]."""

    id: str
    system: str | None = None
    start: AwareDatetime | None = None
    end: AwareDatetime | None = None
    sky: Literal["clear", "partly-cloudy", "overcast"] | None = None
    sun_altitude_deg: Annotated[float, Field(ge=-90, le=90)] | None = None
    sun_azimuth_deg: Annotated[float, Field(ge=-360, le=720)] | None = None
    global_illuminance_lx: Annotated[float, Field(ge=0)] | None = None
    diffuse_illuminance_lx: Annotated[float, Field(ge=0)] | None = None
    simulated: Parts | None = None

    @property
    def middle(self) -> datetime | None:
        """Half way between start and end; either alone if only one is known."""
        if self.start is None or self.end is None:
            return self.start or self.end
        return self.start + (self.end - self.start) / 2


class Variant(_Part):
    """The same simulation run again with one thing changed, for some or all tests."""

    mechanism: str
    setting: dict[str, Any] = {}
    simulated: dict[str, Parts] = {}


class CaseFile(_Part):
    """The whole of case.toml."""

    format: Literal["labdaq-case/1"]
    title: str = ""
    site: Site | None = None
    room: Room | None = None
    goniometer: Goniometer | None = None
    simulation: Simulation = Simulation()
    system: tuple[System, ...] = ()
    channel: Annotated[tuple[Channel, ...], Field(min_length=1)]
    test: Annotated[tuple[Test, ...], Field(min_length=1)]
    variant: tuple[Variant, ...] = ()

    @property
    def distance_m(self) -> float | None:
        """From the aperture's centre to each sensor of the arm [m], where the case says it."""
        return self.goniometer.distance_m if self.goniometer else None


@dataclass(frozen=True)
class Records:
    """The compared readings, one array element per row of records.csv, in the file's order.

    Attributes
    ----------
    test, channel : shape (N,)
        Indices into the case's tests and channels.
    utc_ns : shape (N,)
        Middle of the integration; -1 where the file gives no time.
    gamma_deg, c_deg : shape (N,) [deg]
        NaN where the instrument has no such angle.
    measured : shape (N,) [the channel's unit]
        NaN where the reading is missing.
    uncertainty : shape (N,)
        Standard uncertainty of the reading's noise alone.
    simulated, sun, sky : shape (N,)
        The prediction and its parts; the parts are NaN where they are not known.
    """

    test: Ints
    channel: Ints
    utc_ns: Ints
    gamma_deg: Floats
    c_deg: Floats
    measured: Floats
    uncertainty: Floats
    simulated: Floats
    sun: Floats
    sky: Floats

    def __len__(self) -> int:
        return len(self.test)

    def where(self, keep: NDArray[np.bool_]) -> "Records":
        """Only the rows where ``keep`` holds."""
        return Records(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))

    @property
    def has_parts(self) -> NDArray[np.bool_]:
        """Rows whose prediction is known as sun part and sky part apart; shape (N,)."""
        return np.isfinite(self.sun) & np.isfinite(self.sky)


def distribution(path: Path) -> Distribution:
    """The distribution in an .ies file; read once as long as the file does not change. Raises `DataError`."""
    try:
        state = path.stat()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    return _read_once(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=256)
def _read_once(path: Path, mtime_ns: int, size: int) -> Distribution:
    return read_lm63(path).distribution


@dataclass(frozen=True)
class Case:
    """A case as read from ``folder``: its set-up and its records."""

    folder: Path
    setup: CaseFile
    records: Records

    @property
    def tests(self) -> tuple[Test, ...]:
        """The tests, in the order that `Records.test` counts them."""
        return self.setup.test

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels, in the order that `Records.channel` counts them."""
        return self.setup.channel

    def distribution(self, name: str) -> Distribution:
        """A predicted distribution of the case by its file's name; raises `DataError` when it cannot be read."""
        return distribution(self.folder / name)

    def system_of(self, test: Test) -> System | None:
        """The system that hung in the roof during ``test``; ``None`` if the case does not describe it."""
        return next((s for s in self.setup.system if s.id == test.system), None)
