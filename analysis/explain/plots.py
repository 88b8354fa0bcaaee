"""Plots of an explanation, as SVG text: where it differs, before and after, and the evidence."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np

from analysis.cases.model import Floats
from analysis.explain.heldout import deviations
from analysis.explain.mismatch import Explanation

_BEFORE, _AFTER = "#b2182b", "#2166ac"


def plots(e: Explanation) -> dict[str, str]:
    """All plots that this explanation has: name (without .svg) to SVG text."""
    r = e.scene.readings
    before, after = deviations(r, r.simulated), deviations(r, e.corrected)
    drawn = {"by-test": _svg(lambda axes: _by_test(axes, e, before, after), (8, 3.2))}
    if np.any(e.scene.is_gonio):
        drawn["map"] = _svg(lambda axes: _map(axes, e, before, after), (9, 3.4), columns=2)
        drawn["by-gamma"] = _svg(lambda axes: _by_gamma(axes, e, before, after), (8, 3.2))
    if r.has_times:
        drawn["by-time"] = _svg(lambda axes: _by_time(axes, e, before, after), (8, 3.2))
    drawn["measured-predicted"] = _svg(lambda axes: _scatter(axes, e), (4.6, 4.2))
    if e.conclusion.singles:
        drawn["evidence"] = _svg(lambda axes: _evidence(axes, e), (8, 4.2))
    if e.held_out is not None:
        drawn["held-out"] = _svg(lambda axes: _held_out(axes, e), (8, 3.2))
    return drawn


def _svg(draw: Callable[[Any], None], size: tuple[float, float], columns: int = 1) -> str:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "labdaq", "font.size": 9, "axes.spines.top": False}):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(1, columns)
        draw(axes)
        out = io.StringIO()
        figure.savefig(out, format="svg", metadata={"Date": None})
    text = out.getvalue()
    return text[text.index("<svg") :]


def _map(axes: Any, e: Explanation, before: Floats, after: Floats) -> None:
    """Mean deviation over all tests on gamma and C, before and after."""
    r = e.scene.readings
    rows = e.scene.is_gonio
    gammas, planes = np.unique(r.gamma_deg[rows]), np.unique(r.c_deg[rows])
    i, j = np.searchsorted(planes, r.c_deg[rows]), np.searchsorted(gammas, r.gamma_deg[rows])
    most = 100 * max(float(np.quantile(np.abs(before[rows]), 0.98)), 1e-3)
    for axis, values, title in zip(axes, (before, after), ("before", "after"), strict=True):
        total, count = np.zeros((len(planes), len(gammas))), np.zeros((len(planes), len(gammas)))
        np.add.at(total, (i, j), 100 * values[rows])
        np.add.at(count, (i, j), 1.0)
        mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        image = axis.imshow(mean.T, aspect="auto", origin="lower", cmap="RdBu_r", vmin=-most, vmax=most)
        axis.set_title(f"{title}: recording against prediction, mean of tests")
        axis.set_xticks(range(0, len(planes), 2), [f"{c:g}" for c in planes[::2]])
        axis.set_yticks(range(len(gammas)), [f"{g:g}" for g in gammas])
        axis.set_xlabel("C [deg] (0 north, 90 west)")
        axis.set_ylabel("gamma [deg]")
        axis.figure.colorbar(image, ax=axis, label="%")


def _by_test(axes: Any, e: Explanation, before: Floats, after: Floats) -> None:
    r = e.scene.readings
    present = np.unique(r.test)
    x = np.arange(len(present))
    for values, colour, label, shift in ((before, _BEFORE, "before", -0.2), (after, _AFTER, "after", 0.2)):
        size = [100 * np.sqrt(np.mean(values[r.test == k] ** 2)) for k in present]
        axes.bar(x + shift, size, 0.38, color=colour, label=label)
    axes.set_xticks(x, [e.scene.readings.case.tests[k].id for k in present], rotation=45 if len(x) > 8 else 0)
    axes.set_ylabel("rms deviation [%]")
    axes.legend(frameon=False)


def _by_gamma(axes: Any, e: Explanation, before: Floats, after: Floats) -> None:
    r = e.scene.readings
    gammas = np.unique(r.gamma_deg[e.scene.is_gonio])
    for values, colour, label in ((before, _BEFORE, "before"), (after, _AFTER, "after")):
        rows = [values[e.scene.is_gonio & (r.gamma_deg == g)] for g in gammas]
        mean = np.array([100 * v.mean() for v in rows])
        spread = np.array([100 * v.std() for v in rows])
        axes.plot(gammas, mean, color=colour, marker="o", ms=3, label=label)
        axes.fill_between(gammas, mean - spread, mean + spread, color=colour, alpha=0.15, lw=0)
    axes.axhline(0, color="0.6", lw=0.8)
    axes.set_xlabel("gamma [deg]")
    axes.set_ylabel("recording - prediction [%]")
    axes.legend(frameon=False)


def _by_time(axes: Any, e: Explanation, before: Floats, after: Floats) -> None:
    """Deviation against the time since each test began (or, for single readings, since the first)."""
    r = e.scene.readings
    t = r.utc_ns / 6e10
    if np.max(np.bincount(r.test)) >= 8:
        began = np.full(len(r.case.tests), np.inf)
        np.minimum.at(began, r.test, t)
        t, label = t - began[r.test], "minutes since the test began"
    else:
        t, label = t - t.min(), "minutes since the first reading"
    order = np.argsort(t)
    for values, colour, name in ((before, _BEFORE, "before"), (after, _AFTER, "after")):
        axes.plot(t[order], 100 * values[order], ".", ms=2, color=colour, alpha=0.35, label=name)
    axes.axhline(0, color="0.6", lw=0.8)
    axes.set_xlabel(label)
    axes.set_ylabel("recording - prediction [%]")
    axes.legend(frameon=False)


def _scatter(axes: Any, e: Explanation) -> None:
    r = e.scene.readings
    good = (r.measured > 0) & (r.simulated > 0) & (e.corrected > 0)
    axes.loglog(r.measured[good], r.simulated[good], ".", ms=2, color=_BEFORE, alpha=0.4, label="before")
    axes.loglog(r.measured[good], e.corrected[good], ".", ms=2, color=_AFTER, alpha=0.4, label="after")
    if np.any(good):
        ends = [r.measured[good].min(), r.measured[good].max()]
        axes.plot(ends, ends, color="0.5", lw=0.8)
    axes.set_xlabel("measured")
    axes.set_ylabel("predicted")
    axes.legend(frameon=False)


def _evidence(axes: Any, e: Explanation) -> None:
    found = e.conclusion
    rows = [(" + ".join(h.ids), h.evidence - found.nothing.evidence) for h in found.singles[:14]]
    if len(found.best.ids) > 1:
        rows.insert(0, (" + ".join(found.best.ids), found.best.evidence - found.nothing.evidence))
    named = set(found.best.ids)
    colours = [_AFTER if set(name.split(" + ")) <= named and named else "0.7" for name, _ in rows]
    y = np.arange(len(rows))[::-1]
    axes.barh(y, [gain for _, gain in rows], color=colours)
    axes.set_yticks(y, [name for name, _ in rows])
    axes.axvline(0, color="0.4", lw=0.8)
    axes.set_xscale("symlog", linthresh=10)
    axes.set_xlabel("evidence over 'nothing was left out' [nats]")


def _held_out(axes: Any, e: Explanation) -> None:
    assert e.held_out is not None
    groups = e.held_out.groups
    x = np.arange(len(groups))
    axes.bar(x - 0.2, [100 * b for _, b, _ in groups], 0.38, color=_BEFORE, label="before")
    axes.bar(x + 0.2, [100 * a for _, _, a in groups], 0.38, color=_AFTER, label="after, fitted to the others")
    axes.set_xticks(x, [n for n, _, _ in groups], rotation=45 if len(x) > 8 else 0)
    axes.set_ylabel("rms deviation, left out [%]")
    axes.legend(frameon=False)
