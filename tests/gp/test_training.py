"""Training of the coregionalised process: what it finds, and what it says of the way."""

from itertools import pairwise

import numpy as np
import pytest
from published_process import OBJECTIVE
from scipy.stats import chi2

from warpbrain.errors import SolveError
from warpbrain.gp.coregionalised import JITTER, TASKS, Likelihood, Parameters, Replicates, climb, start, train
from warpbrain.gp.trained import trained


@pytest.fixture(scope="module")
def drawn():
    """Three groups drawn from a known process: two share a curve, the third goes its own way."""
    random = np.random.default_rng(4)
    x = np.repeat(np.linspace(0.8, 1.2, 30), 4)
    task = np.repeat([0, 4, 10], len(x))
    stretch = np.tile(x, 3)
    w, kappa, noise = np.ones(TASKS), np.full(TASKS, 0.1), np.full(TASKS, 0.01)
    w[10], kappa[10] = 1e-3, 4.0
    parameters = Parameters(0.2, 3.0 * w, kappa, noise)
    r = np.sqrt(3.0) * np.abs(stretch[:, None] - stretch) / 0.2
    K = parameters.coregionalisation[np.ix_(task, task)] * (1 + r) * np.exp(-r)
    y = np.linalg.cholesky(K + 1e-10 * np.eye(len(K))) @ random.normal(size=len(K)) + 0.1 * random.normal(size=len(K))
    return Replicates.of(task, stretch, y), parameters


def test_it_ends_at_least_as_well_as_the_truth_and_without_a_slope(drawn):
    data, truth = drawn
    told = []
    training = train(data, step=2, progress=lambda part, said: told.append(part))
    best = training.best
    assert best.converged and best.value < Likelihood(data).value(truth)
    assert best.gain < 1e-2 and 1.0 < best.condition < 1e12
    # what a whole step of scoring would still gain is less than the last step did
    _, gradient, information = Likelihood(data, jitter=JITTER).value_gradient_and_information(best.parameters)
    known = np.diag(information) > 1e-6
    step = np.linalg.solve(information[np.ix_(known, known)], gradient[known])
    assert 0.5 * gradient[known] @ step < 1e-2
    # three replicates of each of 30 stretches are free of every curve: beyond this band once in 333 for three groups
    low, high = chi2.interval(0.999, 90) / np.array(90.0)
    assert np.all((low < best.parameters.noise[[0, 4, 10]] / 0.01) & (best.parameters.noise[[0, 4, 10]] / 0.01 < high))
    assert {one.apart for one in training.starts} == {None, 0, 4, 10}
    values = [one.climb.value for one in training.starts]
    assert values == sorted(values)
    assert told == sorted(told) and told[0] >= 0.0 and told[-1] <= 1.0


def test_a_climb_goes_down_only(drawn):
    data, _ = drawn
    values = []
    climb(Likelihood(data, jitter=1e-8), start(data), 1e-2, 50, lambda iteration, value: values.append(value))
    assert all(after <= before for before, after in pairwise(values))


def test_that_nothing_can_be_factored_is_said(monkeypatch):
    monkeypatch.setattr("warpbrain.gp.coregionalised.JITTER", -1.0)
    x = np.linspace(0.9, 1.1, 50)
    data = Replicates.of(np.zeros(50, dtype=int), x, np.zeros(50))
    with pytest.raises(SolveError, match="not positive definite in double precision"):
        train(data, "squared-exponential")


def test_the_shipped_process_is_at_least_as_likely_as_the_published_one():
    model = trained("coregionalised", "as_published")
    data, factored = model._seen
    assert data.count.sum() == 7300 and model.jitter == 1e-8
    value = Likelihood(data, jitter=model.jitter).value(model.parameters)
    assert value < OBJECTIVE
    assert value == pytest.approx(7091.63, abs=0.1)
    assert 1e14 < factored.condition < 1e16


@pytest.mark.slow(25)
def test_training_from_scratch_reaches_the_published_likelihood():
    data, _ = trained("coregionalised", "as_published")._seen
    assert train(data).best.value < OBJECTIVE
