"""What is predicted of points that nothing was given of, beside the normal distribution that it should be."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpbrain.diagnosis.checking import Confirming, HeldOut, blocks_of, distance
from warpbrain.inference import GaussianModel
from warpbrain.inference.predict import p_value, predict, predict_with

N = 30


class Points(SimpleNamespace):
    """Rows of tracked points."""

    def __len__(self) -> int:
        return N


def sensors() -> Points:
    """Ten of them."""
    rng = np.random.default_rng(5)
    return Points(
        is_displacement=np.ones(N, dtype=bool),
        groups=np.repeat(np.arange(10), 3),
        positions=np.repeat(rng.normal(size=(10, 3)), 3, axis=0),
    )


def model(columns: np.ndarray) -> GaussianModel:
    return GaussianModel(np.diag(np.random.default_rng(0).uniform(0.5, 1.5, N)), columns, 1.4)


@pytest.mark.parametrize("local", [False, True])
def test_a_point_lies_in_one_block(local: bool) -> None:
    blocks = blocks_of(sensors(), local)
    assert all(len(set(blocks[3 * k : 3 * k + 3].tolist())) == 1 for k in range(10))


@pytest.mark.parametrize(("centres", "local"), [((), False), ((None,), False), ((0.0,), True), ((None, 0.0), True)])
def test_blocks_are_scattered_where_something_local_acts(centres: tuple[float | None, ...], local: bool) -> None:
    """Nobody can tell from other regions what one local cause does, whatever acts beside it."""
    effects = tuple(SimpleNamespace(proposed=SimpleNamespace(centre=centre)) for centre in centres)
    checks = SimpleNamespace(_held_out={True: "scattered", False: "regions"})
    blocks = Confirming.held_out_for(checks, SimpleNamespace(effects=effects))
    assert blocks == ("scattered" if local else "regions")


def test_a_block_is_as_probable_as_a_normal_distribution_says() -> None:
    rng = np.random.default_rng(1)
    given, residual = model(rng.normal(size=(N, 4))), rng.normal(size=N)
    blocks = blocks_of(sensors(), False)
    found = predict(given, residual, blocks)
    S = given.covariance
    for number, block in enumerate(np.unique(blocks)):
        own, rest = blocks == block, blocks != block
        toward = S[np.ix_(own, rest)] @ np.linalg.inv(S[np.ix_(rest, rest)])
        mean, spread = toward @ residual[rest], S[np.ix_(own, own)] - toward @ S[np.ix_(rest, own)]
        assert found.log_densities[number] == pytest.approx(multivariate_normal(mean, spread).logpdf(residual[own]))
        np.testing.assert_allclose(found.errors[own], residual[own] - mean)


def test_columns_beside_a_model_are_columns_of_it() -> None:
    rng = np.random.default_rng(2)
    given, more, residual = model(rng.normal(size=(N, 4))), rng.normal(size=(N, 3)), rng.normal(size=N)
    blocks = blocks_of(sensors(), True)
    [found] = predict_with(given, residual, blocks, [more])
    expected = predict(given.with_columns(more), residual, blocks)
    np.testing.assert_allclose(found.errors, expected.errors, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.log_densities, expected.log_densities, rtol=1e-9)


def test_patterns_that_mean_nothing_do_not_predict() -> None:
    rng = np.random.default_rng(3)
    truth, given = rng.normal(size=(N, 1)), model(np.zeros((N, 0)))
    residual = 5.0 * truth[:, 0] + given.noise_factor @ rng.normal(size=N)
    way = HeldOut(sensors(), True)
    own = predict(given.with_columns(5.0 * truth), residual, way.blocks)
    patterns = way.with_patterns(given, residual, rng.normal(size=(N, 8)), 1, 2, rng)
    assert p_value(own.log_density, [pattern.log_density for pattern in patterns]) < 0.02
    assert min(way.error(pattern) for pattern in patterns) > way.error(own)


def test_an_error_is_a_distance() -> None:
    errors = np.tile([3.0, 0.0, 4.0], 10)
    assert distance(sensors(), errors) == pytest.approx(5.0)
