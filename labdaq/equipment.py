"""The instruments of a station file: what each kind is told beside its port."""

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from labdaq.config import Name, NotNegative, Positive, Table
from labdaq.ports import PortKind, port_kind


def _is_port(text: str) -> str:
    port_kind(text)
    return text


PortText = Annotated[str, AfterValidator(_is_port)]


class _Entry(Table):
    """What every instrument has in the station file."""

    name: Name
    port: PortText
    serial: str = ""
    calibration: str = ""

    @property
    def emulated(self) -> bool:
        """Whether an emulator stands in for it."""
        return port_kind(self.port) is PortKind.EMULATED


class Ls110(_Entry):
    """A luminance meter LS-100 or LS-110; ``channel`` is what it looks at."""

    kind: Literal["ls110"] = "ls110"
    channel: str = "sky.zenith"
    response: Literal["fast", "slow"] = "fast"


class Cl200(_Entry):
    """A chroma meter CL-200 or CL-200A.

    Attributes
    ----------
    heads
        Channels, and the number set on the head of each (0 to 29).
    shaded
        Channels whose head stands behind a shading disc.
    """

    kind: Literal["cl200"] = "cl200"
    heads: Annotated[dict[str, Annotated[int, Field(ge=0, le=29)]], Field(min_length=1)]
    shaded: tuple[str, ...] = ()

    @field_validator("heads")
    @classmethod
    def _unique(cls, heads: dict[str, int]) -> dict[str, int]:
        if len(set(heads.values())) < len(heads):
            raise ValueError("two channels have the same head number")
        return heads

    @field_validator("shaded")
    @classmethod
    def _known(cls, shaded: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        for channel in shaded:
            if channel not in info.data.get("heads", shaded):
                raise ValueError(f"'{channel}' is not one of the heads")
        return shaded


class Camera(_Entry):
    """A camera that speaks PTP over USB or PTP/IP, looking up through a fisheye with a shading disc.

    Attributes
    ----------
    image_focal_px
        Radius of the horizon's circle in the picture [pixel] is this times pi/2 (equidistant projection); ``None``
        when it must be found from the picture.
    profile
        Which camera an emulated one imitates.
    """

    kind: Literal["camera"] = "camera"
    profile: Literal["coolpix5400", "coolpix5700", "generic"] = "coolpix5700"
    image_focal_px: Positive | None = None


class Goniophotometer(_Entry):
    """Motor arm and analog modules on one Modbus line (RTU on a serial port, Modbus TCP on a socket).

    Attributes
    ----------
    motor_unit, sensor_units
        Modbus unit numbers of the drive and of the analog modules; the heads take the modules' inputs in order,
        eight to a module.
    baud, parity
        Of the RTU line.
    settle_s
        Wait after the arm has stopped, before the heads are read [s].
    tolerance_deg
        Readings farther from where the arm was sent than this, by its encoder, are flagged ``MOVED`` [deg].
    park_c_deg
        Where the arm is parked [deg].
    """

    kind: Literal["goniophotometer"] = "goniophotometer"
    motor_unit: Annotated[int, Field(ge=1, le=247)] = 1
    sensor_units: Annotated[tuple[Annotated[int, Field(ge=1, le=247)], ...], Field(min_length=1)] = (2, 3)
    baud: Literal[9600, 19200, 38400, 57600, 115200] = 115200
    parity: Literal["N", "E", "O"] = "N"
    settle_s: NotNegative = 0.5
    tolerance_deg: Positive = 0.2
    park_c_deg: Annotated[float, Field(ge=0, lt=360)] = 0.0


AnyInstrument = Ls110 | Cl200 | Camera | Goniophotometer
InstrumentEntry = Annotated[AnyInstrument, Field(discriminator="kind")]

PORTS_OF: Final = {
    "ls110": {PortKind.SERIAL, PortKind.TCP, PortKind.EMULATED},
    "cl200": {PortKind.SERIAL, PortKind.TCP, PortKind.EMULATED},
    "camera": {PortKind.USB, PortKind.PTP_IP, PortKind.EMULATED},
    "goniophotometer": {PortKind.SERIAL, PortKind.TCP, PortKind.EMULATED},
}
"""What each kind can be reached on."""


def channels_of(entry: AnyInstrument) -> tuple[str, ...]:
    """The channels an instrument's readings go by in the station file (a goniophotometer's follow from its arm)."""
    if isinstance(entry, Ls110):
        return (entry.channel,)
    return tuple(entry.heads) if isinstance(entry, Cl200) else ()
