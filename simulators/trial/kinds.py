"""Kinds of channel, what cases of each can conceal, and at which stage of the chain."""

from typing import Final

STAGES: Final[dict[str, dict[str, str]]] = {
    "goniometer": {
        "sky-sun-ratio": "source",
        "circumsolar-aureole": "source",
        "cloud-drift": "source",
        "lens-haze": "optics",
        "lens-anisotropy": "optics",
        "lens-orientation": "optics",
        "soiling": "optics",
        "wall-reflectance": "well",
        "bounce-truncation": "well",
        "wall-scatter": "well",
        "room-interreflection": "room",
        "stray-light": "room",
        "near-field": "goniometer",
        "gamma-offset": "goniometer",
        "c-offset": "goniometer",
        "c-handedness": "goniometer",
        "channel-swap": "goniometer",
        "dark-offset": "sensors",
        "nonlinearity": "sensors",
        "saturation": "sensors",
        "cosine-response": "sensors",
        "channel-gain": "sensors",
        "clock-offset": "time",
    },
    "roof": {
        "meter-tilt": "mounting",
        "meter-gain": "calibration",
        "meter-cosine": "head",
        "meter-range-limit": "range",
        "clock-offset": "time",
        "nonlinearity": "electronics",
        "dark-offset": "electronics",
    },
    "camera": {
        "vignetting": "lens",
        "veiling-glare": "glare",
        "spectral-mismatch": "sensor",
        "exposure-error": "shutter",
        "projection-error": "projection",
        "clock-offset": "time",
        "nonlinearity": "response",
    },
}
"""Per kind: catalogue ids, and the stage at which each acts (a pair comes from two stages)."""

_OUTSIDE: Final[dict[str, tuple[str, ...]]] = {
    "goniometer": (
        "horizon-obstruction",
        "broken-cover",
        "cable-shadow",
        "specular-glint",
        "bright-panel",
        "arm-sag",
        "aperture-offset",
        "backlash",
        "temperature-drift",
        "time-constant",
        "sensor-spectral-mismatch",
    ),
    "roof": ("temperature-drift", "mast-shadow", "wall-reflection", "dew", "sluggish-meter"),
    "camera": ("ghost", "dust", "pixel-response", "haze-band", "cloud-motion"),
}

UNSUITED: Final = frozenset(
    {
        frozenset(("stray-light", "dark-offset")),
        frozenset(("c-handedness", "c-offset")),
        frozenset(("c-handedness", "lens-orientation")),
    }
)
"""Pairs that nobody could tell from one of them alone."""


def inside(kind: str) -> tuple[str, ...]:
    """Catalogue ids that cases of a kind can conceal."""
    return tuple(STAGES[kind])


def outside(kind: str) -> tuple[str, ...]:
    """Physics outside the catalogue that cases of a kind can conceal."""
    return _OUTSIDE[kind]
