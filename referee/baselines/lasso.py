"""LASSO (Tibshirani 1996) by least-angle regression, its penalty by BIC, with scikit-learn."""

from __future__ import annotations

import warnings

import numpy as np

from referee.baselines.shares import named, weights
from referee.baselines.whitened import Whitened
from referee.challenge.answers import Answer
from referee.challenge.neutral import Floats, Ints

#: Halves of the rows that say how stable the names are (Meinshausen and Buehlmann 2010).
_HALVES = 20


def lasso(problem: Whitened) -> Answer:
    """What LASSO keeps; the probability is how often halves of the rows give the same names."""
    columns = problem.columns / np.linalg.norm(problem.columns, axis=0)
    names = _named(problem, columns, np.arange(len(problem.y)))
    random = np.random.default_rng(0)
    halves = (random.permutation(len(problem.y))[: len(problem.y) // 2] for _ in range(_HALVES))
    same = np.mean([set(_named(problem, columns, rows)) == set(names) for rows in halves])
    return Answer(problem.name, "named" if names else "nothing missing", names, float(same))


def _named(problem: Whitened, columns: Floats, rows: Ints) -> tuple[str, ...]:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import LassoLarsIC

    y = problem.y[rows]
    # of unit noise, by what half the rows are below: some rows have gross errors
    variance = float(np.median(y**2) / 0.455)
    with warnings.catch_warnings():
        # columns that are all but the same are left out of the path, which is what is wanted
        warnings.simplefilter("ignore", ConvergenceWarning)
        model = LassoLarsIC(criterion="bic", noise_variance=variance, fit_intercept=False, max_iter=60)
        amounts = model.fit(columns[rows], y).coef_
    return named(weights(amounts, problem.causes))
