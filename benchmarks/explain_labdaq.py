"""labdaq's own answer, in the form in which `benchmarks/explain.py` compares."""

import csv
import io
import json
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from explain_forms import simulation

from analysis.cases import Case
from analysis.cases.model import Floats
from analysis.explain.answer import answer
from analysis.explain.apply import apply_model, read_model
from analysis.explain.fit import Fitter
from analysis.explain.mechanisms.base import predict
from analysis.explain.mismatch import explain
from analysis.explain.readings import Readings
from simulators.trial.answer import Answer, read_answer

SILENT = ("no-mismatch", "unexplained")
"""Verdicts that correct nothing."""


@dataclass
class Labdaq:
    """`labdaq explain` and `labdaq predict`."""

    case: Case
    name = "labdaq"

    def find(self) -> Answer:
        """Explain the case."""
        self.found = explain(self.case, simulation(self.case))
        self.content = answer(self.found)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "explanation.json"
            path.write_text(json.dumps(self.content), encoding="utf-8")
            self.model = read_model(Path(folder))
            return read_answer(path)

    @property
    def problem(self) -> "Labdaq":
        """What holds the readings, as the peers have it."""
        return self

    @property
    def readings(self) -> Readings:
        """The readings that were explained."""
        return self.found.scene.readings

    def left_out(self, rows: np.ndarray) -> Floats:
        """Predictions [lab units] of ``rows`` of the readings, with parameters fitted to the others."""
        scene, fit = self.found.scene, self.found.conclusion.best.fit
        if self.content["verdict"] in SILENT or not fit.terms:
            return self.readings.simulated[rows]
        theta = Fitter(scene.only(~rows)).fit(fit.terms, fit.theta, fit.hyper).theta
        return predict(scene, fit.terms, theta)[rows]

    def elsewhere(self, case: Case) -> Floats:
        """Predictions of all records of another case."""
        rows = csv.DictReader(io.StringIO(apply_model(self.model, case, simulation(case))))
        factor = Readings.of(case, measured_only=False).unit_factor
        return np.array([float(row["corrected"]) for row in rows]) * factor
