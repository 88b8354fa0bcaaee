"""What a camera can do, as it says itself: operations, and the settings it offers in its present mode."""

from dataclasses import dataclass, field

from drivers.camera.codes import MANUAL, EventCode, Operation, Property
from drivers.camera.datasets import DeviceInfo, PropertyDescription
from drivers.camera.exposure import Shutter, from_ratios, from_tenths_of_ms


@dataclass(frozen=True, slots=True)
class Abilities:
    """What was found out about a camera.

    Attributes
    ----------
    info
        Its DeviceInfo.
    settings
        Descriptions of those of its settings that it would describe, by code.
    """

    info: DeviceInfo
    settings: dict[int, PropertyDescription] = field(default_factory=dict)

    @property
    def captures(self) -> bool:
        """Whether it takes pictures when asked."""
        return Operation.INITIATE_CAPTURE in self.info.operations

    @property
    def deletes(self) -> bool:
        """Whether it deletes pictures when asked."""
        return Operation.DELETE_OBJECT in self.info.operations

    @property
    def announces_completion(self) -> bool:
        """Whether it says that it tells the end of a capture (not all that say so do)."""
        return EventCode.CAPTURE_COMPLETE in self.info.events

    @property
    def is_nikon(self) -> bool:
        """By its maker's name: the vendor extension often says something else."""
        return "nikon" in self.info.manufacturer.lower()

    @property
    def shutter_setting(self) -> PropertyDescription | None:
        """By which the shutter can be chosen now: Nikon's exact ratio, or else the standard's tenths of ms."""
        exact = self.settings.get(Property.NIKON_EXPOSURE_TIME) if self.is_nikon else None
        for setting in (exact, self.settings.get(Property.EXPOSURE_TIME)):
            if setting is not None and setting.writable and setting.choices:
                return setting
        return None

    @property
    def shutters(self) -> tuple[Shutter, ...]:
        """Exposure times that can be chosen now, longest first; empty when there is no choice."""
        setting = self.shutter_setting
        if setting is None:
            return ()
        numbers = [choice for choice in setting.choices if isinstance(choice, int)]
        return from_ratios(numbers) if setting.code == Property.NIKON_EXPOSURE_TIME else from_tenths_of_ms(numbers)

    @property
    def can_be_manual(self) -> bool:
        """Whether exposure program M can be chosen by us."""
        program = self.settings.get(Property.EXPOSURE_PROGRAM)
        return program is not None and program.writable and MANUAL in program.choices

    @property
    def f_number(self) -> float | None:
        """Present f-number; ``None`` when it does not say."""
        value = self._number(Property.F_NUMBER)
        return None if value is None else value / 100.0

    @property
    def iso(self) -> int | None:
        """Present exposure index; ``None`` when it does not say, or chooses itself."""
        value = self._number(Property.EXPOSURE_INDEX)
        return None if value == 0xFFFF else value

    @property
    def battery_percent(self) -> int | None:
        """State of the battery [%]."""
        return self._number(Property.BATTERY_LEVEL)

    def _number(self, code: int) -> int | None:
        setting = self.settings.get(code)
        return setting.current if setting is not None and isinstance(setting.current, int) else None

    def why_no_shutter(self) -> tuple[str, str]:
        """Return why the shutter cannot be chosen, and what to try."""
        model = f"{self.info.manufacturer} {self.info.model}".strip()
        present = self.settings.get(Property.EXPOSURE_TIME) or self.settings.get(Property.NIKON_EXPOSURE_TIME)
        if present is not None:
            return (
                f"the shutter of this {model} cannot be set in its present mode (ExposureTime is read-only)",
                "turn the mode dial to M, then connect again",
            )
        return (
            f"this {model} has no shutter control over PTP (no property 500D ExposureTime)",
            "use another camera for brackets; this one can only take pictures at its own exposure, one by one",
        )
