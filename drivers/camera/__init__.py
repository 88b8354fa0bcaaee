"""Cameras that speak the Picture Transfer Protocol, over USB (pyusb) or TCP (PTP/IP)."""

from drivers.camera.camera import Camera, CameraOptions
from drivers.camera.ip import PtpIp
from drivers.camera.photo import Photo
from drivers.camera.usb import UsbOptions, UsbPtp

__all__ = ["Camera", "CameraOptions", "Photo", "PtpIp", "UsbOptions", "UsbPtp"]
