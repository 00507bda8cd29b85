"""A Gaussian-process discrepancy (Kennedy and O'Hagan 2001) beside each cause: ``y = G a + delta(x) + e``.

The discrepancy is a field of displacement of independent components with a squared-exponential covariance; there may be
none. Its length and size, the place and the amount of a cause are averaged over. It alone is the unknown.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from referee.baselines.whitened import Whitened
from referee.challenge.answers import Answer
from referee.challenge.neutral import Floats

#: Lengths [m] and sizes [m] of the discrepancy, and how much a cause stands out.
LENGTHS, SIZES, STANDS_OUT = (0.01, 0.02, 0.04, 0.08), (0.1e-3, 0.3e-3, 1e-3), (3.0, 8.0, 24.0)
#: Shares of nothing and of what has no name, as docs/referee.md publishes them; causes have the rest.
NOTHING, UNKNOWN = 0.25, 0.05
#: A name or a group is given from this probability on, and no group of more.
_SURE, _GROUP = 0.8, 3


def discrepancy(problem: Whitened) -> Answer:
    """The verdict by the posterior over nothing, the discrepancy alone and each cause."""
    posterior = probabilities(problem)
    nothing, unknown = posterior.pop(""), posterior.pop("unknown")
    ordered = sorted(posterior, key=lambda cause: (-posterior[cause], cause))
    if nothing >= max(unknown, sum(posterior.values())):
        return Answer(problem.name, "nothing missing", (), nothing)
    if unknown >= sum(posterior.values()):
        return Answer(problem.name, "unknown", (), unknown)
    total = 0.0
    for count, cause in enumerate(ordered[:_GROUP], start=1):
        total += posterior[cause]
        if total >= _SURE:
            return Answer(problem.name, "named" if count == 1 else "group", tuple(ordered[:count]), total)
    return Answer(problem.name, "cannot say")


def probabilities(problem: Whitened) -> dict[str, float]:
    """Posterior of nothing (""), "unknown" and each cause."""
    groups = problem.groups
    causes = sorted({cause for cause, _ in groups})
    of = {cause: [k for k, (name, _) in enumerate(groups) if name == cause] for cause in causes}
    fields = list(_discrepancies(problem))
    # beside a cause it is as rare as alone
    prior = np.log([1.0 - UNKNOWN, *np.full(len(fields) - 1, UNKNOWN / (len(fields) - 1))])
    alone, each = [], []
    for base, y, columns in fields:
        alone.append(base)
        logs = np.array([_cause(y, columns[:, own]) for _, own in groups])
        each.append([base + float(logsumexp(logs[of[cause]]) - np.log(len(of[cause]))) for cause in causes])
    log_weights = {
        "": alone[0] + np.log(NOTHING),
        "unknown": float(logsumexp(np.array(alone[1:]) - np.log(len(fields) - 1))) + np.log(UNKNOWN),
    }
    share = np.log((1.0 - NOTHING - UNKNOWN) / len(causes))
    for k, cause in enumerate(causes):
        log_weights[cause] = float(logsumexp(np.array([row[k] for row in each]) + prior)) + share
    total = float(logsumexp(list(log_weights.values())))
    return {name: float(np.exp(log - total)) for name, log in log_weights.items()}


def _discrepancies(problem: Whitened) -> Iterator[tuple[float, Floats, Floats]]:
    """Log density of no cause, residual and columns, in units of noise and a discrepancy; the first has none."""
    yield -0.5 * float(problem.y @ problem.y), problem.y, problem.columns
    case = problem.case
    moves = case.sensor_kind != "force"
    apart = np.linalg.norm(case.sensor_place[:, None] - case.sensor_place[None], axis=2)
    aligned = (case.sensor_direction @ case.sensor_direction.T) * np.outer(moves, moves)
    both = np.column_stack([problem.y, problem.columns])
    for length in LENGTHS:
        near = aligned * np.exp(-0.5 * (apart / length) ** 2)
        inner = solve_triangular(problem.lower, solve_triangular(problem.lower, near, lower=True).T, lower=True)
        for size in SIZES:
            lower = np.linalg.cholesky(np.eye(len(inner)) + size**2 * inner)
            seen = solve_triangular(lower, both, lower=True)
            log = -0.5 * float(seen[:, 0] @ seen[:, 0]) - float(np.log(np.diag(lower)).sum())
            yield log, seen[:, 0], seen[:, 1:]


def _cause(y: Floats, columns: Floats) -> float:
    """Log evidence of a candidate against none, averaged over how much it stands out."""
    values, axes = np.linalg.eigh(columns.T @ columns)
    values = np.maximum(values, 0.0)
    seen = (axes.T @ (columns.T @ y)) ** 2
    scale = max(float(values.mean()), 1e-300)
    logs = []
    for stands in STANDS_OUT:
        variance = stands**2 / (scale * len(values))
        logs.append(float(0.5 * (seen * variance / (1.0 + variance * values) - np.log1p(variance * values)).sum()))
    return float(logsumexp(logs) - np.log(len(logs)))
