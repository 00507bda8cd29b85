"""Whether a case has enough recordings for any conclusion; says what would be needed if it has not."""

from __future__ import annotations

from warpbrain.cases.case import Case
from warpbrain.cases.enough import too_few_to_diagnose
from warpbrain.errors import InputError
from warpbrain.estimation.observations import Observations


def require_observable(case: Case) -> None:
    """Raise `InputError` if there are too few recordings."""
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen is diagnosed test by test")
    Observations.to_fit(case)
    if why := too_few_to_diagnose(case):
        raise InputError(f"{case.path}: {why}")
