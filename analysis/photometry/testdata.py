"""What a daylight test must tell beside the candelas, as LM-63 keywords of our own.

The choice follows what is publicly said about LM-81 (photometric testing of skylights): sun position and sky
conditions of the very test, and how the light was measured. It makes an LM-63 file with LM-81-style test data; it does
not make a test compliant with LM-81.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final, Self

from labdaq.errors import DataError

HANDEDNESS: Final = "counter-clockwise seen from above (C 90 is west)"

_KEYS: Final[dict[str, tuple[str, str]]] = {
    "sun_altitude_deg": ("_SUNALT", "deg"),
    "sun_azimuth_deg": ("_SUNAZ", "deg from north through east"),
    "global_lx": ("_EGLOBAL", "lx"),
    "diffuse_lx": ("_EDIFFUSE", "lx"),
    "zenith_cd_m2": ("_ZENITHLUM", "cd/m2"),
    "sky": ("_SKY", ""),
    "distance_m": ("_DISTANCE", "m"),
    "start_utc": ("_TSTART", ""),
    "end_utc": ("_TEND", ""),
    "field": ("_FIELD", ""),
}


@dataclass(frozen=True, kw_only=True)
class TestData:
    """The conditions of a test; ``None`` and empty text are not written.

    Attributes
    ----------
    sun_altitude_deg, sun_azimuth_deg
        Sun at the middle of the test [deg]; azimuth from north through east.
    global_lx, diffuse_lx
        Horizontal illuminance on the roof [lx].
    zenith_cd_m2
        Zenith luminance [cd/m²].
    sky
        Words: ``clear``, ``partly cloudy``.
    distance_m
        From the aperture's centre to the sensors [m]; ``None`` for far-field photometry.
    start_utc, end_utc
        ISO 8601 in UTC, e.g. of `labdaq.clock.utc_text`.
    field
        ``near`` for intensities that only hold at ``distance_m``, ``far`` otherwise.
    """

    __test__ = False  # not a test for pytest

    sun_altitude_deg: float | None = None
    sun_azimuth_deg: float | None = None
    global_lx: float | None = None
    diffuse_lx: float | None = None
    zenith_cd_m2: float | None = None
    sky: str = ""
    distance_m: float | None = None
    start_utc: str = ""
    end_utc: str = ""
    field: str = ""

    def keywords(self) -> dict[str, str]:
        """LM-63 keywords, with the orientation of the C-planes; ``[NEARFIELD]`` is among them for near-field data."""
        words = {}
        for item in fields(self):
            value = getattr(self, item.name)
            key, unit = _KEYS[item.name]
            if isinstance(value, float | int):
                words[key] = f"{value:.7g} {unit}"
            elif value:
                words[key] = value
        if self.field == "near" and self.distance_m is not None:
            # The standard wants three distances; measured at one distance, the data hold at that distance only.
            words["NEARFIELD"] = " ".join([f"{self.distance_m:.4g}"] * 3)
        return words | {"_CPLANE0": "N", "_HANDEDNESS": HANDEDNESS}

    @classmethod
    def from_keywords(cls, keywords: Mapping[str, str]) -> Self:
        """Read back what `keywords` wrote; what is absent stays ``None`` or empty. Raises `DataError`."""
        values: dict[str, float | str] = {}
        for name, (key, unit) in _KEYS.items():
            text = keywords.get(key, "").strip()
            if not text:
                continue
            if not unit:
                values[name] = text
                continue
            try:
                values[name] = float(text.split()[0])
            except ValueError:
                raise DataError(f"keyword [{key}]: {text!r} does not start with a number") from None
        return cls(**values)  # type: ignore[arg-type]
