"""Headers, readings and pictures for the tests of sessions, and disks that fail."""

import errno
from pathlib import Path

from labdaq.clock import NS, Clock, ClockState, utc_text
from labdaq.durable import Disk
from labdaq.instruments import Photo
from labdaq.reading import Instrument, Reading
from labdaq.records import Header, TakenReading
from labdaq.script import Script
from labdaq.station import Station
from labdaq.units import Quantity, Unit

START = 1_279_804_320 * NS
FLAGGED = ClockState(source="virtual", synchronised=False)
METER = Instrument(name="roof-luminance", model="LS-110", serial="79123001", port="/dev/ttyUSB0")


def header(name: str = "a-session") -> Header:
    return Header(
        name=name,
        test="T18",
        system="box",
        sky="clear",
        started=utc_text(START),
        started_utc_ns=START,
        clock=FLAGGED,
        boot_id="boot",
        station=Station.built_in().model_dump(mode="json"),
        script=Script(test="T18", system="box").model_dump(mode="json"),
        station_file={},
        script_file={},
        instruments=(METER,),
        certificates=(),
        software={"labdaq": "0"},
    )


def reading(clock: Clock, value: float | None, channel: str = "sky.zenith", step: str = "zenith-00") -> TakenReading:
    return TakenReading(
        step=step,
        reading=Reading(
            channel=channel,
            quantity=Quantity.LUMINANCE,
            value=value,
            unit=Unit.CANDELA_PER_M2,
            uncertainty=0.1,
            utc_ns=clock.utc_ns(),
            mono_ns=clock.mono_ns(),
            clock=clock.state(),
            instrument=METER,
            at={"gamma_deg": 180.0},
        ),
    )


def photo(clock: Clock, data: bytes, exposure_s: float = 0.25) -> Photo:
    return Photo(
        name="DSCN0001.JPG",
        data=data,
        exposure_s=exposure_s,
        nominal_exposure_s=exposure_s,
        utc_ns=clock.utc_ns(),
        mono_ns=clock.mono_ns(),
        clock=clock.state(),
        instrument=METER,
    )


class FailingDisk(Disk):
    """Refuses the n-th operation and, as a broken disk does, all later ones."""

    def __init__(self, fail_at: int) -> None:
        self.fail_at = fail_at
        self.done: list[str] = []

    def _op(self, what: str) -> None:
        self.done.append(what)
        if len(self.done) > self.fail_at:
            raise OSError(errno.EIO, "Input/output error")

    def write(self, fd: int, data: bytes) -> None:
        self._op("write")
        super().write(fd, data)

    def sync(self, fd: int) -> None:
        self._op("sync")
        super().sync(fd)

    def sync_folder(self, folder: Path) -> None:
        self._op("sync_folder")
        super().sync_folder(folder)

    def rename(self, old: Path, new: Path) -> None:
        self._op("rename")
        super().rename(old, new)
