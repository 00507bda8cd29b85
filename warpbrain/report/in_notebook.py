"""Results and cases as a table of HTML: what a notebook shows of them. The words are in `page/notebook.html`."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.ensemble.results import EnsembleResult
from warpbrain.errors import InputError
from warpbrain.estimation.posterior import Posterior
from warpbrain.report.comparison import SHOWN
from warpbrain.report.ensemble import describe_ensemble, ensemble_lines
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import part
from warpbrain.report.summary import SET_TITLES, describe_result, left_out, show_lines
from warpbrain.simulation.result import Result
from warpbrain.simulation.run import Run
from warpbrain.simulation.specimen import SpecimenRun
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: By what it is, the macro that tells it, and what this takes beside it.
_TOLD: dict[type, tuple[str, Callable[[Any], tuple[Any, ...]]]] = {
    Case: ("case", lambda case: (show_lines(case),)),
    Result: ("result", lambda result: (describe_result(result), SET_TITLES)),
    Run: ("run", lambda run: (MILLIMETRES * np.linalg.norm(run.u, axis=1).max(), left_out(run.model), SHOWN)),
    SpecimenRun: ("specimen", lambda run: (SHOWN,)),
    Posterior: ("posterior", lambda posterior: (math.exp,)),
    Diagnosis: ("diagnosis", lambda diagnosis: ()),
    SpecimenDiagnosis: ("diagnosis", lambda diagnosis: ()),
    EnsembleResult: ("ensemble", lambda result: (ensemble_lines(describe_ensemble(result)),)),
}


def html(what: Any) -> str:
    """A result or a case as HTML: a title and a table.

    Raises
    ------
    InputError
        If it is none of these.
    """
    for kind, (macro, values) in _TOLD.items():
        if isinstance(what, kind):
            return str(part(macro, what, *values(what), template="notebook.html"))
    raise InputError(f"what: expected a result or a case, found {type(what).__name__}")
