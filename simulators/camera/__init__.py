"""An emulated camera with a fisheye lens, on USB (a pyusb backend) and on the network (PTP/IP)."""

from simulators.camera.body import Camera, CameraEvent
from simulators.camera.darkroom import ColourResponse, Optics, luminance_picture
from simulators.camera.lens import NOMINAL_VIGNETTING, FisheyeLens, View, view
from simulators.camera.options import CameraFaults, CameraOptions, EventOrder
from simulators.camera.profiles import PROFILES
from simulators.camera.ptpip import PtpIpFront
from simulators.camera.sensor import Sensor, saturation_luminance
from simulators.camera.shading import ShadingDisc

__all__ = [
    "NOMINAL_VIGNETTING",
    "PROFILES",
    "Camera",
    "CameraEvent",
    "CameraFaults",
    "CameraOptions",
    "ColourResponse",
    "EventOrder",
    "FisheyeLens",
    "Optics",
    "PtpIpFront",
    "Sensor",
    "ShadingDisc",
    "View",
    "luminance_picture",
    "saturation_luminance",
    "view",
]
