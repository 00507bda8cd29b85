"""The noise of rows against its definition written out, row by row."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from warpbrain.inference.beliefs import belief
from warpbrain.inference.noise import log_scale_density, noise_covariance, noise_factor, outliers, scales

#: Of the body [m].
RADIUS = 0.065


def rows(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Three components of four points at the end, one of two points of a surface before, and a force."""
    positions = np.concatenate([np.repeat(random.uniform(0.0, 0.04, (4, 3)), 3, axis=0), np.full((3, 3), np.nan)])
    positions[12:14] = positions[[0, 3]] + 0.002
    slanted = random.normal(size=(2, 3))
    slanted /= np.linalg.norm(slanted, axis=1)[:, None]
    directions = np.concatenate([np.tile(np.eye(3), (4, 1)), slanted, np.zeros((1, 3))])
    times = np.array([math.inf] * 12 + [5.0, 5.0, math.inf])
    sigma = np.concatenate([random.uniform(2e-4, 2e-3, 14), [0.05]])
    return positions, directions, times, sigma


def test_covariance_is_its_definition() -> None:
    positions, directions, times, sigma = rows(np.random.default_rng(0))
    expected = np.zeros((15, 15))
    for i in range(15):
        for j in range(15):
            if i == j:
                expected[i, i] += sigma[i] ** 2
            if times[i] == times[j] and i < 14 and j < 14:
                apart = math.dist(positions[i], positions[j])
                alike = (
                    0.45**2 * math.exp(-0.5 * (apart / (0.277 * RADIUS)) ** 2) * float(directions[i] @ directions[j])
                )
                expected[i, j] += sigma[i] * sigma[j] * alike
    found = noise_covariance(positions, directions, times, sigma, RADIUS)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-20)
    factor = noise_factor(found, sigma)
    np.testing.assert_allclose(factor @ factor.T, expected, rtol=1e-12, atol=1e-20)
    np.testing.assert_array_equal(factor, np.tril(factor))


def test_covariance_turns_with_the_body() -> None:
    """Rotated and shifted recordings have the same covariance: it knows no axes."""
    positions, directions, times, sigma = rows(np.random.default_rng(1))
    rotation = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turned = noise_covariance(positions @ rotation.T + 0.1, directions @ rotation.T, times, sigma, RADIUS)
    np.testing.assert_allclose(
        turned, noise_covariance(positions, directions, times, sigma, RADIUS), rtol=1e-9, atol=1e-20
    )


def test_scale_is_a_distribution() -> None:
    total, _ = integrate.quad(
        lambda x: math.exp(float(log_scale_density(np.array(math.exp(x))))), -20.0, 20.0, limit=200
    )
    assert total == pytest.approx(1.0, abs=1e-3)
    at = np.array([0.2, 1.0, 3.0])
    np.testing.assert_allclose(log_scale_density(at), stats.t.logpdf(np.log(at), 3.0, scale=0.2), rtol=1e-12)
    values, logs = scales()
    assert np.exp(logs).sum() == pytest.approx(1.0)
    assert values[np.argmax(logs)] == 1.0


def test_gross_errors_are_as_believed() -> None:
    assert outliers().probability == belief("noise.gross_share") == 0.03
    assert outliers().inflation == belief("noise.gross_times")
