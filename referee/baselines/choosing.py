"""Two ways to choose from a dictionary."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from referee.baselines.dictionary import Regression

Floats = NDArray[np.float64]

#: Candidates that stepwise regression takes at most, values of LASSO's penalty, and its sweeps.
_MOST, _PENALTIES, _SWEEPS = 3, 30, 200


def bic(y: Floats, columns: Floats) -> float:
    """Bayesian information criterion of least squares with unknown noise."""
    left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
    n = len(y)
    return n * float(np.log(left @ left / n)) + columns.shape[1] * float(np.log(n))


def stepwise(regression: Regression) -> str:
    """Add the candidate that lowers BIC most, until none does; the name of the first, empty if there is none."""
    columns, chosen = regression.nuisances, ""
    best = bic(regression.y, columns)
    for _ in range(_MOST):
        found = [bic(regression.y, np.hstack([columns, more])) for _, more in regression.candidates]
        k = int(np.argmin(found))
        if found[k] >= best:
            break
        best = found[k]
        name, more = regression.candidates[k]
        columns = np.hstack([columns, more])
        chosen = chosen or name
    return chosen


def lasso(regression: Regression) -> str:
    """LASSO on all candidates, the nuisances projected out, its penalty by BIC; the name that explains most.

    Empty if no column is kept.
    """
    basis = np.linalg.qr(regression.nuisances)[0]

    def rest(x: Floats) -> Floats:
        return x - basis @ (basis.T @ x)

    columns = rest(np.hstack([more for _, more in regression.candidates]))
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    names = [name for name, more in regression.candidates for _ in range(more.shape[1])]
    y = rest(regression.y)
    gram, right = columns.T @ columns, columns.T @ y
    beta, best, kept = np.zeros(len(names)), np.inf, np.zeros(len(names))
    n = len(y)
    for penalty in np.abs(right).max() * np.geomspace(1.0, 0.02, _PENALTIES):
        beta = _descend(gram, right, penalty, beta)
        left = y - columns @ beta
        criterion = n * float(np.log(left @ left / n)) + np.count_nonzero(beta) * float(np.log(n))
        if criterion < best:
            best, kept = criterion, beta.copy()
    if not kept.any():
        return ""
    weight = {name: sum(abs(b) for b, other in zip(kept, names, strict=True) if other == name) for name in set(names)}
    return max(sorted(weight), key=weight.__getitem__)


def _descend(gram: Floats, right: Floats, penalty: float, start: Floats) -> Floats:
    """Coordinate descent (Friedman, Hastie and Tibshirani 2010) on columns of unit length."""
    beta = start.copy()
    for _ in range(_SWEEPS):
        before = beta.copy()
        for k in range(len(beta)):
            z = right[k] - gram[k] @ beta + beta[k]
            beta[k] = np.sign(z) * max(abs(z) - penalty, 0.0)
        if np.abs(beta - before).max() < 1e-4 * np.abs(beta).max() + 1e-12:
            break
    return beta
