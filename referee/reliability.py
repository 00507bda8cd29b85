"""Whether stated probabilities are right as often as they say."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Bins of stated probability.
BINS = 5


def reliability(stated: NDArray[np.float64], right: NDArray[np.bool_]) -> dict[str, Any]:
    """Rows of a reliability diagram.

    Parameters
    ----------
    stated : (k,) array
        Probabilities.
    right : (k,) bool array

    Returns
    -------
    dict
        `ece`, the expected calibration error (None of nothing), and `rows` of (mean probability, share that is right,
        count).
    """
    if not len(stated):
        return {"ece": None, "rows": []}
    place = np.minimum((stated * BINS).astype(int), BINS - 1)
    rows = [
        [float(stated[place == k].mean()), float(right[place == k].mean()), int((place == k).sum())]
        for k in range(BINS)
        if (place == k).any()
    ]
    return {"ece": sum(abs(p - r) * n for p, r, n in rows) / len(stated), "rows": rows}
