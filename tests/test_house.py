"""The rules of the house: who may import whom, and no circles."""

from pathlib import Path

import grimp
import pytest

from labdaq.errors import LabdaqError
from labdaq.rooms import check_rooms

ROOMS = ("labdaq", "drivers", "simulators", "analysis")


def test_no_cycle_between_files() -> None:
    graph = grimp.build_graph(*ROOMS)
    ahead = {m: graph.find_modules_directly_imported_by(m) for m in graph.modules}
    done: set[str] = set()

    def visit(module: str, path: list[str]) -> None:
        if module in path:
            raise AssertionError("imports in a circle: " + " -> ".join([*path[path.index(module) :], module]))
        if module not in done:
            for imported in ahead[module]:
                visit(imported, [*path, module])
            done.add(module)

    for module in graph.modules:
        visit(module, [])


@pytest.mark.parametrize("outside", ["drivers", "simulators", "analysis"])
def test_the_vocabulary_stands_alone(outside: str) -> None:
    graph = grimp.build_graph(*ROOMS)
    for word in ("clock", "directions", "errors", "pipe", "reading", "units", "virtual_time"):
        chain = graph.find_shortest_chain(f"labdaq.{word}", outside, as_packages=True)
        assert chain is None, f"labdaq.{word} must not know {outside}: {chain}"


def test_a_shadowed_room_is_named(tmp_path: Path) -> None:
    check_rooms()
    with pytest.raises(LabdaqError, match="drivers"):
        check_rooms(home=tmp_path)
