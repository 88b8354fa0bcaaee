"""A bracket of exposures of one scene: opened, checked as a whole, and handed out in groups."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.hdr.exif import Exif, read_exif
from analysis.hdr.frames import Frame, Sensor, read_frame
from labdaq.errors import DataError

Floats = NDArray[np.float64]
Codes = NDArray[Any]

_SAMPLES: Final = 40_000


@dataclass(frozen=True, slots=True)
class Crop:
    """A part of a picture: first row and column, height and width [pixel]."""

    top: int
    left: int
    height: int
    width: int

    def of(self, codes: Codes) -> Codes:
        """That part of a picture; raises `DataError` where it reaches beyond."""
        high, wide = codes.shape[:2]
        if min(self.top, self.left) < 0 or self.top + self.height > high or self.left + self.width > wide:
            raise DataError(
                f"a part of {self.height} x {self.width} pixels from row {self.top}, column {self.left} "
                f"does not lie in a picture of {high} x {wide}"
            )
        return codes[self.top : self.top + self.height, self.left : self.left + self.width]


@dataclass(frozen=True)
class Group:
    """Some of a bracket's exposures.

    Attributes
    ----------
    codes : shape (F, H, W) or (F, H, W, 3)
    at
        Where they are in the bracket's order.
    first, last
        Whether they begin, or end, the bracket.
    """

    codes: Codes
    at: slice
    first: bool
    last: bool


@dataclass(frozen=True)
class Bracket:
    """Exposures in order of exposure time, longest first.

    Attributes
    ----------
    paths, told_s
        Files and their exposure times [s].
    order
        Place of each in the list the caller gave.
    height, width
        Of the (cropped) pictures [pixel].
    sensor
        For raw files; else the pictures are colour.
    samples : shape (F, P) or (F, P, 3)
        Codes of the same places in all exposures.
    sample_places : shape (2, P)
        Rows and columns of those places in the cropped picture.
    exif
        What the file of the longest exposure tells.
    stack
        All codes, when they fit into memory.
    """

    paths: tuple[Path, ...]
    told_s: Floats
    order: NDArray[np.int64]
    height: int
    width: int
    sensor: Sensor | None
    samples: Codes
    sample_places: NDArray[np.int64]
    exif: Exif
    crop: Crop | None
    stack: Codes | None
    group_size: int

    @property
    def one_group(self) -> bool:
        """Whether all exposures come in one group."""
        return self.group_size >= len(self.paths)

    def parts(self) -> Iterator[Group]:
        """All exposures in groups that fit into memory; decoded once more unless they are all kept."""
        count = len(self.paths)
        for start in range(0, count, self.group_size):
            stop = min(start + self.group_size, count)
            if self.stack is not None:
                codes = self.stack
            else:
                codes = np.stack([_codes(read_frame(path), self.crop) for path in self.paths[start:stop]])
            yield Group(codes, slice(start, stop), start == 0, stop == count)


def open_bracket(
    paths: Sequence[Path],
    times_s: Sequence[float | None],
    crop: Crop | None = None,
    memory_mb: float = 1024.0,
    known_mistakes: Sequence[str] = (),
) -> Bracket:
    """Read and check all exposures.

    Parameters
    ----------
    times_s
        One for each path [s]; ``None`` takes it from the file.
    memory_mb
        How much the decoded exposures may take [MB]; beyond it they are decoded twice, in groups.
    known_mistakes
        Found by the caller, to be told together with these.

    Raises `DataError` with one line per mistake: counts that differ, unreadable files, times missing or not positive,
    pictures of different kind or size, apertures or sensitivities that differ.
    """
    mistakes = list(known_mistakes)
    if len(paths) != len(times_s):
        mistakes.append(f"there are {len(times_s)} exposure times for {len(paths)} files; they must be as many")
    if len(paths) < 2:
        mistakes.append(f"a merge needs at least two exposures, not {len(paths)}")
    exifs = [_exif(path) for path in paths]
    mistakes += _alike(paths, exifs)
    times = _told(paths, times_s, exifs, mistakes)
    order = np.argsort(-times, kind="stable")
    keeper = _Keeper(len(paths), crop, memory_mb)
    for i in order:
        try:
            keeper.add(paths[i], read_frame(paths[i]))
        except DataError as error:
            mistakes.append(error.message)
    if mistakes:
        raise DataError("the exposures cannot be merged:\n" + "\n".join(f"  {line}" for line in mistakes))
    return Bracket(
        paths=tuple(paths[i] for i in order),
        told_s=times[order],
        order=order,
        height=keeper.shape[0],
        width=keeper.shape[1],
        sensor=keeper.sensor,
        samples=np.stack(keeper.samples),
        sample_places=keeper.places,
        exif=exifs[order[0]],
        crop=crop,
        stack=keeper.stack,
        group_size=keeper.group_size,
    )


class _Keeper:
    """Takes exposures one by one: checks them against the first, samples them, keeps them where memory allows."""

    def __init__(self, count: int, crop: Crop | None, memory_mb: float) -> None:
        self.count, self.crop, self.allowed = count, crop, memory_mb * 1e6
        self.shape: tuple[int, ...] = ()
        self.whole: tuple[int, ...] = ()
        self.sensor: Sensor | None = None
        self.samples: list[Codes] = []
        self.places = np.zeros((2, 0), np.int64)
        self.stack: Codes | None = None
        self.group_size = 1
        self.name = ""
        self.dtype: np.dtype[Any] = np.dtype(np.uint8)

    def add(self, path: Path, frame: Frame) -> None:
        """Take the next exposure; raises `DataError` when it does not fit the ones before."""
        if not self.name:
            codes = _codes(frame, self.crop)
            self._begin(path, frame, codes)
        else:
            self._compare(path, frame)
            codes = _codes(frame, self.crop)
        if self.stack is not None:
            self.stack[len(self.samples)] = codes
        self.samples.append(codes[self.places[0], self.places[1]])

    def _begin(self, path: Path, frame: Frame, codes: Codes) -> None:
        self.name, self.whole, self.shape, self.dtype = path.name, frame.codes.shape, codes.shape, codes.dtype
        self.sensor = frame.sensor
        if self.count * codes.nbytes <= self.allowed:
            self.stack, self.group_size = np.empty((self.count, *codes.shape), codes.dtype), self.count
        else:
            # the sums carried from group to group take 20 bytes a sample
            left = self.allowed - 20.0 * codes.size
            self.group_size = max(1, int(left // codes.nbytes))
        step = max(1.0, np.sqrt(self.shape[0] * self.shape[1] / _SAMPLES))
        rows = np.arange(step / 2, self.shape[0], step).astype(np.int64)
        columns = np.arange(step / 2, self.shape[1], step).astype(np.int64)
        self.places = np.stack([a.ravel() for a in np.meshgrid(rows, columns, indexing="ij")])
        if frame.sensor is not None and frame.sensor.mosaic:
            # all four places of the mosaic's cell in turn, whatever the step is
            self.places[0] = np.minimum(
                self.places[0] // 2 * 2 + np.arange(self.places.shape[1]) % 2, self.shape[0] - 1
            )
            column = self.places[1] // 2 * 2 + np.arange(self.places.shape[1]) // 2 % 2
            self.places[1] = np.minimum(column, self.shape[1] - 1)

    def _compare(self, path: Path, frame: Frame) -> None:
        if (frame.sensor is None) != (self.sensor is None):
            raise DataError(f"{path}: raw files and pictures cannot be merged with each other ({self.name})")
        if frame.codes.shape != self.whole:
            size, first = frame.codes.shape, self.whole
            raise DataError(f"{path}: {size[0]} x {size[1]} pixels, but {self.name} has {first[0]} x {first[1]}")
        if frame.codes.dtype != self.dtype:
            raise DataError(f"{path}: {frame.codes.dtype}, but {self.name} is {self.dtype}")
        if frame.sensor and self.sensor:
            same = np.array_equal(frame.sensor.black, self.sensor.black) and frame.sensor.white == self.sensor.white
            if not same or not np.array_equal(frame.sensor.colours, self.sensor.colours):
                raise DataError(f"{path}: black level, white level or mosaic differ from those of {self.name}")


def _codes(frame: Frame, crop: Crop | None) -> Codes:
    """Codes of a frame as they are merged: cropped (whole cells of a mosaic), grey pictures as three equal channels."""
    if crop is not None and frame.sensor is not None:
        crop = Crop(crop.top // 2 * 2, crop.left // 2 * 2, crop.height // 2 * 2, crop.width // 2 * 2)
    codes = frame.codes if crop is None else crop.of(frame.codes)
    if frame.sensor is None and codes.ndim == 2:
        codes = np.repeat(codes[..., None], 3, axis=2)
    return codes


def _exif(path: Path) -> Exif:
    try:
        return read_exif(path)
    except DataError:
        return Exif()  # reading its pixels will say what is wrong, once


def _told(paths: Sequence[Path], times_s: Sequence[float | None], exifs: Sequence[Exif], mistakes: list[str]) -> Floats:
    """Exposure times [s], given or from the files; 0 where ``mistakes`` says there is none."""
    times = np.zeros(len(paths))
    for i, (path, exif) in enumerate(zip(paths, exifs, strict=True)):
        told = times_s[i] if i < len(times_s) else 1.0
        told = exif.exposure_s if told is None else told
        if told is None:
            mistakes.append(f"{path}: the file does not tell its exposure time; give all times in a file (--times)")
        elif not (np.isfinite(told) and told > 0.0):
            mistakes.append(f"{path}: its exposure time is {told:g} s; it must be above 0")
        else:
            times[i] = told
    return times


def _alike(paths: Sequence[Path], exifs: Sequence[Exif]) -> list[str]:
    """Mistakes: exposures whose aperture or sensitivity is not the first one's."""
    mistakes = []
    for name, values in (("aperture", [e.f_number for e in exifs]), ("sensitivity (ISO)", [e.iso for e in exifs])):
        first = next((v for v in values if v is not None), None)
        for path, value in zip(paths, values, strict=True):
            if value is not None and first is not None and abs(value / first - 1.0) > 0.01:
                mistakes.append(f"{path}: its {name} is {value:g}, another's is {first:g}; only the time may change")
    return mistakes
