"""One concealed effect of an emulated station: drawn at random, laid over world and instruments, its truth apart."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from labdaq.errors import DataError
from simulators.hidden.effects import Hidden
from simulators.world.altered import altered
from simulators.world.mechanisms import MECHANISMS, Parameters, bare

FORMAT: Final = "labdaq-concealed/1"


@dataclass(frozen=True)
class Concealed:
    """What is concealed.

    Attributes
    ----------
    mechanism
        Its id in the catalogue.
    parameters
        How strong it is, in the units of `MECHANISMS`.
    systems
        Skylights it concerns, where it concerns skylights.
    """

    mechanism: str
    parameters: Parameters
    systems: tuple[str, ...] = ()

    @property
    def stage(self) -> str:
        """Where in the measuring chain it sits."""
        return MECHANISMS[self.mechanism].stage

    @property
    def sentence(self) -> str:
        """What happened, for people."""
        return MECHANISMS[self.mechanism].sentence.format(**self.parameters)

    @property
    def everything(self) -> Hidden:
        """The effect, on whichever side it acts."""
        return MECHANISMS[self.mechanism].hidden(self.parameters, self.systems)

    @property
    def hidden(self) -> Hidden:
        """What the world applies of it; neutral if the effect sits in an instrument."""
        return bare(self.everything)

    def alter(self, entry: object, options: Any) -> Any:
        """Options for the emulator of a station's instrument, with the effect if it sits there."""
        return altered(self.everything, options)

    def truth(self) -> dict[str, Any]:
        """The truth as plain values for JSON. It must be kept away from sessions and from whoever explains them."""
        units = MECHANISMS[self.mechanism].units
        return {
            "format": FORMAT,
            "mechanism": self.mechanism,
            "stage": self.stage,
            "parameters": {name: {"value": value, "unit": units[name]} for name, value in self.parameters.items()},
            "systems": list(self.systems),
            "sentence": self.sentence,
        }

    def write(self, path: Path) -> None:
        """Write the truth beside its final name, then rename."""
        made = path.with_name(f".{path.name}.part")
        made.write_text(json.dumps(self.truth(), indent=1) + "\n", encoding="utf-8")
        made.replace(path)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a truth that `write` wrote; raises `DataError` for anything else."""
        try:
            raw = json.loads(path.read_text(encoding="utf-8"))
            if raw["format"] != FORMAT:
                raise ValueError(f"format is {raw['format']!r}, not {FORMAT!r}")
            if raw["mechanism"] not in MECHANISMS:
                raise ValueError(f"there is no mechanism {raw['mechanism']!r}")
            parameters = {str(name): float(p["value"]) for name, p in raw["parameters"].items()}
            if set(parameters) != set(MECHANISMS[raw["mechanism"]].units):
                raise ValueError(f"parameters are {', '.join(parameters)}")
            return cls(raw["mechanism"], parameters, tuple(str(s) for s in raw["systems"]))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise DataError(f"{path}: not a concealed effect: {error}") from error


def draw(seed: int, systems: tuple[str, ...] = ("box", "tube"), mechanism: str | None = None) -> Concealed:
    """Draw one effect, or the strength of a given one, for a station that has these skylights.

    The same seed gives the same effect.
    """
    rng = np.random.default_rng([seed, 4711])
    chosen = str(rng.choice(sorted(MECHANISMS)))
    rng = np.random.default_rng([seed, 4712])
    kind = MECHANISMS[mechanism or chosen]
    parameters = kind.draw(rng)
    concerned: tuple[str, ...] = ()
    if kind.stage in ("optics", "well"):
        concerned = (str(rng.choice(systems)),) if kind.one_system else tuple(systems)
    return Concealed(mechanism or chosen, parameters, concerned)


__all__ = ["MECHANISMS", "Concealed", "draw"]
