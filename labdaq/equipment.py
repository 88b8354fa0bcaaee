"""The instruments of a station file: what each kind is told beside its port."""

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from labdaq.config import Name, NotNegative, Positive, Table
from labdaq.ports import PortKind, port_kind


def _is_port(text: str) -> str:
    port_kind(text)
    return text


Finite = Annotated[float, Field(allow_inf_nan=False)]
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


class Fisheye(Table):
    """A fisheye lens and how its camera stands, as a calibration found them.

    Attributes
    ----------
    centre_px
        Row and column at which the axis meets the picture [pixel; the first pixel's middle is 0.5]; ``None``: the
        picture's middle, or the middle of its circle where the focal length is not known either.
    edge_deg
        Angle from the axis up to which the lens sees [deg].
    projection, coefficients
        How the distance from the centre grows with the angle; ``polynomial`` has coefficients c1, c3, c5 ... of odd
        powers of the angle over ``edge_deg``.
    vignetting
        Light at an angle over that on the axis is 1 + v1 u² + v2 u⁴ + ... with u = angle / ``edge_deg``.
    up_azimuth_deg
        Azimuth towards which the picture's top points [deg].
    east_at_right
        Whether the picture is mirrored; looking up with north at the top, east is at the left.
    """

    centre_px: tuple[Positive, Positive] | None = None
    edge_deg: Annotated[float, Field(gt=0, le=180)] = 90.0
    projection: Literal["equidistant", "equisolid", "polynomial"] = "equidistant"
    coefficients: tuple[Finite, ...] = (1.0,)
    vignetting: tuple[Finite, ...] = ()
    up_azimuth_deg: Finite = 0.0
    east_at_right: bool = False


class Camera(_Entry):
    """A camera that speaks PTP over USB or PTP/IP, looking up through a fisheye with a shading disc.

    Attributes
    ----------
    profile
        Which camera an emulated one imitates.
    image_focal_px
        Focal length in the picture: pixels per radian on the axis; ``None`` when the picture's circle has to tell.
    lens
        Everything else about the lens.
    response
        Tone curve of its JPEG pictures: ``srgb``, ``linear``, or ``recover``: found from each bracket.
    """

    kind: Literal["camera"] = "camera"
    profile: Literal["coolpix5400", "coolpix5700", "generic"] = "coolpix5700"
    image_focal_px: Positive | None = None
    lens: Fisheye = Fisheye()
    response: Literal["recover", "srgb", "linear"] = "recover"


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
