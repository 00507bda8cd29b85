"""Powers of stretches against mpmath."""

from typing import Any

import mpmath as mp
import numpy as np
import pytest
import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.physics.laws.ogden import expm1_ratio, power_minus_one, power_quotient

ALPHAS = (-20.0, -11.92, -4.7, -2.0, -1.0, 1.0, 2.0, 8.0, 25.0)
DELTAS = (0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4, 1e-2, 0.3, -1e-10, -0.3)


@wp.kernel(enable_backward=False, module="warpbrain_test_powers")
def evaluate(
    a: wp.array[Any], b: wp.array[Any], n: wp.array[Any],
    ratio: wp.array[Any], minus_one: wp.array[Any], quotient: wp.array[Any],
):  # fmt: skip
    i = wp.tid()
    ratio[i] = expm1_ratio(a[i])
    minus_one[i] = power_minus_one(a[i], n[i])
    quotient[i] = power_quotient(a[i], b[i], n[i])


def run(a: np.ndarray, b: np.ndarray, n: np.ndarray, p: Precision, device: str) -> list[np.ndarray]:
    inputs = [wp.array(v, dtype=p.scalar, device=device) for v in (a, b, n)]
    outputs = [wp.zeros(len(a), dtype=p.scalar, device=device) for _ in range(3)]
    wp.launch(evaluate, len(a), [*inputs, *outputs], device=device)
    return [v.numpy().astype(float) for v in outputs]


def cases(p: Precision) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    grid = [(np.log(l * (1.0 + d)), np.log(l), n) for l in (0.4, 0.95, 1.0, 1.3) for d in DELTAS for n in ALPHAS]
    return tuple(np.array(grid).astype(p.numpy).T)


def test_expm1_ratio(precision: Precision, device: str) -> None:
    x = np.r_[0.0, np.logspace(-30, 1.3, 200), -np.logspace(-30, 1.3, 200), 0.5, -0.5, np.nextafter(0.5, 1)]
    x = x.astype(precision.numpy)
    ratio, _, _ = run(x, x, x, precision, device)
    with mp.workdps(50):
        expected = np.array([float(mp.expm1(v) / v) if v else 1.0 for v in map(mp.mpf, x.tolist())])
    # at |x| = 1/2 one bit is lost to the subtraction of 1; in single precision exp() itself may err by two roundings
    np.testing.assert_allclose(ratio, expected, rtol=8.0 * precision.epsilon)


def test_power_minus_one(precision: Precision, device: str) -> None:
    a, b, n = cases(precision)
    _, minus_one, _ = run(a, b, n, precision, device)
    with mp.workdps(50):
        x = [mp.mpf(float(u)) * mp.mpf(float(v)) for u, v in zip(a, n, strict=True)]
        expected = np.array([float(mp.expm1(v)) for v in x])
    # exp turns a rounding of its argument x into a relative error of |x| roundings
    allowed = precision.epsilon * (8.0 + np.abs(a * n)) * np.abs(expected)
    np.testing.assert_array_less(np.abs(minus_one - expected), allowed + 1e-300)


def test_power_quotient(precision: Precision, device: str) -> None:
    a, b, n = cases(precision)
    _, _, quotient = run(a, b, n, precision, device)

    def exact(log_a: mp.mpf, log_b: mp.mpf, n: mp.mpf) -> mp.mpf:
        if log_a == log_b:
            return n * mp.exp((n - 1) * log_b)
        return (mp.exp(n * log_a) - mp.exp(n * log_b)) / (mp.exp(log_a) - mp.exp(log_b))

    with mp.workdps(80):
        expected = np.array([float(exact(*(mp.mpf(float(v)) for v in row))) for row in zip(a, b, n, strict=True)])
    allowed = precision.epsilon * (16.0 + np.abs(n) * (np.abs(a) + 2.0 * np.abs(b))) * np.abs(expected)
    np.testing.assert_array_less(np.abs(quotient - expected), allowed)


@pytest.mark.parametrize("n", ALPHAS)
def test_quotient_is_symmetric(n: float, precision: Precision, device: str) -> None:
    a = np.log([0.8, 1.0, 1.1]).astype(precision.numpy)
    b = np.log([1.2, 1.0 + 1e-9, 1.1]).astype(precision.numpy)
    N = np.full(3, n, dtype=precision.numpy)
    forth, back = run(a, b, N, precision, device)[2], run(b, a, N, precision, device)[2]
    np.testing.assert_allclose(forth, back, rtol=(16.0 + abs(n)) * precision.epsilon)
