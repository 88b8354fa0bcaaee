"""Numbers of the Picture Transfer Protocol (ISO 15740, PIMA 15740) that this driver uses, with their names."""

from enum import IntEnum
from typing import Final


class Operation(IntEnum):
    """What can be asked of a camera."""

    GET_DEVICE_INFO = 0x1001
    OPEN_SESSION = 0x1002
    CLOSE_SESSION = 0x1003
    GET_STORAGE_IDS = 0x1004
    GET_STORAGE_INFO = 0x1005
    GET_OBJECT_HANDLES = 0x1007
    GET_OBJECT_INFO = 0x1008
    GET_OBJECT = 0x1009
    DELETE_OBJECT = 0x100B
    INITIATE_CAPTURE = 0x100E
    GET_DEVICE_PROP_DESC = 0x1014
    SET_DEVICE_PROP_VALUE = 0x1016


class Answer(IntEnum):
    """Response codes."""

    OK = 0x2001
    GENERAL_ERROR = 0x2002
    SESSION_NOT_OPEN = 0x2003
    INVALID_TRANSACTION = 0x2004
    OPERATION_NOT_SUPPORTED = 0x2005
    PARAMETER_NOT_SUPPORTED = 0x2006
    INCOMPLETE_TRANSFER = 0x2007
    INVALID_STORAGE = 0x2008
    INVALID_HANDLE = 0x2009
    PROPERTY_NOT_SUPPORTED = 0x200A
    STORE_FULL = 0x200C
    WRITE_PROTECTED = 0x200D
    ACCESS_DENIED = 0x200F
    NO_THUMBNAIL = 0x2010
    STORE_NOT_AVAILABLE = 0x2013
    DEVICE_BUSY = 0x2019
    INVALID_PROPERTY_FORMAT = 0x201B
    INVALID_PROPERTY_VALUE = 0x201C
    INVALID_PARAMETER = 0x201D
    SESSION_ALREADY_OPEN = 0x201E
    TRANSACTION_CANCELLED = 0x201F


class EventCode(IntEnum):
    """What a camera says by itself."""

    OBJECT_ADDED = 0x4002
    OBJECT_REMOVED = 0x4003
    STORE_ADDED = 0x4004
    STORE_REMOVED = 0x4005
    PROPERTY_CHANGED = 0x4006
    DEVICE_INFO_CHANGED = 0x4008
    STORE_FULL = 0x400A
    STORAGE_INFO_CHANGED = 0x400C
    CAPTURE_COMPLETE = 0x400D


class Property(IntEnum):
    """Settings of a camera; the last is Nikon's own."""

    BATTERY_LEVEL = 0x5001
    COMPRESSION = 0x5004
    F_NUMBER = 0x5007
    FLASH_MODE = 0x500C
    EXPOSURE_TIME = 0x500D
    EXPOSURE_PROGRAM = 0x500E
    EXPOSURE_INDEX = 0x500F
    DATE_TIME = 0x5011
    NIKON_EXPOSURE_TIME = 0xD100


class Format(IntEnum):
    """What an object is."""

    UNDEFINED = 0x3000  # Nikon's raw files come so, with their name's ending telling
    FOLDER = 0x3001
    EXIF_JPEG = 0x3801
    TIFF_EP = 0x3802
    JFIF = 0x3808
    TIFF = 0x380D
    DNG = 0x3811


MANUAL: Final = 1
"""Exposure program in which shutter and aperture are set by hand."""
FLASH_OFF: Final = 2
ALL_STORES: Final = 0xFFFF_FFFF

REASONS: Final[dict[int, tuple[str, str]]] = {
    Answer.GENERAL_ERROR: ("general error", "switch the camera off and on"),
    Answer.SESSION_NOT_OPEN: ("the session is not open", "connect again"),
    Answer.OPERATION_NOT_SUPPORTED: ("it cannot do that", "this camera model is not suited"),
    Answer.INVALID_HANDLE: ("there is no such object", "somebody may have deleted it in the camera"),
    Answer.PROPERTY_NOT_SUPPORTED: ("it has no such setting", "this camera model is not suited"),
    Answer.STORE_FULL: ("the card is full", "delete pictures, or set delete_after in the station file"),
    Answer.WRITE_PROTECTED: ("the card or the object is protected", "unlock the card"),
    Answer.ACCESS_DENIED: ("the setting is read-only now", "turn the mode dial to M"),
    Answer.STORE_NOT_AVAILABLE: ("there is no card", "put a card in and close its lid"),
    Answer.DEVICE_BUSY: ("it is busy", "wait until it has written its pictures"),
    Answer.INVALID_PROPERTY_VALUE: ("it does not take this value", "choose one of the values it offers"),
    Answer.SESSION_ALREADY_OPEN: ("a session is open already", "switch the camera off and on"),
}
"""Response code to what it means and what to try."""


def reason(code: int) -> tuple[str, str]:
    """Return what a response code means and what to try."""
    meaning, hint = REASONS.get(code, ("no further explanation", "switch the camera off and on"))
    name = next((answer.name for answer in Answer if answer == code), "vendor's own")
    return f"0x{code:04X} ({name.lower().replace('_', ' ')}): {meaning}", hint
