"""Results and cases as a table of HTML: what a notebook shows of them."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import Any

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import Diagnosis, Ranked
from warpbrain.ensemble.results import EnsembleResult
from warpbrain.errors import InputError
from warpbrain.estimation.posterior import Marginal, Posterior
from warpbrain.inference.calibration import percent
from warpbrain.recordings.comparison import Comparison
from warpbrain.report.comparison import SHOWN
from warpbrain.report.ensemble import describe_ensemble, ensemble_lines
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import part
from warpbrain.report.summary import SET_TITLES, describe_result, left_out, show_lines
from warpbrain.simulation.result import Result
from warpbrain.simulation.run import Run
from warpbrain.simulation.specimen import SpecimenRun
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: A row: what, and what of it.
Rows = list[tuple[str, str]]


def html(what: Any) -> str:
    """A result or a case as HTML: a title and a table.

    Raises
    ------
    InputError
        If it is none of these.
    """
    return str(part("notebook", *_table(what)))


@singledispatch
def _table(what: Any) -> tuple[str, Rows]:
    raise InputError(f"what: expected a result or a case, found {type(what).__name__}")


@_table.register
def _(what: Case) -> tuple[str, Rows]:
    title, *lines = show_lines(what)
    return title, [(line.strip().split("  ")[0], " ".join(line.split()[1:])) for line in lines]


@_table.register
def _(what: Result) -> tuple[str, Rows]:
    rows = [
        (SET_TITLES.get(name, name), f"mean {s['mean']:.3g} mm, at most {s['largest']:.3g} mm, {s['nodes']} nodes")
        for name, s in describe_result(what)["displacement_mm"].items()
    ]
    rows += [
        ("volume ratio J", f"{what.J.min():.3f} to {what.J.max():.3f}"),
        ("von Mises stress", f"at most {what.von_mises.max():.3g} Pa"),
    ]
    return "Displacement", rows


@_table.register
def _(what: Run) -> tuple[str, Rows]:
    largest = MILLIMETRES * float(np.linalg.norm(what.u, axis=1).max())
    rows = [("state", what.followed.solution["kind"]), ("moves by at most", f"{largest:.3g} mm")]
    rows += [(comparison.name, _before_after(comparison)) for comparison in what.observed.comparisons]
    return what.case.title, rows + [("left out", sentence) for sentence in left_out(what.model)]


@_table.register
def _(what: SpecimenRun) -> tuple[str, Rows]:
    fits = ((t, "" if math.isnan(t.result.r_squared) else f"; R² {t.result.r_squared:.4f}") for t in what.tests)
    return what.case.title, [(t.recording.name, _before_after(t.comparison) + fit) for t, fit in fits]


@_table.register
def _(what: Posterior) -> tuple[str, Rows]:
    rows = [(m.parameter.tissue, _marginal(m)) for m in what.marginals]
    rows += [("recordings", sentence) for sentence in what.identifiability.sentences]
    return f"Tissue of: {what.case.title}", rows + [("doubt", doubt) for doubt in what.doubts]


@_table.register
def _(what: Diagnosis | SpecimenDiagnosis) -> tuple[str, Rows]:
    rows = [("verdict", what.sentence)]
    rows += [
        (ranked.kind if isinstance(ranked, Ranked) else ranked.name, f"probability {percent(ranked.probability)}")
        for ranked in what.ranking
    ]
    return f"Diagnosis of: {what.case.title}", rows + [("doubt", doubt) for doubt in what.doubts]


@_table.register
def _(what: EnsembleResult) -> tuple[str, Rows]:
    first, *rest = ensemble_lines(describe_ensemble(what))
    return first, [("", line) for line in rest if line]


def _before_after(comparison: Comparison) -> str:
    factor, unit = SHOWN[comparison.unit]
    before, after = factor * comparison.before.root_mean_square, factor * comparison.after.root_mean_square
    return f"RMSE {before:.3g} before, {after:.3g} {unit} after".rstrip()


def _marginal(marginal: Marginal) -> str:
    low, high = marginal.interval
    if marginal.parameter.is_modulus:
        return f"shear modulus {math.exp(marginal.estimate):.4g} Pa, 95 %: {math.exp(low):.4g} to {math.exp(high):.4g}"
    return f"{marginal.parameter.coordinate.name} {marginal.estimate:.4g}, 95 %: {low:.4g} to {high:.4g}"
