"""What a station file says about a camera."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """What the station file says about a camera.

    Attributes
    ----------
    serial, calibration
        Declared; a serial number that the camera tells itself is taken first.
    manual
        Choose exposure program M and switch the flash off on connecting, where the camera lets us.
    f_number, iso
        Set these on connecting; ``None`` leaves them.
    delete_after
        Delete each picture in the camera after it was handed over.
    timeout_s, transfer_s, busy_s
        Longest wait for a reply, for a picture's data, for a busy camera [s].
    capture_s
        Longest wait for the first picture after the exposure's own time [s].
    grace_s
        Wait for further pictures after the camera said that a capture is complete [s].
    quiet_s
        Wait for further pictures after the last one, when it says no such thing [s].
    """

    serial: str = ""
    calibration: str = ""
    manual: bool = True
    f_number: float | None = None
    iso: int | None = None
    delete_after: bool = False
    timeout_s: float = 10.0
    transfer_s: float = 120.0
    busy_s: float = 20.0
    capture_s: float = 30.0
    grace_s: float = 0.5
    quiet_s: float = 2.0
