"""Open the truth, and put it beside the answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from labdaq.demo.answering import REPORT
from labdaq.demo.folder import Folder
from labdaq.errors import DataError


@dataclass(frozen=True)
class Outcome:
    """What was concealed, and what was answered.

    Attributes
    ----------
    truth
        As the file tells.
    answer
        As `labdaq explain` gave it.
    report
        The page to open.
    """

    truth: Mapping[str, Any]
    answer: Mapping[str, Any]
    report: Path

    @property
    def named(self) -> list[str]:
        """The mechanisms that the answer names, surest first."""
        return [str(one["id"]) for one in self.answer["mechanisms"]]

    @property
    def judgement(self) -> str:
        """``named first``, ``named``, ``named as indistinguishable`` or ``not named``."""
        concealed = self.truth["mechanism"]
        if self.named[:1] == [concealed]:
            return "named first"
        if concealed in self.named:
            return "named"
        alike = [pair for pair in self.answer.get("indistinguishable", ()) if concealed in pair]
        told = {*self.named, *(name for one in self.answer.get("either", ()) for name in one["ids"])}
        return "named as indistinguishable" if any(set(pair) & told for pair in alike) else "not named"

    def facts(self) -> dict[str, Any]:
        """For the folder's mark."""
        return {
            "concealed": self.truth["mechanism"],
            "verdict": self.answer["verdict"],
            "named": self.named,
            "judgement": self.judgement,
            "report": str(self.report),
        }

    def lines(self) -> list[str]:
        """Truth beside answer, for people."""
        lines = [f"concealed   {self.truth['mechanism']}: {self.truth['sentence']}", *self._parameters(self.truth)]
        lines.append(f"answer      {self.answer['verdict']}")
        for one in self.answer["mechanisms"]:
            lines.append(f"            {one['id']} ({100 * one['probability']:.0f} %): {one['statement']}")
            lines += self._parameters(one)
        for one in self.answer.get("either", ()):
            lines.append(
                f"            {' or '.join(one['ids'])} ({100 * one['probability']:.0f} %): {one['statement']}"
            )
            lines += self._parameters(one)
        for pair in self.answer.get("indistinguishable", ()):
            lines.append(f"            cannot be told apart with these tests: {' and '.join(pair)}")
        fit = self.answer.get("fit") or {}
        if "before" in fit and "after" in fit:
            lines.append(f"fit         {_rms(fit['before'])} before, {_rms(fit['after'])} after")
        held = fit.get("held_out") or {}
        if "before" in held and "after" in held:
            lines.append(
                f"            on tests that were not fitted: {_rms(held['before'])} before, {_rms(held['after'])} after"
            )
        lines.append(f"so          what was concealed is {self.judgement}")
        return lines

    @staticmethod
    def _parameters(owner: Mapping[str, Any]) -> list[str]:
        found = []
        for name, parameter in (owner.get("parameters") or {}).items():
            about = parameter.get("uncertainty")
            spread = f" +- {about:.2g}" if isinstance(about, int | float) else ""
            value, unit = parameter["value"], parameter.get("unit", "")
            shown = f"{value:.4g}" if isinstance(value, int | float) else str(value)
            found.append(f"              {name} = {shown}{spread} {'' if unit == '1' else unit}".rstrip())
        return found


def _rms(fit: Mapping[str, Any]) -> str:
    value = fit.get("rms_percent")
    return "unknown" if value is None else f"{value:.2f} % rms"


def reveal(folder: Folder, answer: Mapping[str, Any]) -> Outcome:
    """Open the file in which the truth was written down. Raises `DataError` when it cannot be read."""
    try:
        truth = msgspec.json.decode(folder.truth.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.MsgspecError) as error:
        raise DataError(f"{folder.truth}: what was concealed cannot be read: {error}") from error
    return Outcome(truth, answer, folder.answer / REPORT)
