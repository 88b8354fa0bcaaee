"""Read a session: header, readings, pictures, events. Sessions are written by `labdaq.recorder.Recorder`.

A session can be read while it is being written, and after a kill at any byte: what was acknowledged is there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self, TypeVar, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from labdaq import journal
from labdaq.errors import DataError
from labdaq.reading import Reading
from labdaq.records import FORMAT, Header, StoredPhoto, TakenReading

if TYPE_CHECKING:
    import pandas as pd

    from labdaq.script import Script
    from labdaq.station import Station

B = TypeVar("B")

HEADER: Final = "session.json"
RAW: Final = "raw"


@dataclass(frozen=True, slots=True)
class Event:
    """One entry of the journal, in order: number, UTC and monotonic time [ns], kind, and its body as plain values."""

    seq: int
    utc_ns: int
    mono_ns: int
    kind: str
    body: dict[str, Any]


class Readings(Sequence[Reading]):
    """Readings in the order they were acknowledged, also as arrays of one element per reading."""

    def __init__(self, taken: Sequence[TakenReading]) -> None:
        self._taken = tuple(taken)

    def __len__(self) -> int:
        return len(self._taken)

    @overload
    def __getitem__(self, index: int) -> Reading: ...
    @overload
    def __getitem__(self, index: slice) -> "Readings": ...
    def __getitem__(self, index: int | slice) -> "Reading | Readings":
        if isinstance(index, slice):
            return Readings(self._taken[index])
        return self._taken[index].reading

    def __iter__(self) -> Iterator[Reading]:
        return (t.reading for t in self._taken)

    @property
    def step(self) -> tuple[str, ...]:
        """The step that asked for each reading, e.g. ``plane-03``."""
        return tuple(t.step for t in self._taken)

    @property
    def value(self) -> NDArray[np.float64]:
        """Values in each reading's unit; NaN where a reading must not be used."""
        return _floats(r.value if r.usable else None for r in self)

    @property
    def uncertainty(self) -> NDArray[np.float64]:
        """Standard uncertainties in each reading's unit; NaN where unknown."""
        return _floats(r.uncertainty for r in self)

    @property
    def utc_ns(self) -> NDArray[np.int64]:
        """Middle of each integration, UTC [ns]."""
        return np.array([r.utc_ns for r in self], dtype=np.int64)

    @property
    def mono_ns(self) -> NDArray[np.int64]:
        """Middle of each integration, monotonic [ns]."""
        return np.array([r.mono_ns for r in self], dtype=np.int64)

    def at(self, key: str) -> NDArray[np.float64]:
        """Where the sensor was, e.g. ``at("gamma_deg")``; NaN for readings that do not say."""
        return _floats(r.at.get(key) for r in self)

    def frame(self) -> "pd.DataFrame":
        """All of it as a table: one row a reading, ``at`` spread over columns such as ``gamma_deg``."""
        import pandas as pd

        rows = [
            {
                "utc": pd.Timestamp(r.utc_ns, unit="ns", tz="UTC"),
                "mono_ns": r.mono_ns,
                "duration_s": r.duration_s,
                "channel": r.channel,
                "quantity": str(r.quantity),
                "value": np.nan if r.value is None else r.value,
                "uncertainty": np.nan if r.uncertainty is None else r.uncertainty,
                "unit": str(r.unit),
                "usable": r.usable,
                "flags": " ".join(r.flags),
                "instrument": r.instrument.name,
                "step": t.step,
                **r.at,
            }
            for t, r in zip(self._taken, self, strict=True)
        ]
        return pd.DataFrame(rows)


class Session:
    """One test on disk."""

    def __init__(self, path: Path, header: Header, root: str) -> None:
        self.path = path
        self.header = header
        self.root = root

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Open a session's folder for reading; raises `DataError` when it is none, or from a newer labdaq."""
        path = Path(path)
        try:
            content = (path / HEADER).read_bytes()
        except OSError as error:
            why = "there is no such folder" if not path.is_dir() else f"it has no readable {HEADER}"
            raise DataError(f"{path}: not a session: {why}", "`labdaq session ls` lists sessions") from error
        try:
            header = msgspec.json.decode(content, type=Header)
        except msgspec.MsgspecError as error:
            raise DataError(f"{path / HEADER}: not a session's header: {error}") from error
        if header.format != FORMAT:
            raise DataError(f"{path / HEADER}: has format {header.format!r}; this labdaq reads {FORMAT!r}")
        return cls(path, header, journal.link(content))

    @property
    def sealed(self) -> bool:
        """Whether the session was ended in order (`labdaq session verify` tells whether it is still intact)."""
        return (self.path / "manifest.json").exists()

    @property
    def station(self) -> "Station":
        """The station as it was."""
        from labdaq.config import check
        from labdaq.station import Station

        return check(self.header.station, Station, f"{self.path / HEADER}: station")

    @property
    def script(self) -> "Script":
        """The script as it was."""
        from labdaq.config import check
        from labdaq.script import Script

        return check(self.header.script, Script, f"{self.path / HEADER}: script")

    def readings(self, channel: str | None = None) -> Readings:
        """All readings, or those of one channel, e.g. ``sky.zenith``."""
        taken = self._taken
        return Readings([t for t in taken if channel is None or t.reading.channel == channel])

    @property
    def channels(self) -> list[str]:
        """The channels that were read, in the order they first appear."""
        return list(dict.fromkeys(t.reading.channel for t in self._taken))

    def photos(self) -> list[StoredPhoto]:
        """The pictures, in the order they were stored; each is at ``session.path / photo.file``."""
        return self._bodies("photo", StoredPhoto)

    def events(self, kind: str | None = None) -> list[Event]:
        """The journal's entries, all or of one kind (``step.done``, ``clock``, ``fault`` ...)."""
        return [
            Event(e.seq, e.t_utc_ns, e.t_mono_ns, e.kind, msgspec.json.decode(e.body))
            for e in self._entries
            if kind is None or e.kind == kind
        ]

    @property
    def outcome(self) -> str:
        """``finished``, ``failed``, ``interrupted``, ``crashed``; ``open`` while there is no last entry."""
        ends = self.events("session.end")
        return str(ends[-1].body["outcome"]) if ends else "open"

    def scan(self) -> journal.Scan:
        """The journal as far as it is good, read anew; damage is told, not raised."""
        try:
            return journal.scan((self.path / journal.FILE).read_bytes(), self.root)
        except OSError as error:
            raise DataError(f"{self.path}: the journal cannot be read: {error.strerror}") from error

    @cached_property
    def _entries(self) -> tuple[journal.Entry, ...]:
        try:
            return journal.read(self.path / journal.FILE, self.root).entries
        except OSError as error:
            raise DataError(f"{self.path}: the journal cannot be read: {error.strerror}") from error

    @cached_property
    def _taken(self) -> list[TakenReading]:
        return self._bodies("reading", TakenReading)

    def _bodies(self, kind: str, body: type[B]) -> list[B]:
        decoder = msgspec.json.Decoder(body)
        try:
            return [decoder.decode(e.body) for e in self._entries if e.kind == kind]
        except msgspec.MsgspecError as error:
            raise DataError(f"{self.path / journal.FILE}: a {kind} entry cannot be understood: {error}") from error


def session_paths(folder: Path) -> list[Path]:
    """Folders of the sessions in a folder, oldest first; what is none is passed over."""
    paths = sorted(folder.iterdir()) if folder.is_dir() else []
    return [p for p in paths if not p.name.startswith(".") and (p / HEADER).is_file()]


def list_sessions(folder: Path) -> list[Session]:
    """The sessions in a folder, oldest first; raises `DataError` for one that cannot be read."""
    return [Session.open(path) for path in session_paths(folder)]


def _floats(values: "Iterator[float | None]") -> NDArray[np.float64]:
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)
