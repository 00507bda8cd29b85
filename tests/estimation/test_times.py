"""Estimates from recordings of several times under loads that change, and between two loaded states."""

from dataclasses import replace

import numpy as np
import pytest
from changing_block import block, falling, recorded
from synthetic import WHITE
from synthetic import block as layered

from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments, recorded_times
from warpbrain.estimation.estimate import Estimation
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.likelihood import Likelihood
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.parameters import Gaussian, PriorMode
from warpbrain.estimation.problem import Nuisances, Problem
from warpbrain.gp.prior import Prior
from warpbrain.gp.trained import trained

THETA = np.log([1150.0])
_TIMES = (10.0, 80.0)


@pytest.fixture(scope="module")
def truth() -> Case:
    tissues = layered({"brain": WHITE}, "pushed").tissues
    return replace(block(4, falling(_TIMES, (0.05, 0.0))), tissues=tissues)


@pytest.fixture(scope="module")
def case(truth: Case) -> Case:
    """Points at two times, and points counted from the first; one of a time that is not fitted."""
    both = recorded(truth, _TIMES, 8, noise=0.0)
    between = recorded(truth, (80.0,), 8, name="between", reference=10.0, noise=0.0, seed=3)
    unseen = recorded(truth, (45.0,), 8, name="unseen", role="check", noise=0.0, seed=4)
    return replace(truth, recordings=(both, between, unseen))


def test_derivatives_over_times_are_differences(case: Case, verify) -> None:
    moments = Moments.of(case, recorded_times(case, ("fit",)))
    assert len(moments.cases) == 2
    forward = Forward(case, THETA, "cpu", moments=moments)
    mode = PriorMode(1.0, Gaussian(THETA, np.eye(1)), np.full(1, -np.inf), np.full(1, np.inf))
    problem = Problem(forward, Observations.to_fit(case, moments), mode, Likelihood(), Nuisances())
    state = forward.solve(THETA)
    rows = problem.seen(state, np.zeros(0))
    [column] = problem.columns(rows, THETA, np.zeros(0), forward.differentiate(state)).T
    sides = [problem.seen(forward.solve(THETA + step), np.zeros(0)).residual for step in (1e-3, -1e-3)]
    difference = -(sides[0] - sides[1]) / 2e-3
    verify(
        "derivative by stiffness of displacements at two times, and of displacements between these, under a weight "
        "that changes",
        "central difference of equilibria",
        float(np.linalg.norm(column - difference) / np.linalg.norm(difference)),
        2e-5,
    )
    assert np.abs(problem.seen(forward.solve(np.log([WHITE.mu])), np.zeros(0)).residual).max() < 1e-8


def test_tissue_is_found_and_unseen_times_are_predicted(case: Case, verify) -> None:
    prior = Prior.of(trained(), ("hyperelastic/brain",), (WHITE.name,), count=150)
    options = EstimationOptions(discretisation=None, registration=False, samples=40)
    posterior = Estimation(case, prior, options, "cpu").run()
    verify(
        "shear modulus from displacements at two times and between them under a level that falls",
        "modulus with which they were made, without noise",
        abs(float(np.exp(posterior.theta[0])) / WHITE.mu - 1.0),
        1e-2,
    )
    by_name = {one.name: one for one in posterior.predictions}
    assert by_name["beads"].fitted.count == 16 and by_name["between"].fitted.count == 8
    for name, one in by_name.items():
        # 45 s is no time that was fitted
        assert one.error_after < 0.02 * one.error_before, name
