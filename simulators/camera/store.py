"""The memory card: folders and picture files under handles."""

from dataclasses import dataclass, field
from typing import Final

from simulators.camera.darkroom import PictureFile

STORAGE: Final = 0x0001_0001

ASSOCIATION, EXIF_JPEG, TIFF, DNG = 0x3001, 0x3801, 0x380D, 0x3811

_FORMATS: Final = {"jpeg": (EXIF_JPEG, "JPG"), "tiff": (TIFF, "TIF"), "dng": (DNG, "DNG")}


@dataclass(frozen=True, slots=True)
class StoredObject:
    """A file or folder.

    Attributes
    ----------
    handle, parent
        Its handle and its folder's; 0 is the root.
    format
        PTP object format code.
    name
        File name.
    when
        Date and time as PTP writes them, ``YYYYMMDDThhmmss``.
    file
        The picture; ``None`` for a folder.
    """

    handle: int
    parent: int
    format: int
    name: str
    when: str
    file: PictureFile | None = None


@dataclass
class Card:
    """What is stored.

    Parameters
    ----------
    capacity
        Size of the card [bytes].
    """

    capacity: int
    objects: dict[int, StoredObject] = field(default_factory=dict)
    _next_handle: int = 0x65

    def __post_init__(self) -> None:
        self.objects[1] = StoredObject(1, 0, ASSOCIATION, "DCIM", "20100722T000000")
        self.objects[2] = StoredObject(2, 1, ASSOCIATION, "100NIKON", "20100722T000000")

    @property
    def used(self) -> int:
        """Bytes in files."""
        return sum(len(item.file.data) for item in self.objects.values() if item.file)

    @property
    def free(self) -> int:
        """Bytes left."""
        return max(0, self.capacity - self.used)

    def add(self, file: PictureFile, number: int, when: str) -> StoredObject:
        """Store a picture of shot ``number`` under the next handle."""
        code, suffix = _FORMATS[file.format]
        item = StoredObject(self._next_handle, 2, code, f"DSCN{number % 10_000:04d}.{suffix}", when, file)
        self._next_handle += 1
        self.objects[item.handle] = item
        return item

    def select(self, format_code: int, parent: int) -> list[int]:
        """Handles of one format (0: any) anywhere (parent 0), at the root (FFFFFFFFh) or in a folder."""
        wanted = 0 if parent == 0xFFFF_FFFF else parent
        return [
            item.handle
            for item in self.objects.values()
            if (not format_code or item.format == format_code) and (parent == 0 or item.parent == wanted)
        ]
