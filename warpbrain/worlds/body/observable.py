"""Whether a case has enough recordings for any conclusion; says what would be needed if it has not."""

from __future__ import annotations

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.observations import Observations

#: Numbers below which nothing but registration and stiffness can be told: a dozen, and one point more.
_FEWEST = 15


def require_observable(case: Case) -> None:
    """Raise `InputError` if there are too few recordings."""
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen is diagnosed test by test")
    observations = Observations.to_fit(case)
    count = sum(observation.size * len(observation.rows) for observation in observations.recordings)
    if count < _FEWEST:
        points = int(np.ceil((_FEWEST - count) / 3))
        raise InputError(
            f"{case.path}: [[recording]] role = 'fit': {count} numbers: too few for any conclusion, since registration "
            f"and stiffness alone take a dozen; {points} more tracked points, spread over the body, would do"
        )
