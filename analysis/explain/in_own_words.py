"""What a case's variant showed, in the words of our own simulation, where another case brings no such variant."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from analysis.explain.mechanisms.well import LIKE_LIMIT, BounceTruncation, WallReflectance, WallScatter
from analysis.explain.path_making import OWN
from analysis.explain.scene import Scene
from analysis.explain.settings import DIFFUSE_SHARE
from analysis.explain.variants import OF_CASE

Entry = dict[str, Any]
"""A mechanism as fitted, as an explanation's ``model`` holds it."""


def in_own_words(entry: Entry, scene: Scene) -> Entry:
    """The same entry, or that of our own simulation where the case brings no variant that the entry is of."""
    if not entry["way"].startswith(OF_CASE):
        return entry
    translate = _TRANSLATED.get(entry["id"], _as_shown_elsewhere)
    return translate(entry, scene)


def _as_shown_elsewhere(entry: Entry, scene: Scene) -> Entry:
    """What of our own simulation was most like it in the tests that were fitted (`analysis.explain.elsewhere`)."""
    ours = entry.get("elsewhere")
    if _brings(entry, scene) or not ours:
        return entry
    wide = [abs(x) for x in entry["sd"][:1]] if ours["names"] == entry["names"] else [0.0]
    return {**entry, **ours, "sd": wide}


def _as_a_limit(entry: Entry, scene: Scene) -> Entry:
    """A share of what a variant without a limit of bounces showed: what the limit cut off that the case states.

    Or, where it states none, that by which as much would be missing.
    """
    limit = scene.readings.case.setup.simulation.max_bounces or entry["facts"].get(LIKE_LIMIT, 0)
    if _brings(entry, scene) or entry["names"] != ["weight"] or not limit:
        return entry
    (parameter,) = BounceTruncation.parameters
    return {**entry, "way": OWN + _only(entry), "names": [parameter.name], "theta": [float(limit)], "sd": [0.0]}


def _as_scatter(entry: Entry, scene: Scene) -> Entry:
    """A share that walls scatter is one by any name."""
    if _brings(entry, scene) or not entry["names"][0].endswith("share"):
        return entry
    return {**entry, "way": DIFFUSE_SHARE + _only(entry), "names": [WallScatter.parameters[0].name]}


def _as_one_wall(entry: Entry, scene: Scene) -> Entry:
    """A share of a variant of several systems' walls, as the reflectance that it comes to where one has tests here."""
    if entry["names"] != ["weight"] or not entry["way"].startswith(f"{OF_CASE} wall_reflectance = "):
        return entry
    case, ways = scene.readings.case, {} if scene.retraced is None else scene.retraced.case_paths
    tested = [s for s in case.setup.system if s.id in {t.system for t in case.tests}]
    labels = [path.label for path in ways.get(WallReflectance.id, ())]
    if len(tested) != 1 or tested[0].wall_reflectance is None or any(label == entry["way"] for label in labels):
        return entry
    own, other = tested[0].wall_reflectance, float(entry["way"].split(" = ")[1].split(",")[0])
    (share,), (sd,), (parameter,) = entry["theta"], entry["sd"], WallReflectance.parameters
    way = next((label for label in labels if label.startswith(f"{OF_CASE}s of {parameter.name}")), tested[0].id)
    theta, spread = own + share * (other - own), abs(other - own) * sd
    return {**entry, "way": way, "names": [parameter.name], "theta": [theta], "sd": [spread]}


_TRANSLATED: Final[Mapping[str, Callable[[Entry, Scene], Entry]]] = {
    BounceTruncation.id: _as_a_limit,
    WallScatter.id: _as_scatter,
    WallReflectance.id: _as_one_wall,
}
"""By mechanism; of others our own simulation tells what was most like it."""


def _brings(entry: Entry, scene: Scene) -> bool:
    """Whether the case brings variants of the entry's mechanism."""
    return scene.retraced is not None and entry["id"] in scene.retraced.case_paths


def _only(entry: Entry) -> str:
    """What a way is called further that acts on some systems only."""
    return "".join(f", {name} only" for name in entry.get("only", []))
