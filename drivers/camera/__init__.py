"""Cameras that speak the Picture Transfer Protocol, over USB (pyusb) or TCP (PTP/IP)."""

from drivers.camera.camera import Camera
from drivers.camera.ip import PtpIp
from drivers.camera.options import CameraOptions
from drivers.camera.photo import Photo
from drivers.camera.usb import UsbPtp
from drivers.camera.usb_device import UsbOptions

__all__ = ["Camera", "CameraOptions", "Photo", "PtpIp", "UsbOptions", "UsbPtp"]
