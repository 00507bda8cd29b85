"""The one number that is printed of how far computed states are from recordings.

The root mean square of the 3-D distance over all recorded rows: every row counts once, with no weight, and none is set
aside. Of a tracked point it is the distance from where it was recorded, of a point of a surface the distance to the
computed surface. Forces and pressures are rows of their own units and stand apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats


def root_mean_square(residuals: ArrayLike) -> float:
    """`sqrt(mean |r|^2)` of residual vectors (n, d) or distances (n,), in their unit.

    Examples
    --------
    >>> root_mean_square([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]]) ** 2
    12.5
    """
    return float(np.sqrt(np.mean(lengths(residuals) ** 2)))


def lengths(residuals: ArrayLike) -> Floats:
    """`|r|` (n,) of residual vectors (n, d) or distances (n,); components that were not recorded are NaN."""
    values = np.asarray(residuals, dtype=np.float64)
    return np.sqrt(np.nansum(values**2, axis=1)) if values.ndim == 2 else np.abs(values)


def by_unit(each: Iterable[tuple[str, ArrayLike]]) -> Mapping[str, float]:
    """The root mean square over all rows of several recordings together, by their unit.

    `each`: unit, and residuals (n, d) or distances (n,) of each recording.

    Examples
    --------
    >>> by_unit([("m", [3.0]), ("m", [[0.0, 4.0, 0.0]]), ("N", [2.0])])["m"] ** 2
    12.5
    """
    rows: dict[str, list[Floats]] = {}
    for unit, residuals in each:
        rows.setdefault(unit, []).append(lengths(residuals))
    return {unit: root_mean_square(np.concatenate(some)) for unit, some in rows.items()}
