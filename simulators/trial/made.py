"""An order for a case, and the case made."""

from dataclasses import dataclass

from simulators.trial.truth import Truth


@dataclass(frozen=True)
class Order:
    """What a case is to conceal.

    Attributes
    ----------
    name
        Folder of the case; tells nothing about its content.
    kind
        ``goniometer``, ``roof`` or ``camera``.
    content
        ``null``, ``single``, ``pair`` or ``open``.
    conceal, effects
        Causes by name, and the effect wanted for each [1].
    seed
        Everything else is drawn from it.
    withhold
        Keep some tests back for `labdaq predict`.
    designs
        Skylights to choose from (`stock.DESIGNS`); empty for all.
    """

    name: str
    kind: str
    content: str
    conceal: tuple[str, ...]
    effects: tuple[float, ...]
    seed: int
    withhold: bool = False
    designs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Made:
    """A case: its files by relative path, those of the withheld tests (without measured), and the truth."""

    order: Order
    files: dict[str, str]
    withheld: dict[str, str]
    truth: Truth
