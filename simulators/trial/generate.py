"""Make the cases that were ordered, and put cases and truths where they belong."""

from collections.abc import Callable
from pathlib import Path

from simulators.trial import truth
from simulators.trial.files import write_folder
from simulators.trial.made import Made, Order
from simulators.trial.shelf import Shelf

WITHHELD = "-withheld"


def make(order: Order, shelf: Shelf) -> Made:
    """Make one case, in memory."""
    if order.kind == "goniometer":
        from simulators.trial import gonio_case

        return gonio_case.make(order, shelf)
    if order.kind == "roof":
        from simulators.trial import roof_case

        return roof_case.make(order)
    if order.kind == "camera":
        from simulators.trial import sky_case

        return sky_case.make(order)
    raise ValueError(f"no such kind of case: {order.kind}")


def write_case(made: Made, folder: Path) -> Path:
    """Write a case (and beside it its withheld tests, if any) under ``folder``; return the case's folder."""
    place = folder / made.order.name
    write_folder(place, made.files)
    if made.withheld:
        write_folder(folder / f"{made.order.name}{WITHHELD}", made.withheld)
    return place


def write_all(
    orders: list[Order],
    shelf: Shelf,
    cases: Path,
    truths: Path,
    progress: Callable[[Made, int], None] | None = None,
) -> None:
    """Write every ordered case under ``cases``, and its truth as ``truths/<name>.json``."""
    for number, order in enumerate(orders):
        made = make(order, shelf)
        write_case(made, cases)
        truth.write(made.truth, truths / f"{order.name}.json")
        if progress is not None:
            progress(made, number + 1)
