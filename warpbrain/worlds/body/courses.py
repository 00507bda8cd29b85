"""Causes that change from one recorded time to the next: one cause, whose size is a smooth function of time.

The size is a Gaussian process over the recorded times, with a squared exponential covariance of a variance of one. Its
time is the rank of a recorded one: recordings are made as densely as things change. So it needs few modes, and a course
is found as the coefficients of these are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.physics.proposal import Proposal, Varying
from warpbrain.worlds.body.time_courses import finite_times


def modes_of(count: int) -> Floats:
    """Modes (m, r) of the process over m times, the largest first; their squares have the sum of the variances."""
    ranks = np.linspace(0.0, 1.0, count)
    covariance = np.exp(-0.5 * ((ranks[:, None] - ranks) / belief("courses.reach")) ** 2)
    variances, vectors = np.linalg.eigh(covariance)
    variances, vectors = np.maximum(variances[::-1], 0.0), vectors[:, ::-1]
    left = 1.0 - np.cumsum(variances) / variances.sum()
    kept = int(np.searchsorted(-left, -belief("courses.cut"))) + 1
    # the sign of an eigenvector is arbitrary
    signs = np.where(vectors[-1] < 0.0, -1.0, 1.0)
    return np.asarray((signs * vectors * np.sqrt(variances))[:, :kept])


def over_time(proposals: Sequence[Proposal], times: Sequence[float]) -> list[Proposal]:
    """Proposals, and with several times [s] those that may change from one to the next with a course, too."""
    constant = [proposal for proposal in proposals if not proposal.only_over_time]
    if len(times) < 2:
        return constant
    ends, modes = finite_times(np.array(times)), modes_of(len(times))
    return constant + [Varying(one, ends, modes).proposal() for one in proposals if one.varying]
