"""The one least-squares loop against normal equations, a search by function values, and where nothing stands."""

import numpy as np
import pytest
from scipy.optimize import minimize

from warpbrain.inference.least_squares import minimise

RANDOM = np.random.default_rng(3)
A, B = RANDOM.normal(size=(30, 4)), RANDOM.normal(size=30)
TIMES = np.linspace(0.0, 2.0, 12)


def decaying(z: np.ndarray) -> np.ndarray:
    """Rows of an amplitude and a rate with a standard normal prior; there is no rate below -1."""
    if z[1] < -1.0:
        raise ValueError("no such rate")
    return np.concatenate([50.0 * (z[0] * np.exp(-z[1] * TIMES) - 2.0 * np.exp(-1.3 * TIMES)), z])


def slopes(z: np.ndarray) -> np.ndarray:
    decay = np.exp(-z[1] * TIMES)
    return np.concatenate([50.0 * np.column_stack([decay, -z[0] * TIMES * decay]), np.eye(2)])


def test_a_linear_problem_is_solved_in_steps_that_are_told() -> None:
    steps = []
    z, left = minimise(lambda z: A @ z - B, lambda _z: A, np.zeros(4), 1e-6, on_step=lambda *step: steps.append(step))
    np.testing.assert_allclose(z, np.linalg.lstsq(A, B)[0], atol=1e-8)
    # the first is as long as the way is, in standard deviations of what is found
    assert left <= 1e-6 and steps[0][0] == pytest.approx(float(np.linalg.norm(A @ z)))
    assert all(0.0 < share < 1.0 + 1e-12 for _, share in steps)


@pytest.mark.parametrize("start", [[0.0, 0.0], [0.1, -0.99]])
def test_a_step_to_where_nothing_stands_is_shortened(start: list[float]) -> None:
    z, left = minimise(decaying, slopes, np.array(start), 1e-6, cannot_be=(ValueError,))
    expected = minimize(lambda z: 0.5 * np.sum(decaying(z) ** 2), [2.0, 1.3], method="Nelder-Mead", tol=1e-10).x
    assert left <= 1e-6
    np.testing.assert_allclose(z, expected, atol=1e-5)


def test_what_is_at_a_bound_stays_there() -> None:
    bounds = np.full(4, -np.inf), np.where(np.arange(4) == 1, np.linalg.lstsq(A, B)[0][1] - 0.1, np.inf)
    z, left = minimise(lambda z: A @ z - B, lambda _z: A, np.full(4, -1.0), 1e-6, bounds=bounds)
    others = np.arange(4) != 1
    assert z[1] == bounds[1][1] and left <= 1e-6
    np.testing.assert_allclose(z[others], np.linalg.lstsq(A[:, others], B - A[:, 1] * z[1])[0], atol=1e-7)
