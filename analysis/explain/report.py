"""The report: one self-contained HTML page a lighting engineer can read."""

from html import escape
from typing import Any

from analysis.explain.answer import found_in
from analysis.explain.mismatch import Explanation

_VERDICT = {
    "no-mismatch": "Recording and prediction agree within noise and the simulation's own ripple.",
    "explained": "Recording and prediction differ, and what was left out is named below.",
    "partly-explained": "Part of the difference is named below; something located but unnamed remains.",
    "unexplained": "Recording and prediction differ, and no known mechanism explains it.",
}

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ddd; }
.verdict { font-size: 1.1rem; background: #f3f5f7; padding: .8rem 1rem; border-left: 4px solid #2166ac; }
table { border-collapse: collapse; margin: .6rem 0; }
td, th { padding: .2rem .8rem .2rem 0; text-align: left; vertical-align: top; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0; } figcaption { color: #666; font-size: .9rem; }
svg { max-width: 100%; height: auto; } small { color: #666; }
"""


def report(e: Explanation, content: dict[str, Any], drawn: dict[str, str]) -> str:
    """HTML text of the report; ``content`` is the answer's JSON object, ``drawn`` the SVG plots by name."""
    title = content["title"] or "Recording against simulation"
    parts = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="verdict"><b>{escape(content["verdict"])}.</b> '
        f"{_VERDICT[content['verdict']]}{_numbers(content)}</p>",
        _section(
            "Where they differ",
            _places(content["mismatch"], "Nowhere beyond chance.") + _noted(content["noted"]),
            drawn,
            ("map", "by-gamma", "by-test"),
        ),
        _section("What was left out", _mechanisms(content), drawn, ("evidence",)),
        _section("How much better the fit became", _fit(content), drawn, ("held-out", "measured-predicted", "by-time")),
        _section("What is left", _places(content["leftover"], "Nothing beyond chance.") + _unnamed(content), drawn, ()),
        _section("What cannot be told, and what to measure next", _doubts(content), drawn, ()),
        _section(
            "The record itself",
            _list(content["findings"], "Nothing unusual in digits, stamps, labels or limits."),
            drawn,
            (),
        ),
        _section(
            "Not tried",
            _list([f"{n['id']}: {n['because']}" for n in content["not_tried"]], "Everything was tried."),
            drawn,
            (),
        ),
        f"<p><small>{content['fit']['records']} records. "
        "Deviations are relative, a free gain per test removed.</small></p>",
    ]
    del e
    body = "\n".join(parts)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head><body>\n{body}\n</body></html>\n"
    )


def _numbers(content: dict[str, Any]) -> str:
    fit = content["fit"]
    text = f" Deviation {fit['before']['rms_percent']:.3g} % rms before, {fit['after']['rms_percent']:.3g} % after"
    if fit["held_out"]:
        before, after = (fit["held_out"][k]["rms_percent"] for k in ("before", "after"))
        text += f"; on readings that were not fitted {before:.3g} % and {after:.3g} %"
    return f"{text}."


def _section(title: str, text: str, drawn: dict[str, str], names: tuple[str, ...]) -> str:
    figures = "".join(f"<figure>{drawn[name]}</figure>" for name in names if name in drawn)
    return f"<h2>{title}</h2>\n{text}\n{figures}"


def _list(sentences: list[str], otherwise: str) -> str:
    if not sentences:
        return f"<p>{otherwise}</p>"
    return "<ul>" + "".join(f"<li>{escape(s)}</li>" for s in sentences) + "</ul>"


def _places(places: list[dict[str, Any]], otherwise: str) -> str:
    return _list([f"{p['statement']} (p = {p['p_value']:.1g})" for p in places], otherwise)


def _noted(places: list[dict[str, Any]]) -> str:
    """Where recording and prediction differ most although they agree, said only where there is something to say."""
    lead = "<p>More than noise alone would make, but no more than simulations and second instruments usually err:</p>"
    return lead + _places(places, "") if places else ""


def _mechanisms(content: dict[str, Any]) -> str:
    if not (found := found_in(content)):
        return "<p>Nothing is named.</p>"
    rows = []
    for m in found:
        numbers = "<br>".join(
            f"{escape(name)} = {p['value']:.4g} ± {p['uncertainty']:.2g} {escape(str(p['unit']))}"
            for name, p in m["parameters"].items()
        )
        rows.append(
            f"<tr><td><b>{escape(m['id'])}</b></td><td class=n>{m['probability']:.0%}</td>"
            f"<td>{escape(m['statement'])}</td><td>{numbers}</td></tr>"
        )
    head = "<tr><th>mechanism</th><th>probability</th><th>what it means</th><th>parameters</th></tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def _fit(content: dict[str, Any]) -> str:
    fit = content["fit"]
    rows = [("all readings", fit["before"], fit["after"])]
    if fit["held_out"]:
        rows.append((f"not fitted ({fit['held_out']['scheme']})", fit["held_out"]["before"], fit["held_out"]["after"]))
    if "simulated_again" in fit:
        name = f"all readings, simulated again with {' and '.join(fit['simulated_again']['with'])}"
        rows.append((name, fit["before"], fit["simulated_again"]))
    cells = "".join(
        f"<tr><td>{name}</td><td class=n>{b['rms_percent']:.3g} %</td><td class=n>{a['rms_percent']:.3g} %</td></tr>"
        for name, b, a in rows
    )
    return f"<table><tr><th>readings</th><th>rms before</th><th>rms after</th></tr>{cells}</table>"


def _unnamed(content: dict[str, Any]) -> str:
    if content["verdict"] in {"explained", "no-mismatch"}:
        return ""
    return _list(
        [
            f"A conjecture that fits: {u['conjecture']} ({u['nats']:.1f} nats of evidence)."
            if "conjecture" in u
            else f"Something unnamed varies with {u['along']} ({u['nats']:.1f} nats of evidence)."
            for u in content["unnamed"]
            if u["nats"] > 3
        ],
        "",
    )


def _doubts(content: dict[str, Any]) -> str:
    lines = [f"{a} and {b} fit these readings alike." for a, b in content["indistinguishable"]]
    lines += [
        f"{' + '.join(a['ids'])}: probability {a['probability']:.1%}"
        for a in content["alternatives"]
        if a["probability"] > 0.005
    ]
    lines += [f"{n['id']} is ruled out: {n['because']}." for n in content["ruled_out"]]
    lines.append(content["next_measurement"]["statement"])
    return _list(lines, "")
