"""The relevance vector machine (Tipping 2001): automatic relevance determination, with scikit-learn."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from referee.baselines.shares import named, weights
from referee.baselines.whitened import Whitened
from referee.challenge.answers import Answer

#: A cause whose amounts are zero with a probability above this, over all candidates, is not relevant.
_LEVEL = 0.05
#: Columns that go with the residual most, among which is chosen (sure independence screening, Fan and Lv 2008).
_SCREENED = 100


def relevance_vector(problem: Whitened) -> Answer:
    """Causes that are kept and whose amounts are not zero; the probability is that of the least of them.

    It is one less the tail of chi-square of the amounts by their covariance, times how many candidates there are
    (Bonferroni).
    """
    from sklearn.linear_model import ARDRegression

    columns = problem.columns / np.linalg.norm(problem.columns, axis=0)
    screened = np.sort(np.argsort(-np.abs(columns.T @ problem.y))[:_SCREENED])
    columns, causes = columns[:, screened], problem.causes[screened]
    model = ARDRegression(fit_intercept=False, max_iter=30, threshold_lambda=1e3).fit(columns, problem.y)
    kept = np.flatnonzero(model.lambda_ < model.threshold_lambda)
    if not len(kept):
        return Answer(problem.name, "nothing missing")
    count = len(np.unique(problem.candidates))
    tails = {}
    for cause in np.unique(causes[kept]):
        own = causes[kept] == cause
        amounts = model.coef_[kept[own]]
        square = float(amounts @ np.linalg.solve(model.sigma_[np.ix_(own, own)], amounts))
        tails[str(cause)] = min(1.0, count * float(chi2.sf(square, own.sum())))
    relevant = np.isin(causes, [cause for cause, tail in tails.items() if tail < _LEVEL])
    names = named(weights(np.where(relevant, model.coef_, 0.0), causes))
    if not names:
        return Answer(problem.name, "nothing missing", (), min(tails.values()))
    return Answer(problem.name, "named", names, 1.0 - max(tails[name] for name in names))
