"""What came out of `benchmarks/explain_figure90.py`, as Markdown."""

from typing import Any, Final

import numpy as np

from analysis.explain.answer import found_in

SHOWN: Final = (9, 18, 16, 24)
"""Figure 90's test; the low sun of the box and of the tube; and the one of which the report suspects the limit."""


def told(result: dict[str, Any]) -> str:
    """The result as Markdown."""
    lines = [
        f"Room: walls and ceiling {100 * result['room']['walls']:.2f} %, floor {100 * result['room']['floor']:.2f} %. "
        "Numbers are means over the 16 C-planes, in per cent of the recording."
    ]
    for name, engine in result["engines"].items():
        lines += ["", f"### With {name}'s settings ({engine['field']} field, {engine['limit']} interactions)", ""]
        rings = {test: {**parts, "after": engine["after"][test]} for test, parts in engine["shares"].items()}
        for test in (f"T{n}" for n in SHOWN):
            if test in rings:
                lines += [f"Test {test[1:]}:", "", *_ring_table(rings[test]), ""]
        lines += [f"Mean of all {len(rings)} tests:", "", *_ring_table(_mean(list(rings.values()))), ""]
        lines += _answer_lines(engine["answer"])
    return "\n".join(lines) + "\n"


def _mean(rings: list[dict[str, list[float]]]) -> dict[str, list[float]]:
    return {name: np.mean([one[name] for one in rings], axis=0).tolist() for name in rings[0]}


def _ring_table(shares_: dict[str, list[float]]) -> list[str]:
    words = {
        "total": "prediction - recording",
        "room": "of this: room left out",
        "limit": "of this: limit of interactions",
        "field": "of this: far field for near",
        "rest": "of this: the simulations' difference, noise",
        "after": "labdaq's corrected prediction - recording",
    }
    gammas = shares_["gamma_deg"]
    rows = ["| gamma [deg] | " + " | ".join(f"{g:g}" for g in gammas) + " |", "|---" * (len(gammas) + 1) + "|"]
    rows += [
        f"| {word} | " + " | ".join(f"{round(v, 1) + 0.0:+.1f}" for v in shares_[name]) + " |"
        for name, word in words.items()
    ]
    return rows


def _answer_lines(answer: dict[str, Any]) -> list[str]:
    fit = answer["fit"]
    lines = [f"`labdaq explain` says **{answer['verdict']}**."]
    for m in found_in(answer):
        values = ", ".join(
            f"{name} {p['value']:.3g} ± {p['uncertainty']:.2g} {'' if p['unit'] == '1' else p['unit']}".strip()
            for name, p in m["parameters"].items()
            if not isinstance(p["value"], str)
        )
        lines.append(f"- {m['id']} ({100 * m['probability']:.0f} %): {values}. {m['statement']}")
    lines += [f"- Not told apart: {' and '.join(pair)}." for pair in answer["indistinguishable"]]
    lines += [f"- Left: {place['statement']} (p = {place['p_value']:.2g})" for place in answer["leftover"][:3]]
    before, after = fit["before"]["rms_percent"], fit["after"]["rms_percent"]
    held = fit.get("held_out")
    text = f"Deviation {before:.2f} % before, {after:.2f} % after"
    if held:
        left = held["before"]["rms_percent"], held["after"]["rms_percent"]
        text += f"; {held['scheme']} {left[0]:.2f} % before, {left[1]:.2f} % after"
    best = ", ".join(f"{'+'.join(e['ids'])} {e['nats_over_nothing']:.0f}" for e in answer["evidence"][:6])
    return [*lines, "", f"{text}. Evidence of single mechanisms [nats over nothing]: {best}."]
