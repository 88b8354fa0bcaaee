"""In which tests a mechanism acts: in all, or, on a roof, in those of a state that began or ended on the way."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from analysis.cases.model import Floats
from analysis.explain.mechanisms.base import Mechanism, Stage, Term
from analysis.explain.scene import Scene

State = tuple[str, frozenset[int], dict[str, float]]
"""What it is called, its tests, and when it began and ended [s since 1970], for cases with other tests."""


def terms_of(mechanism: Mechanism, scene: Scene) -> tuple[Term, ...]:
    """All the ways in which ``mechanism`` can act in ``scene``; roof meters also from some test on, or until one."""
    ways = tuple(Term(mechanism, b, mechanism.parameters_in(scene, b)) for b in mechanism.branches(scene))
    if not scene.on_the_roof or not (mechanism.stage is Stage.ROOF_METERS or mechanism.in_one_test):
        return ways
    states = _states(scene) + (_single_tests(scene) if mechanism.in_one_test else [])
    return (*ways, *(_during(way, *state) for way in ways for state in states))


def _in_order(scene: Scene) -> tuple[NDArray[np.int64], Floats]:
    """The tests in the order of time (or of the case, without times), and when each test began [s since 1970]."""
    r = scene.readings
    present = np.unique(r.test)
    began = np.full(len(r.case.tests), np.nan)
    if r.has_times:
        began[present] = [r.utc_ns[r.test == k].min() / 1e9 for k in present]
        present = present[np.argsort(began[present])]
    return present, began


def _single_tests(scene: Scene) -> list[State]:
    """Each test between others by itself."""
    present, began = _in_order(scene)
    states = []
    for k, after in pairwise(present[1:]):
        times = {"from_utc_s": float(began[k]), "until_utc_s": float(began[after])} if np.isfinite(began[k]) else {}
        states.append((f"in {scene.readings.case.tests[k].id}", frozenset({int(k)}), times))
    return states


def _states(scene: Scene) -> list[State]:
    """Stretches of the campaign that end or begin at a test."""
    r = scene.readings
    present, began = _in_order(scene)
    states = []
    for cut in range(1, len(present)):
        name, at = r.case.tests[present[cut]].id, float(began[present[cut]])
        before, after = (frozenset(int(k) for k in part) for part in (present[:cut], present[cut:]))
        states.append((f"until before {name}", before, {"until_utc_s": at} if np.isfinite(at) else {}))
        states.append((f"from {name} on", after, {"from_utc_s": at} if np.isfinite(at) else {}))
    return states


def _during(way: Term, label: str, tests: frozenset[int], facts: dict[str, float]) -> Term:
    branch = replace(way.branch, label=f"{way.branch.label}, {label}", facts=way.branch.facts | facts)
    return replace(way, branch=branch, tests=tests)


def in_its_state(way: Term, scene: Scene, label: str, facts: dict[str, float]) -> Term:
    """A whole-campaign way as it acts in the state that ``facts`` (`_states`) of another case describe."""
    r = scene.readings
    times = np.array([np.min(r.utc_ns[r.test == k], initial=np.iinfo(np.int64).max) for k in range(len(r.case.tests))])
    inside = (times / 1e9 >= facts.get("from_utc_s", -np.inf)) & (times / 1e9 < facts.get("until_utc_s", np.inf))
    tests = frozenset(int(k) for k in np.flatnonzero(inside))
    return replace(way, branch=replace(way.branch, label=label), tests=tests)
