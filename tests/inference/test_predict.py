"""Held-out rows by conditioning, and null rates of a predictive check over draws of the model itself."""

import numpy as np
import pytest
from drawn_rows import draws
from scipy.stats import binom, multivariate_normal

from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.predict import FieldFactors, along_own_axes, predict, predictive_p

N = 24


@pytest.fixture(scope="module")
def model() -> GaussianModel:
    random = np.random.default_rng(0)
    factor = np.linalg.cholesky(np.diag(random.uniform(0.5, 1.5, N)) + 0.2)
    return GaussianModel(factor, random.normal(size=(N, 4)), 1.3)


def test_blocks_are_predicted_as_conditioning_says(model, verify):
    random = np.random.default_rng(1)
    residual, blocks = draws(model, 1, random)[:, 0], random.integers(5, size=N)
    prediction = predict(model, residual, blocks)
    worst, S = 0.0, model.covariance
    for number, block in enumerate(np.unique(blocks)):
        hidden = blocks == block
        gain = np.linalg.solve(S[np.ix_(~hidden, ~hidden)], S[np.ix_(~hidden, hidden)])
        mean, covariance = gain.T @ residual[~hidden], S[np.ix_(hidden, hidden)] - S[np.ix_(hidden, ~hidden)] @ gain
        density = multivariate_normal(mean, covariance).logpdf(residual[hidden])
        worst = max(worst, abs(density - prediction.log_densities[number]))
        worst = max(worst, np.abs(prediction.errors[hidden] - (residual[hidden] - mean)).max())
    verify("held-out rows by the precision matrix", "conditional normal distribution written out", worst, 1e-9)


def test_fields_are_weighed_as_their_densities(model):
    random = np.random.default_rng(2)
    residuals, sizes = draws(model, 3, random), np.array([0.3, 2.0])
    fields = [random.normal(size=(N, 5)), random.normal(size=(N, 2))]
    logs = [
        model.with_columns(size * field).log_density(residuals) - model.log_density(residuals)
        for field in fields
        for size in sizes
    ]
    expected = np.logaddexp.reduce(logs, axis=0) - np.log(len(logs))
    np.testing.assert_allclose(FieldFactors(model, fields, sizes).of(residuals), expected, atol=1e-9)


def test_the_null_rate_is_what_it_says(model, verify):
    random = np.random.default_rng(3)
    fields, sizes, cases = [random.normal(size=(N, 5))], np.array([0.5, 2.0]), 400
    drawn = draws(model, cases, random)
    alarms = sum(predictive_p(model, fields, sizes, row, 99, random) <= 0.05 for row in drawn.T)
    low, high = binom.interval(0.999, cases, 0.05)
    off = max(low - alarms, alarms - high, 0.0)
    verify("predictive p <= 0.05 where nothing is left", f"binomial band of {cases} draws of the model", off, 0.0)


@pytest.mark.parametrize("doubled", [False, True])
def test_random_draws_do_not_depend_on_axes_or_order(model, doubled):
    """Rows that are mixed by an orthogonal matrix, among them rows in another order, or each twice at twice the
    variance, and fields mixed likewise."""
    random = np.random.default_rng(4)
    fields, residual = [random.normal(size=(N, 5)), random.normal(size=(N, 2))], draws(model, 1, random)[:, 0]
    mixed = np.linalg.qr(random.normal(size=(N, N)))[0]
    covariance, columns = model.noise_factor @ model.noise_factor.T, model.columns
    others = [field @ np.linalg.qr(random.normal(size=(field.shape[1],) * 2))[0] for field in fields]
    if doubled:
        # each pair has the mean of its rows and a difference that tells nothing
        mixed = np.concatenate([mixed, mixed])
        lift = np.linalg.qr(mixed, mode="complete")[0][:, N:]
        noise = mixed @ covariance @ mixed.T + lift @ lift.T
    else:
        noise = mixed @ covariance @ mixed.T
    other = GaussianModel(np.linalg.cholesky(noise), mixed @ columns, model.scale)
    ps = [
        predictive_p(one, given, np.array([0.5, 2.0]), rows, 99, np.random.default_rng(5), levels=[0.5])
        for one, given, rows in (
            (model, fields, residual),
            (other, [mixed @ field for field in others], mixed @ residual),
        )
    ]
    assert ps[0] == ps[1]
    first, second = (
        along_own_axes(model, fields[0], residual),
        along_own_axes(other, mixed @ others[0], mixed @ residual),
    )
    np.testing.assert_allclose(mixed @ first, second, atol=1e-9)


def test_nothing_is_drawn_where_draws_cannot_say_less(model, monkeypatch):
    random = np.random.default_rng(6)
    fields, sizes = [random.normal(size=(N, 3))], np.array([1.0])
    row = draws(model, 1, random)[:, 0]

    def p_of(bound: float, random: np.random.Generator) -> float:
        return predictive_p(model, fields, sizes, row, 99, random, bound=bound)

    both = [np.random.default_rng(7) for _ in range(2)]
    alone = p_of(1.0, both[0])
    assert p_of(0.5 * alone, np.random.default_rng(7)) == 0.5 * alone < alone
    monkeypatch.setattr(FieldFactors, "of", None)
    assert p_of(1e-9, both[1]) == 1e-9
    # what is drawn next is the same
    monkeypatch.undo()
    assert p_of(1.0, both[0]) == p_of(1.0, both[1])
