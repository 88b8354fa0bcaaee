"""Which camera is emulated, how it is set up, and what is wrong with it."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Literal

from simulators.camera.darkroom import Optics
from simulators.camera.profiles import PROFILES

EventOrder = Literal["added-first", "complete-first", "complete-between"]


@dataclass(frozen=True, slots=True)
class CameraOptions:
    """The camera as the operator left it.

    Attributes
    ----------
    profile
        ``coolpix5400`` (cannot be told an exposure), ``coolpix5700`` (16 shutter times) or ``generic``.
    picture
        ``jpeg``, ``raw``, or ``raw+jpeg`` (``generic`` only): the quality chosen at the camera.
    size
        Image size chosen at the camera, one the profile knows.
    program
        Where the mode dial stands: 1 manual, 2 programmed, 3 aperture, 4 shutter priority.
    exact_names
        Whether shutter times are what they are called; if not they lie on the exact ladder (1/60 s is 1/64 s).
    event_order
        When CaptureComplete comes relative to the ObjectAdded of each file.
    optics
        Lens, shading disc, sensor; the hooks for concealed physics.
    clock_offset_s
        Its own clock minus UTC [s].
    card_bytes
        Size of the memory card.
    """

    profile: str = "coolpix5700"
    picture: Literal["jpeg", "raw", "raw+jpeg"] = "raw"
    size: str = "640x480"
    program: int = 1
    exact_names: bool = True
    event_order: EventOrder = "added-first"
    optics: Optics = field(default_factory=Optics)
    clock_offset_s: float = 0.0
    card_bytes: int = 512 * 2**20

    def __post_init__(self) -> None:
        if self.profile not in PROFILES:
            raise ValueError(f"there is no camera profile '{self.profile}'; known are {', '.join(PROFILES)}")
        sizes = next(p.choices for p in PROFILES[self.profile].properties if p.code == 0x5003)
        if self.size not in sizes:
            raise ValueError(f"the {self.profile} has no image size {self.size}; it has {', '.join(map(str, sizes))}")
        if self.quality is None:
            raise ValueError(f"the {self.profile} cannot store {self.picture}")

    @property
    def quality(self) -> int | None:
        """Best value of CompressionSetting that makes these files; ``None`` when there is none."""
        wanted = {"jpeg": ["jpeg"], "raw": ["dng"], "raw+jpeg": ["jpeg", "dng"]}[self.picture]
        qualities = PROFILES[self.profile].qualities
        fitting = [code for code, files in qualities.items() if [f.partition(":")[0] for f in files] == wanted]
        return fitting[-1] if fitting else None


@dataclass
class CameraFaults:
    """Ways for a camera to misbehave, changed by tests while it runs.

    Attributes
    ----------
    refuse
        Operation code to the response codes its next calls get instead of being done.
    hang
        Operation code to the number of next calls that get no response at all.
    lose_events
        How many of the next ObjectAdded events are not sent.
    break_transfer_after
        The next object transfer breaks off after that many bytes, with the connection (PTP/IP) or a stall (USB).
    """

    refuse: dict[int, list[int]] = field(default_factory=dict)
    hang: Counter[int] = field(default_factory=Counter)
    lose_events: int = 0
    break_transfer_after: int | None = None
