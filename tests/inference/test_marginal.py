"""Evidence with gross errors and an unknown scale, against the sum over scales written out."""

import numpy as np
import pytest
from drawn_rows import draws
from scipy.special import logsumexp

from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import with_gross_errors
from warpbrain.inference.marginal import Marginal, RowsAtScales, marginal_of
from warpbrain.inference.noise import outliers, scales

N = 30
POINTS = tuple(np.arange(3 * k, 3 * k + 3) for k in range(N // 3))


def drawn(random: np.random.Generator, bad: tuple[int, ...]) -> tuple[GaussianModel, np.ndarray]:
    model = GaussianModel(np.diag(random.uniform(0.5, 1.5, N)), random.normal(size=(N, 3)))
    residual = draws(model, 1, random)[:, 0]
    for point in bad:
        residual[POINTS[point]] += 12.0
    return model, residual


def marginal(model: GaussianModel, residual: np.ndarray, scale: float = 1.0) -> Marginal:
    return marginal_of(model, POINTS, RowsAtScales(model, residual, POINTS).summed(scale=scale))


def test_evidence_is_the_sum_over_scales():
    model, residual = drawn(np.random.default_rng(0), (4,))
    values, log_prior = scales()
    logs = [
        with_gross_errors(model.with_scale(scale), residual, POINTS, outliers()).log_density + prior
        for scale, prior in zip(values.tolist(), log_prior.tolist(), strict=True)
    ]
    for near in (0.7, 1.0, 3.0):
        assert abs(marginal(model, residual, near).log_evidence - np.logaddexp.reduce(logs)) < 2e-3


def test_gross_errors_are_louder_in_its_noise():
    model, residual = drawn(np.random.default_rng(1), (2, 7))
    found = marginal(model, residual)
    assert np.flatnonzero(found.gross).tolist() == [2, 7]
    own = found.scale**2 * model.noise_factor @ model.noise_factor.T
    louder = np.diag(found.noise.noise_factor @ found.noise.noise_factor.T) / np.diag(own)
    bad = np.isin(np.arange(N), np.concatenate([POINTS[2], POINTS[7]]))
    assert set(np.round(louder[bad], 6)) <= set(outliers().inflations[1:] ** 2)
    np.testing.assert_allclose(louder[~bad], 1.0)


def test_coordinates_are_of_the_columns_of_the_hypothesis():
    model, residual = drawn(np.random.default_rng(2), (0,))
    found = marginal(model, residual)
    same = GaussianModel(found.noise.noise_factor, model.columns)
    np.testing.assert_allclose(found.coordinates(residual), same.coefficients(residual)[0], atol=1e-9)


@pytest.mark.parametrize("wrong", [0.7, 1.0, 2.1])
@pytest.mark.parametrize("begun", [0.65, 3.2])
def test_scales_that_are_left_out_are_next_to_nothing_of_the_sum(wrong: float, begun: float) -> None:
    """Of 150 points with a noise that is larger or smaller than declared, five of which are gross errors."""
    random = np.random.default_rng(12)
    columns, count = random.normal(size=(450, 30)), 150
    residual = wrong * random.normal(size=450) + columns @ random.normal(size=30)
    residual[:15] *= 20.0
    points = [np.arange(3 * k, 3 * k + 3) for k in range(count)]
    rows = RowsAtScales(GaussianModel(np.eye(450), columns[:, :20]), residual, points, columns[:, 20:])
    values, log_prior = scales()
    logs = [rows.with_gross_errors(value).log_density for value in values.tolist()] + log_prior
    summed = rows.summed(scale=begun)
    assert summed.log_evidence == pytest.approx(logsumexp(logs), abs=2e-3)
    assert summed.scale == values[np.argmax(logs)]
