"""The station file: where the laboratory stands, what it measures with, and how each instrument is reached.

docs/formats.md describes every field. `Station` is what the other rooms get to see of it.
"""

from datetime import date as Date  # noqa: N812
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import AwareDatetime, Field, ValidationInfo, field_validator

from labdaq.config import Fraction01, Name, NotNegative, Positive, Table, load, parse
from labdaq.equipment import PORTS_OF, AnyInstrument, InstrumentEntry, channels_of
from labdaq.ports import port_kind

FORMAT: Final = "labdaq-station/1"
GREENWOOD_GAMMAS_DEG: Final = (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 85.0)

Finite = Annotated[float, Field(allow_inf_nan=False)]
Gamma = Annotated[float, Field(ge=0, le=90)]
"""Gamma of a sensor [deg]; the arm reaches from nadir to the horizon."""


class Site(Table):
    """Where the station stands.

    Attributes
    ----------
    latitude_deg, longitude_deg
        WGS 84, north and east positive [deg].
    elevation_m
        Above sea level [m].
    """

    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]
    elevation_m: Annotated[float, Field(ge=-500, le=9000)] = 0.0


class ClockPolicy(Table):
    """What the station's clock is held to.

    Attributes
    ----------
    max_error_s
        Largest bound on the offset from UTC [s] at which the clock still counts as synchronised.
    check_every_s
        How often its state is written into the journal [s].
    """

    max_error_s: Positive = 0.5
    check_every_s: Positive = 10.0


class Room(Table):
    """The dark room under the skylight; the aperture is in the centre of its ceiling.

    Attributes
    ----------
    size_m
        East-west, north-south, height [m].
    wall_reflectance, floor_reflectance
        Diffuse reflectances [1].
    """

    size_m: tuple[Positive, Positive, Positive] = (5.486, 5.486, 5.486)
    wall_reflectance: Fraction01 = 0.043
    floor_reflectance: Fraction01 = 0.015


class Arm(Table):
    """The goniophotometer's geometry and the calibration of its heads.

    Attributes
    ----------
    distance_m
        Centre of the aperture to each sensor [m].
    gammas_deg
        Where the heads sit on the arm [deg], increasing.
    sensor_half_angle_deg
        Acceptance of the heads' shields [deg].
    sensitivity_v_per_lx
        Output of each head's amplifier [V/lx]; one number stands for all heads. With the default, ±10 V reach to
        33 klx and one step of a 16-bit converter is 1 lx; dim light is read in finer ranges.
    dark_v
        Output of each head in the dark [V]; one number stands for all heads.
    """

    distance_m: Positive = 2.6
    gammas_deg: Annotated[tuple[Gamma, ...], Field(min_length=1, max_length=16)] = GREENWOOD_GAMMAS_DEG
    sensor_half_angle_deg: Annotated[float, Field(gt=0, le=90)] = 60.0
    sensitivity_v_per_lx: Positive | tuple[Positive, ...] = 0.0003
    dark_v: Finite | tuple[Finite, ...] = 0.0

    @field_validator("gammas_deg")
    @classmethod
    def _increase(cls, gammas: tuple[float, ...]) -> tuple[float, ...]:
        if any(b <= a for a, b in pairwise(gammas)):
            raise ValueError("the angles must increase from one head to the next")
        return gammas

    @field_validator("sensitivity_v_per_lx", "dark_v")
    @classmethod
    def _one_each(cls, value: float | tuple[float, ...], info: ValidationInfo) -> float | tuple[float, ...]:
        heads = len(info.data.get("gammas_deg", ()))
        if isinstance(value, tuple) and heads and len(value) != heads:
            raise ValueError(f"there are {heads} heads, but {len(value)} values")
        return value

    @property
    def sensitivities_v_per_lx(self) -> tuple[float, ...]:
        """One sensitivity per head [V/lx]."""
        return self._per_head(self.sensitivity_v_per_lx)

    @property
    def darks_v(self) -> tuple[float, ...]:
        """One dark voltage per head [V]."""
        return self._per_head(self.dark_v)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channel of each head: ``gonio.g0``, ``gonio.g5``, ... after its gamma."""
        return tuple(f"gonio.g{gamma:g}" for gamma in self.gammas_deg)

    def _per_head(self, value: float | tuple[float, ...]) -> tuple[float, ...]:
        return value if isinstance(value, tuple) else (value,) * len(self.gammas_deg)


class ShadingDisc(Table):
    """The discs that keep the sun off the camera and off the shaded heads; ``half_angle_deg`` is what they hide."""

    half_angle_deg: Annotated[float, Field(gt=0, lt=30)] = 5.0


class Calibration(Table):
    """A calibration certificate.

    Attributes
    ----------
    uncertainty
        Relative expanded uncertainty of the factor [1], with ``coverage_factor``.
    factor
        What readings are to be multiplied by [1]; they are recorded as the instrument gave them.
    file
        The certificate itself; its SHA-256 is written into each session.
    """

    id: Name
    instrument: str
    date: Date
    expires: Date | None = None
    factor: Positive = 1.0
    uncertainty: NotNegative = 0.0
    coverage_factor: Positive = 2.0
    file: str = ""


class Emulation(Table):
    """What emulated instruments observe, and how fast.

    Attributes
    ----------
    system
        The skylight in the roof.
    sky, cloud_cover
        Kind of sky, and the part of it that drifting clouds cover [1].
    start
        UTC at which the emulated time starts; now, when it is not given.
    seed
        Of everything random.
    pacing
        Whether serial lines run at the pace of their baud rate.
    rate
        Emulated seconds per real second.
    """

    system: Literal["top", "box", "tube"] = "box"
    sky: Literal["clear", "partly-cloudy", "overcast"] = "clear"
    cloud_cover: Fraction01 = 0.0
    start: AwareDatetime | None = None
    seed: Annotated[int, Field(ge=0)] = 1
    pacing: bool = True
    rate: Positive = 1.0


class Station(Table):
    """A whole station file; ``sessions`` is relative to the file's own folder."""

    format: Literal["labdaq-station/1"] = FORMAT
    name: Name
    sessions: str = "sessions"
    site: Site
    clock: ClockPolicy = ClockPolicy()
    room: Room = Room()
    goniometer: Arm = Arm()
    shading_disc: ShadingDisc = ShadingDisc()
    emulation: Emulation | None = None
    calibration: tuple[Calibration, ...] = ()
    instrument: tuple[InstrumentEntry, ...]

    @field_validator("calibration")
    @classmethod
    def _ids(cls, certificates: tuple[Calibration, ...]) -> tuple[Calibration, ...]:
        _refuse(_twice("certificate id", [c.id for c in certificates]))
        return certificates

    @field_validator("instrument")
    @classmethod
    def _fit_together(cls, entries: tuple[InstrumentEntry, ...], info: ValidationInfo) -> tuple[InstrumentEntry, ...]:
        found = [] if entries else ["there is none"]
        found += _twice("instrument name", [e.name for e in entries])
        found += _twice("port", [e.port for e in entries if not e.emulated])
        found += _twice("channel", [channel for e in entries for channel in channels_of(e)])
        for entry in entries:
            if port_kind(entry.port) not in PORTS_OF[entry.kind]:
                found.append(f"'{entry.name}': a {entry.kind} cannot be reached on {entry.port!r}")
        if any(e.emulated for e in entries) and "emulation" in info.data and not info.data["emulation"]:
            found.append("some instruments are emulated, but there is no [emulation] table")
        names = {e.name for e in entries}
        certificates = {c.id: c for c in info.data.get("calibration", ())}
        for c in certificates.values():
            if c.instrument not in names:
                found.append(f"certificate '{c.id}' is for '{c.instrument}', which is not an instrument here")
        for e in entries:
            if e.calibration and "calibration" in info.data and e.calibration not in certificates:
                found.append(f"'{e.name}': there is no [[calibration]] with id '{e.calibration}'")
        _refuse(found)
        return entries

    @property
    def emulated(self) -> bool:
        """Whether every instrument is emulated, so that the station's time may be, too."""
        return all(e.emulated for e in self.instrument)

    def of_kind(self, kind: str) -> list[AnyInstrument]:
        """The instruments of a kind, in the file's order."""
        return [e for e in self.instrument if e.kind == kind]

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a station file; raises `ConfigError` listing all mistakes."""
        return load(path, cls)

    @classmethod
    def built_in(cls) -> Self:
        """The emulated station that is used when no file is given."""
        return parse(files("labdaq").joinpath("examples/station.toml").read_text("utf-8"), cls, "the built-in station")


def _twice(what: str, values: list[str]) -> list[str]:
    return [f"{what} '{value}' is given twice" for value in dict.fromkeys(values) if values.count(value) > 1]


def _refuse(found: list[str]) -> None:
    if found:
        raise ValueError("\n".join(found))
