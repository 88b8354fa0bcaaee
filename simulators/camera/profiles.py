"""What three cameras can do, as data: device information, properties and habits.

``coolpix5400`` and ``coolpix5700`` restate the dumps of real cameras that libgphoto2 keeps (nikon-coolpix5400.txt,
firmware E5400v1.4; nikon-coolpix5700.txt, firmware E5700v1.1); ``generic`` is like a Nikon DSLR as far as standard
PTP goes. Two dealings of the emulation are not in the dumps: the small picture is the size at power-up, and the raw
file is a DNG.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from simulators.camera.shutters import COOLPIX, THIRD_STOPS, Shutter

UINT8, UINT16, INT16, UINT32, STRING = 0x0002, 0x0004, 0x0003, 0x0006, 0xFFFF

BATTERY, IMAGE_SIZE, COMPRESSION, F_NUMBER, FOCAL_LENGTH = 0x5001, 0x5003, 0x5004, 0x5007, 0x5008
EXPOSURE_TIME, PROGRAM, ISO, DATE_TIME, NIKON_EXPOSURE_TIME = 0x500D, 0x500E, 0x500F, 0x5011, 0xD100
MANUAL, PROGRAMMED, APERTURE_PRIORITY, SHUTTER_PRIORITY = 1, 2, 3, 4
AUTO_ISO: Final = 0xFFFF

Choice = int | str


@dataclass(frozen=True, slots=True)
class Property:
    """A device property.

    Attributes
    ----------
    code, type
        PTP codes.
    value
        Factory default and value at power-up.
    choices
        Allowed values; empty: any.
    writable
        Whether it can be set.
    """

    code: int
    type: int
    value: Choice
    choices: tuple[Choice, ...] = ()
    writable: bool = True


@dataclass(frozen=True, slots=True)
class CameraProfile:
    """A camera model.

    Attributes
    ----------
    name
        What options call it.
    model, version
        As DeviceInfo says; the manufacturer is Nikon Corporation.
    product_id
        USB product under vendor 04B0h.
    operations, events, image_formats
        Codes DeviceInfo lists.
    unlisted_operations
        Codes that work without being listed.
    properties
        In DeviceInfo's order.
    dead_properties
        Listed, but every query answers 200Ah.
    shutters
        What the shutter can do, whether or not PTP can choose.
    qualities
        Value of CompressionSetting to the files it makes.
    capture_complete
        Whether CaptureComplete is sent over USB. PTP/IP always needs it: clients wait for it for ever.
    dial_gates
        Whether shutter and aperture are read-only unless the program mode uses them.
    packet
        Largest USB packet [bytes].
    """

    name: str
    model: str
    version: str
    product_id: int
    operations: tuple[int, ...]
    events: tuple[int, ...]
    image_formats: tuple[int, ...]
    properties: tuple[Property, ...]
    shutters: tuple[Shutter, ...]
    qualities: Mapping[int, tuple[str, ...]]
    unlisted_operations: tuple[int, ...] = ()
    dead_properties: tuple[int, ...] = ()
    capture_complete: bool = True
    dial_gates: bool = False
    packet: int = 64


_BASIC: Final = (0x1001, 0x1002, 0x1003, 0x1004, 0x1005, 0x1006, 0x1007, 0x1008, 0x1009, 0x100A, 0x100B, 0x100E)
_EVENTS: Final = (0x4001, 0x4002, 0x4003, 0x4004, 0x4005, 0x4006, 0x4008, 0x400A, 0x400C)
_FORMATS: Final = (0x3801, 0x380D, 0x3001, 0x3006, 0x3008, 0x300D)
_COOLPIX_QUALITIES: Final[dict[int, tuple[str, ...]]] = {6: ("jpeg:70",), 12: ("jpeg:85",), 25: ("jpeg:95",)}

COOLPIX_5400: Final = CameraProfile(
    name="coolpix5400",
    model="E5400",
    version="E5400v1.4",
    product_id=0x0119,
    operations=(*_BASIC, 0x1014, 0x1015, 0x1016, 0x101B),
    events=_EVENTS,
    image_formats=_FORMATS,
    properties=(
        Property(BATTERY, UINT8, 100, (2, 5, 25, 50, 65, 80, 100), writable=False),
        Property(
            IMAGE_SIZE,
            STRING,
            "640x480",
            ("640x480", "1024x768", "1280x960", "1600x1200", "2592x1944", "2592x1728"),
        ),
        Property(COMPRESSION, UINT8, 25, (6, 12, 25)),
        Property(
            FOCAL_LENGTH,
            UINT32,
            2800,
            (2800, 3100, 3500, 3900, 4200, 4600, 5000, 5300, 5700, 6100, 6500, 7000, 7500, 8000, 8600, 9000, 9500,
             10_200, 10_800, 11_600),
        ),
        Property(0x500A, UINT16, 2, (2, 3)),
        Property(0x500C, UINT16, 2, (1, 2, 3, 4)),
        Property(DATE_TIME, STRING, ""),
    ),
    dead_properties=(0xD001,),
    shutters=COOLPIX,
    qualities=_COOLPIX_QUALITIES,
    capture_complete=False,
)  # fmt: skip

COOLPIX_5700: Final = CameraProfile(
    name="coolpix5700",
    model="E5700",
    version="E5700v1.1",
    product_id=0x010D,
    operations=(*_BASIC, 0x1016, 0x101B),
    unlisted_operations=(0x1014, 0x1015),
    events=(*_EVENTS, 0x400D),
    image_formats=(*_FORMATS, 0x3811),
    properties=(
        Property(
            IMAGE_SIZE,
            STRING,
            "640x480",
            ("640x480", "1024x768", "1280x960", "1600x1200", "2560x1920", "2560x1704"),
        ),
        Property(COMPRESSION, UINT8, 25, (6, 12, 25, 100, 127)),
        Property(0x5005, UINT16, 2, (2, 4, 6, 5, 32_769, 3, 7)),
        Property(F_NUMBER, UINT16, 400, (280, 320, 350, 400, 450, 500, 560, 630, 710, 800)),
        Property(
            FOCAL_LENGTH,
            UINT32,
            3500,
            (3500, 3600, 3700, 3900, 4200, 4600, 5000, 5400, 5800, 6200, 6600, 7000, 7400, 7800, 8300, 8800, 9300,
             10_000, 10_700, 11_600, 12_500, 13_600, 14_800, 16_100, 17_600, 19_100, 20_600, 22_300, 24_200, 26_600,
             28_000),
        ),
        Property(0x500A, UINT16, 2, (2, 0, 3, 1)),
        Property(0x500B, UINT16, 1, (1, 4, 2, 3)),
        Property(0x500C, UINT16, 2, (1, 2, 3, 4, 32_769)),
        Property(EXPOSURE_TIME, UINT32, 40, tuple(shutter.code for shutter in COOLPIX)),
        Property(PROGRAM, UINT16, MANUAL, (1, 2, 3, 4)),
        Property(ISO, UINT16, 100, (AUTO_ISO, 100, 200, 400, 800)),
        Property(0x5013, UINT16, 1, (1,)),
    ),
    dead_properties=(0xD001,),
    shutters=COOLPIX,
    qualities=_COOLPIX_QUALITIES | {100: ("tiff",), 127: ("dng",)},
)  # fmt: skip

GENERIC: Final = CameraProfile(
    name="generic",
    model="Emulated DSLR",
    version="1.00",
    product_id=0x0400,
    operations=(*_BASIC, 0x1014, 0x1015, 0x1016, 0x101B),
    events=(*_EVENTS, 0x400D),
    image_formats=(*_FORMATS, 0x3811),
    properties=(
        Property(BATTERY, UINT8, 100, writable=False),
        Property(IMAGE_SIZE, STRING, "640x480", ("640x480", "1024x768", "1600x1200", "2592x1944")),
        Property(COMPRESSION, UINT8, 2, (0, 1, 2, 4, 5, 6, 7)),
        Property(F_NUMBER, UINT16, 400, (280, 320, 350, 400, 450, 500, 560, 630, 710, 800, 900, 1000, 1100, 1600)),
        Property(FOCAL_LENGTH, UINT32, 2800, writable=False),
        Property(EXPOSURE_TIME, UINT32, 40, tuple(shutter.code for shutter in THIRD_STOPS)),
        Property(PROGRAM, UINT16, MANUAL, (1, 2, 3, 4)),
        Property(ISO, UINT16, 100, (100, 200, 400, 800, 1600)),
        Property(0x5010, INT16, 0, (-2000, -1000, 0, 1000, 2000)),
        Property(DATE_TIME, STRING, ""),
        Property(
            NIKON_EXPOSURE_TIME,
            UINT32,
            1 << 16 | 250,
            tuple(s.nominal_s.numerator << 16 | s.nominal_s.denominator for s in THIRD_STOPS),
        ),
    ),
    shutters=THIRD_STOPS,
    qualities={
        0: ("jpeg:70",),
        1: ("jpeg:85",),
        2: ("jpeg:95",),
        4: ("dng",),
        5: ("jpeg:70", "dng"),
        6: ("jpeg:85", "dng"),
        7: ("jpeg:95", "dng"),
    },
    dial_gates=True,
    packet=512,
)

PROFILES: Final = {profile.name: profile for profile in (COOLPIX_5400, COOLPIX_5700, GENERIC)}
