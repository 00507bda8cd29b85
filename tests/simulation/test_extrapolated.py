"""Where a state may be."""

import numpy as np

from warpbrain.simulation.multisecant import extrapolated


def test_what_is_linear_is_hit_within_a_few_percent() -> None:
    rng = np.random.default_rng(1)
    A = rng.normal(size=(12, 3))
    places = [np.zeros(3), *np.eye(3)]
    known = [(place, (A @ place).reshape(4, 3)) for place in places]
    at = np.array([0.4, -0.3, 0.5])
    exact = (A @ at).reshape(4, 3)
    assert np.linalg.norm(extrapolated(known, at) - exact) < 0.05 * np.linalg.norm(exact)


def test_one_that_is_known_is_itself() -> None:
    known = [(np.zeros(2), np.zeros(5)), (np.ones(2), np.arange(5.0))]
    assert np.array_equal(extrapolated(known, np.ones(2)), np.arange(5.0))
    assert np.array_equal(extrapolated(known[:1], np.ones(2)), np.zeros(5))


def test_states_close_together_are_not_stretched_far() -> None:
    """A small difference that points the wrong way by rounding must not be made a hundred times as large."""
    known = [(np.zeros(2), np.zeros(3)), (np.array([1e-3, 0.0]), np.ones(3))]
    assert np.abs(extrapolated(known, np.array([1.0, 0.0]))).max() < 1.2


def test_states_many_orders_apart_are_no_singular_system() -> None:
    known = [(np.zeros(2), np.zeros(3)), *((1e9 * np.array([1.0, k]), np.full(3, float(k))) for k in range(3))]
    assert np.isfinite(extrapolated(known, np.array([1e-9, 0.0]))).all()
