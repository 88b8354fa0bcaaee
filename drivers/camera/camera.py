"""The camera: discovers what it can do, sets it, takes pictures, and hands over every one that came of it."""

import contextlib
from collections.abc import Sequence
from typing import Final

from drivers.camera.abilities import Abilities
from drivers.camera.capture import Capture, Release, Waits, listen
from drivers.camera.codes import FLASH_OFF, MANUAL, Format, Operation, Property
from drivers.camera.datasets import ObjectInfo, StorageInfo, Value
from drivers.camera.exposure import Shutter, nearest
from drivers.camera.link import Link
from drivers.camera.options import CameraOptions
from drivers.camera.photo import Photo
from drivers.camera.session import Session
from labdaq.clock import NS, Clock
from labdaq.errors import ConnectError, DeviceError, DeviceTimeout, Exchange, ProtocolError, RefusedError
from labdaq.reading import Instrument

_SETTINGS: Final = tuple(Property)


class Camera:
    """A camera that speaks the standard operations of PTP, over USB or TCP.

    Bodies that need their makers' own operations (Canon EOS, Nikon D and Z with card-less capture, Sony, Fuji) are
    not meant.

    Parameters
    ----------
    name
        Its name in the station file.
    link
        `drivers.camera.UsbPtp` or `drivers.camera.PtpIp`.
    clock
        What stamps pictures and limits waiting.
    options
        See `CameraOptions`.
    """

    def __init__(self, name: str, link: Link, clock: Clock, options: CameraOptions | None = None) -> None:
        self.options: Final = options or CameraOptions()
        self._name = name
        self._clock = clock
        self._session = Session(link, clock, self.options.timeout_s, self.options.busy_s)
        self._abilities: Abilities | None = None
        self._owed: Release | None = None

    @property
    def abilities(self) -> Abilities:
        """What the camera can do; raises `ConnectError` before `connect`."""
        if self._abilities is None:
            raise ConnectError("the camera is not connected", place=self._session.place, hint="connect first")
        return self._abilities

    @property
    def exposures_s(self) -> tuple[float, ...]:
        """Exposure times that can be chosen [s], longest first; empty when the camera leaves no choice."""
        return tuple(step.exposure_s for step in self.abilities.shutters)

    def identity(self) -> Instrument:
        """Who it is: model, version and serial number as it says."""
        info = None if self._abilities is None else self._abilities.info
        return Instrument(
            name=self._name,
            model=f"{info.manufacturer} {info.model}".strip() if info else "",
            serial=(info.serial if info else "") or self.options.serial,
            firmware=info.device_version if info else "",
            port=self._session.place.port,
            calibration=self.options.calibration,
        )

    async def connect(self) -> None:
        """Connect, find out what the camera can do, and set what the options ask for; every setting is read back.

        Raises `ConnectError` when it is not there or does not answer, `RefusedError` when it takes no pictures or
        refuses a setting, `ProtocolError`.
        """
        try:
            await self._session.open()
        except DeviceTimeout as error:
            raise ConnectError(
                "the camera does not answer", place=error.place, exchange=error.exchange, hint=error.hint
            ) from error
        self._abilities = await self._discover()
        if not self._abilities.captures:
            raise self._refusal(
                f"this {self.identity().model} takes no pictures over PTP (no InitiateCapture)",
                "set its USB mode to PTP; bodies with makers' own operations are not supported",
            )
        if self.options.manual:
            await self._make_manual()
        for code, value in self._wishes():
            await self._set(code, value)

    async def aclose(self) -> None:
        """Close the session and disconnect."""
        self._abilities = None
        with contextlib.suppress(DeviceError):  # a camera that is gone needs no goodbye
            await self._session.aclose()

    async def storages(self) -> dict[int, StorageInfo]:
        """Ask for the cards: room and pictures left."""
        return await self._session.storages()

    async def battery_percent(self) -> int | None:
        """Ask for the battery's state [%]; ``None`` when the camera does not tell."""
        if Property.BATTERY_LEVEL not in self.abilities.settings:
            return None
        await self._learn(Property.BATTERY_LEVEL)
        return self.abilities.battery_percent

    async def bracket(self, exposures_s: Sequence[float] | None = None) -> list[Photo]:
        """Take one picture at each exposure time [s] (by default at all there are, longest first); return all files.

        Raises as `expose`; before the first picture when one of the times does not exist.
        """
        steps = self._steps(exposures_s)
        return [photo for step in steps for photo in await self.expose(step.exposure_s)]

    async def expose(self, exposure_s: float | None = None) -> list[Photo]:
        """Take one picture and return every file that came of it.

        With ``exposure_s`` the shutter is set to that step of the dial [s] and read back; ``None`` leaves it as it
        is. Files are collected until the camera says that the capture is complete and a grace time has passed, in any
        order; from cameras that never say so, until none came for a while. What was never announced is found by
        comparing the lists of objects before and after.

        Raises `labdaq.errors.ConfigError` for a time that the camera does not have; `RefusedError` when it has no
        shutter control, its card is full, or it refuses; `DeviceTimeout` when no picture comes; `ProtocolError` for a
        picture that is cut short; `ConnectError` when it is gone.
        """
        step = self._steps([exposure_s])[0] if exposure_s is not None else None
        await self._let_the_last_one_finish()
        if step is not None:
            await self._set_shutter(step)
        before = frozenset(await self._session.handles())
        capture = await self._take(step, before)
        unannounced = [handle for handle in await self._session.handles() if handle not in before]
        handles = dict.fromkeys((*capture.handles, *unannounced))
        photos = []
        for handle in handles:
            photo = await self._download(handle, capture, step)
            if photo is not None:
                photos.append(photo)
        if not photos:
            raise self._no_picture(capture)
        return photos

    # Settings

    async def _discover(self) -> Abilities:
        abilities = Abilities(await self._session.device_info())
        for code in _SETTINGS:
            if code in abilities.info.properties:
                with contextlib.suppress(
                    RefusedError, ProtocolError
                ):  # listed, but not described: as if it were not there
                    abilities.settings[code] = await self._session.describe(code)
        return abilities

    async def _learn(self, code: int) -> None:
        """Ask again for one setting; what it offers may depend on others."""
        if code in self.abilities.settings:
            self.abilities.settings[code] = await self._session.describe(code)

    async def _make_manual(self) -> None:
        if self.abilities.can_be_manual:
            await self._set(Property.EXPOSURE_PROGRAM, MANUAL)
            for code in (
                Property.EXPOSURE_TIME,
                Property.NIKON_EXPOSURE_TIME,
                Property.F_NUMBER,
                Property.EXPOSURE_INDEX,
            ):
                await self._learn(code)
        flash = self.abilities.settings.get(Property.FLASH_MODE)
        if flash is not None and flash.writable and FLASH_OFF in flash.choices:
            await self._set(Property.FLASH_MODE, FLASH_OFF)

    def _wishes(self) -> list[tuple[Property, int]]:
        wishes = []
        if self.options.f_number is not None:
            wishes.append((Property.F_NUMBER, round(100 * self.options.f_number)))
        if self.options.iso is not None:
            wishes.append((Property.EXPOSURE_INDEX, self.options.iso))
        return wishes

    async def _set(self, code: Property, value: Value) -> None:
        setting = self.abilities.settings.get(code)
        if setting is None or not setting.writable:
            state = "has no such setting" if setting is None else "lets it be read only"
            raise self._refusal(
                f"{code.name} cannot be set to {value}: this {self.identity().model} {state}",
                "turn the mode dial to M, or leave the setting out of the station file",
            )
        if setting.choices and value not in setting.choices:
            offered = ", ".join(str(choice) for choice in setting.choices)
            raise self._refusal(f"{code.name} cannot be set to {value}", f"it offers {offered}")
        if setting.current != value:
            self.abilities.settings[code] = await self._session.put(setting, value)

    def _steps(self, exposures_s: Sequence[float] | None) -> list[Shutter]:
        shutters = self.abilities.shutters
        if not shutters:
            what, hint = self.abilities.why_no_shutter()
            raise self._refusal(what, hint)
        return list(shutters) if exposures_s is None else [nearest(shutters, wish) for wish in exposures_s]

    async def _set_shutter(self, step: Shutter) -> None:
        setting = self.abilities.shutter_setting
        assert setting is not None, "there are steps, so there is a setting"
        if setting.current != step.raw:
            self.abilities.settings[setting.code] = await self._session.put(setting, step.raw)

    # Captures and their files

    async def _take(self, step: Shutter | None, before: frozenset[int]) -> Capture:
        """Release and listen; while it is not known what comes of it, the release stays owed."""
        o = self.options
        waits = Waits(0.0 if step is None else step.exposure_s, o.capture_s, o.grace_s, o.quiet_s)
        began_ns = self._clock.mono_ns()
        self._owed = Release(began_ns, 0, waits)
        try:
            await self._session.call(Operation.INITIATE_CAPTURE, 0, 0)
        except RefusedError:
            self._owed = None
            raise
        release = Release(began_ns, self._session.transaction, waits)
        capture = await listen(self._session, self._clock, release, before)
        self._owed = None
        return capture

    async def _let_the_last_one_finish(self) -> None:
        """Wait for pictures of a release that ended in an error, so that they are not taken for those of the next."""
        if self._owed is not None:
            await listen(self._session, self._clock, self._owed, frozenset())
            self._owed = None

    async def _download(self, handle: int, capture: Capture, step: Shutter | None) -> Photo | None:
        """Fetch one object; ``None`` for a folder."""
        info = await self._session.object_info(handle)
        if info.format == Format.FOLDER:
            return None
        reply = await self._session.call(Operation.GET_OBJECT, handle, timeout_s=self.options.transfer_s)
        self._check_size(handle, info, reply.data)
        if self.options.delete_after and self.abilities.deletes:
            await self._session.call(Operation.DELETE_OBJECT, handle, 0)
        to_utc_ns = self._clock.utc_ns() - self._clock.mono_ns()
        return Photo(
            name=info.name or f"{handle:08X}",
            data=reply.data,
            format=info.format,
            exposure_s=None if step is None else step.exposure_s,
            f_number=self.abilities.f_number,
            iso=self.abilities.iso,
            began_utc_ns=capture.began_ns + to_utc_ns,
            ended_utc_ns=capture.ended_ns + to_utc_ns,
            began_mono_ns=capture.began_ns,
            ended_mono_ns=capture.ended_ns,
            clock=self._clock.state(),
            instrument=self.identity(),
            captured=info.capture_date,
        )

    def _check_size(self, handle: int, info: ObjectInfo, data: bytes) -> None:
        if info.size not in {len(data), 0xFFFF_FFFF}:
            raise ProtocolError(
                f"picture {info.name} has {info.size} bytes, {len(data)} came",
                place=self._session.place,
                exchange=Exchange(received=data[:64]),
                hint=f"it is still in the camera (object 0x{handle:X}); copy it from the card",
            )

    def _no_picture(self, capture: Capture) -> DeviceError:
        if capture.full:
            return self._refusal("the card is full", "delete pictures, or set delete_after in the station file")
        waited_s = (self._clock.mono_ns() - capture.began_ns) / NS
        return DeviceTimeout(
            f"the camera was released but no picture came within {waited_s:.1f} s",
            place=self._session.place,
            hint="look at its display: focus not found, card full or missing, lens closed?",
        )

    def _refusal(self, what: str, hint: str) -> RefusedError:
        return RefusedError(what, place=self._session.place, hint=hint)
