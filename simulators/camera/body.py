"""The camera body: properties, shutter, card and events. It knows the world through its lens, and no bytes."""

import heapq
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from functools import partial
from itertools import count
from typing import Final

from labdaq.clock import NS, Clock
from simulators.camera import profiles
from simulators.camera.darkroom import PictureFile, Shot, develop, metered_seconds
from simulators.camera.files import ExposureData
from simulators.camera.options import CameraFaults, CameraOptions
from simulators.camera.profiles import PROFILES, Choice, Property
from simulators.camera.shutters import Shutter
from simulators.camera.store import Card
from simulators.world.observed import World

SHUTTER_LAG_S: Final = 0.25
"""From the command until the shutter opens [s]."""

WRITING_S: Final = 0.4
"""From the shutter's closing until the first file is on the card, and from file to file [s]."""

OBJECT_ADDED, CAPTURE_COMPLETE = 0x4002, 0x400D
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class CameraEvent:
    """Something the camera tells: a PTP event code, its parameter, and the transaction that caused it."""

    code: int
    parameter: int
    transaction: int


class Camera:
    """One camera, observed by whichever front ends it is connected to.

    Nothing happens by itself: `advance` does what has become due. A front end calls it when `next_due_ns` comes, or
    before it looks. Pictures are rendered there, so `advance` may take some tenths of a second; it may be called from
    a thread, and then the world is asked from that thread.
    """

    def __init__(self, world: World, clock: Clock, options: CameraOptions | None = None, seed: int = 0) -> None:
        self.options = options = options or CameraOptions()
        self.profile = PROFILES[options.profile]
        self.card = Card(options.card_bytes)
        self.faults = CameraFaults()
        self.events: deque[CameraEvent] = deque()
        self.changed: Callable[[], None] = lambda: None  # a front end that sleeps until `next_due_ns` listens here
        self._world = world
        self._clock = clock
        self._seed = seed
        self._properties = {item.code: item for item in self.profile.properties}
        self._values: dict[int, Choice] = {item.code: item.value for item in self.profile.properties}
        set_by_operator = {profiles.COMPRESSION: options.quality, profiles.IMAGE_SIZE: options.size}
        set_by_operator[profiles.PROGRAM] = options.program
        self._values |= {code: value for code, value in set_by_operator.items() if value and code in self._values}
        self._clock_offset_s = options.clock_offset_s
        self._shots = 0
        self._agenda: list[tuple[int, int, Callable[[], None]]] = []
        self._order = count()
        self._advancing = threading.Lock()

    # --- properties ---

    def setting(self, code: int) -> Property | None:
        """A property as it can be used now (the mode dial may make it read-only), or ``None``."""
        item = self._properties.get(code)
        if item is None:
            return None
        uses = {
            profiles.EXPOSURE_TIME: (profiles.MANUAL, profiles.SHUTTER_PRIORITY),
            profiles.NIKON_EXPOSURE_TIME: (profiles.MANUAL, profiles.SHUTTER_PRIORITY),
            profiles.F_NUMBER: (profiles.MANUAL, profiles.APERTURE_PRIORITY),
        }
        if self.profile.dial_gates and code in uses and self._values[profiles.PROGRAM] not in uses[code]:
            return Property(item.code, item.type, item.value, item.choices, writable=False)
        return item

    def value(self, code: int) -> Choice:
        """Present value of a property that exists."""
        return self.clock_text() if code == profiles.DATE_TIME else self._values[code]

    def set_value(self, code: int, value: Choice) -> None:
        """Set a property to a value it allows; raises `ValueError` for a date that is none."""
        if code == profiles.DATE_TIME:
            wanted = datetime.strptime(str(value)[:15], "%Y%m%dT%H%M%S").replace(tzinfo=UTC)
            self._clock_offset_s = (wanted - _moment(self._clock.utc_ns(), 0.0)).total_seconds()
            return
        self._values[code] = value
        if code == profiles.EXPOSURE_TIME and profiles.NIKON_EXPOSURE_TIME in self._values:
            nominal = self._shutter().nominal_s
            self._values[profiles.NIKON_EXPOSURE_TIME] = nominal.numerator << 16 | nominal.denominator
        elif code == profiles.NIKON_EXPOSURE_TIME:
            nominal = Fraction(int(value) >> 16, int(value) & 0xFFFF)
            self._values[profiles.EXPOSURE_TIME] = next(
                shutter.code for shutter in self.profile.shutters if shutter.nominal_s == nominal
            )

    def clock_text(self) -> str:
        """The camera's own date and time, ``YYYYMMDDThhmmss``."""
        return f"{_moment(self._clock.utc_ns(), self._clock_offset_s):%Y%m%dT%H%M%S}"

    def _shutter(self) -> Shutter:
        return next(s for s in self.profile.shutters if s.code == self._values[profiles.EXPOSURE_TIME])

    # --- taking pictures ---

    @property
    def busy(self) -> bool:
        """Whether an exposure is under way or being written."""
        return bool(self._agenda)

    @property
    def full(self) -> bool:
        """Whether the card has no room for another picture of the present size and quality."""
        width, height = self._size
        per_pixel = {"dng": 2.0, "tiff": 3.0, "jpeg": 1.0}
        needed = sum(per_pixel[kind.partition(":")[0]] * width * height for kind in self._formats)
        return self.card.free < needed

    @property
    def _size(self) -> tuple[int, int]:
        width, height = str(self._values[profiles.IMAGE_SIZE]).split("x")
        return int(width), int(height)

    @property
    def _formats(self) -> tuple[str, ...]:
        return self.profile.qualities[int(self._values[profiles.COMPRESSION])]

    def capture(self, transaction: int, *, tell_complete: bool) -> None:
        """Begin an exposure; files and events follow on the clock."""
        shot = self._compose()
        shut_ns = self._clock.mono_ns() + round((SHUTTER_LAG_S + shot.seconds) * NS)
        written_ns = [shut_ns + round((k + 1) * WRITING_S * NS) for k in range(len(shot.formats))]
        pictures: list[PictureFile] = []

        def add(k: int) -> None:
            if not pictures:
                pictures.extend(develop(self._world, self.options.optics, shot, self._seed))
            item = self.card.add(pictures[k], shot.number, shot.data.when.replace(":", "").replace(" ", "T"))
            if self.faults.lose_events > 0:
                self.faults.lose_events -= 1
            else:
                self.events.append(CameraEvent(OBJECT_ADDED, item.handle, transaction))

        steps: list[tuple[int, Callable[[], None]]] = [(due_ns, partial(add, k)) for k, due_ns in enumerate(written_ns)]
        if tell_complete:
            tell = partial(self.events.append, CameraEvent(CAPTURE_COMPLETE, transaction, transaction))
            at = {"added-first": len(steps), "complete-first": 0, "complete-between": 1}[self.options.event_order]
            steps.insert(at, (steps[max(0, at - 1)][0], tell))
        for due_ns, step in steps:
            heapq.heappush(self._agenda, (due_ns, next(self._order), step))
        self.changed()

    def _compose(self) -> Shot:
        """Decide exposure, time and files of the next shot."""
        self._shots += 1
        begins_ns = self._clock.utc_ns() + round(SHUTTER_LAG_S * NS)
        f_number = Fraction(int(self._values.get(profiles.F_NUMBER, 400)), 100)
        iso = int(self._values.get(profiles.ISO, 100))
        iso = 100 if iso == profiles.AUTO_ISO else iso
        chosen = self._values.get(profiles.PROGRAM) in (profiles.MANUAL, profiles.SHUTTER_PRIORITY)
        chosen = chosen and profiles.EXPOSURE_TIME in self._values
        if chosen:
            shutter = self._shutter()
        else:
            metered_s = metered_seconds(self._world, begins_ns, self.options.optics, float(f_number), iso)
            shutter = min(self.profile.shutters, key=lambda s: abs(s.ladder_s / metered_s - 1.0))
        seconds = float(shutter.nominal_s) if self.options.exact_names else shutter.ladder_s
        data = ExposureData(
            make="NIKON",
            model=self.profile.model,
            when=f"{_moment(begins_ns, self._clock_offset_s):%Y:%m:%d %H:%M:%S}",
            nominal_s=shutter.nominal_s,
            f_number=f_number,
            iso=iso,
            automatic=not chosen,
            focal_length_mm=Fraction(28, 5),
        )
        middle_ns = begins_ns + round(seconds / 2 * NS)
        return Shot(self._shots, middle_ns, seconds, *self._size, self._formats, data)

    @property
    def next_due_ns(self) -> int | None:
        """When `advance` has something to do, on the clock's monotonic time; ``None`` if nothing is planned."""
        return self._agenda[0][0] if self._agenda else None

    def advance(self) -> None:
        """Do what has become due: finish exposures, store files, tell events."""
        with self._advancing:
            while self._agenda and self._agenda[0][0] <= self._clock.mono_ns():
                self._agenda[0][2]()
                heapq.heappop(self._agenda)  # only now: the camera is busy until its work is done


def _moment(utc_ns: int, offset_s: float) -> datetime:
    return _EPOCH + timedelta(microseconds=utc_ns // 1000) + timedelta(seconds=offset_s)
