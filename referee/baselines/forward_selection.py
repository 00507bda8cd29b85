"""Forward selection by the Bayesian information criterion (Schwarz 1978)."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from referee.baselines.whitened import Whitened
from referee.challenge.answers import Answer
from referee.challenge.neutral import Floats

#: Candidates that are taken at most.
_MOST = 3


def bic(y: Floats, columns: Floats) -> float:
    """Bayesian information criterion of least squares with unknown noise."""
    left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0] if columns.size else y
    n = len(y)
    return n * float(np.log(left @ left / n)) + columns.shape[1] * float(np.log(n))


def forward_selection(problem: Whitened) -> Answer:
    """Add the candidate that lowers BIC most, until none does.

    The probability is that of each choice among all that could have been made in its step, by ``exp(-BIC / 2)``, of a
    cause the mean over its places.
    """
    groups = problem.groups
    y, columns = problem.y, problem.columns
    n, used, log_probability = len(y), 0, 0.0
    names: list[str] = []
    for _ in range(_MOST + 1):
        now = n * float(np.log(y @ y / n)) + used * float(np.log(n))
        criteria = np.array([_criterion(y, columns[:, own], used) for _, own in groups])
        logs = {"": -0.5 * now}
        for cause in sorted({cause for cause, _ in groups}):
            own = np.array([name == cause for name, _ in groups])
            logs[cause] = float(logsumexp(-0.5 * criteria[own]) - np.log(own.sum()))
        total = float(logsumexp(list(logs.values())))
        best = int(np.argmin(criteria))
        if criteria[best] >= now or len(names) == _MOST:
            log_probability += logs[""] - total if len(names) < _MOST else 0.0
            break
        cause, own = groups[best]
        log_probability += logs[cause] - total
        names.append(cause)
        # all that is left is what the chosen ones do not explain
        basis = _basis(columns[:, own])
        used += basis.shape[1]
        y, columns = y - basis @ (basis.T @ y), columns - basis @ (basis.T @ columns)
    distinct = tuple(dict.fromkeys(names))
    verdict = "named" if distinct else "nothing missing"
    return Answer(problem.name, verdict, distinct, float(np.exp(log_probability)))


def _criterion(y: Floats, columns: Floats, used: int) -> float:
    basis = _basis(columns)
    seen = basis.T @ y
    n = len(y)
    left = max(float(y @ y - seen @ seen), 1e-12)
    return n * float(np.log(left / n)) + (used + basis.shape[1]) * float(np.log(n))


def _basis(columns: Floats) -> Floats:
    """Orthonormal columns of the same span; none of columns that are gone."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-8]
