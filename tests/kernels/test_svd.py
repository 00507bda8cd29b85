"""The singular value decomposition that laws in principal stretches stand on."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from material_point import random_gradients, random_rotations

from warpbrain.kernels.module import Precision
from warpbrain.kernels.principal import singular_value_decomposition


@wp.kernel(enable_backward=False, module="warpbrain_test_svd")
def decompose(F: wp.array[Any], small: Any, U: wp.array[Any], l: wp.array[Any], V: wp.array[Any]):
    i = wp.tid()
    u, s, v = singular_value_decomposition(F[i], small)
    U[i] = u
    l[i] = s
    V[i] = v


def svd(F: np.ndarray, p: Precision, device: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = len(F)
    U, V = (wp.zeros(n, dtype=p.mat33, device=device) for _ in range(2))
    l = wp.zeros(n, dtype=p.vec3, device=device)
    small = p.scalar(p.epsilon**2)
    wp.launch(decompose, n, [wp.array(F, dtype=p.mat33, device=device), small, U, l, V], device=device)
    return U.numpy(), l.numpy(), V.numpy()


def with_stretches(stretches: list[tuple[float, float, float]]) -> np.ndarray:
    rotations = random_rotations(2 * len(stretches), seed=3).reshape(2, len(stretches), 3, 3)
    return rotations[0] @ (np.array(stretches)[:, :, None] * rotations[1])


GRADIENTS = {
    "random": random_gradients(500, 0.8),
    "identity": np.eye(3)[None],
    "rotations": random_rotations(50),
    # from 1e-14, below a rounding of single precision, to 1e-2
    "coincident": with_stretches([(1.1, 1.1 * (1.0 + d), 0.95) for d in (0.0, *10.0 ** np.arange(-14, -1))]),
    "three equal": with_stretches([(1.2, 1.2, 1.2), (0.3, 0.3, 0.3)]),
    "J near 0.01": with_stretches([(0.01, 1.0, 1.0), (0.1, 0.1, 1.0), (0.05, 0.2, 1.0), (0.2, 0.22, 0.23)]),
    "big": with_stretches([(10.0, 0.3, 0.2), (30.0, 30.0, 1e-3), (100.0, 1.0, 0.01), (5.0, 5.0, 5.0)]),
    "graded columns": with_stretches([(50.0, 1.0, 0.02)]) * np.array([1.0, 1e-2, 1e2]),
    "shear": np.array([[[1.0, k, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] for k in (1e-7, 0.1, 3.0, 30.0)]),
}


@pytest.mark.parametrize("name", GRADIENTS)
def test_decomposition(name: str, precision: Precision, device: str) -> None:
    F = GRADIENTS[name].astype(precision.numpy)
    U, l, V = svd(F, precision, device)
    # a dozen rotations, each a few roundings
    tolerance = 30.0 * precision.epsilon
    size = np.linalg.norm(F, axis=(1, 2))[:, None, None]
    eye = np.eye(3)
    np.testing.assert_array_less(np.abs((U * l[:, None, :]) @ V.transpose(0, 2, 1) - F) / size, tolerance)
    np.testing.assert_array_less(np.abs(V.transpose(0, 2, 1) @ V - eye), tolerance)
    assert np.all(l > 0.0)
    # both are rotations: F has a positive determinant and V is a product of rotations
    assert np.all(np.linalg.det(V) > 0.0)
    assert np.all(np.linalg.det(U) > 0.0)
    # columns of U are normalised columns of F V: orthogonal to a rounding times the ratio of the stretches they see
    np.testing.assert_array_less(np.abs(U.transpose(0, 2, 1) @ U - eye), 10.0 * tolerance)


@pytest.mark.parametrize("name", [n for n in GRADIENTS if n != "graded columns"])
def test_stretches(name: str, precision: Precision, device: str) -> None:
    F = GRADIENTS[name].astype(precision.numpy)
    _, l, _ = svd(F, precision, device)
    expected = np.linalg.svd(F.astype(np.longdouble).astype(float), compute_uv=False)
    # a rounding of F moves every stretch by up to the norm of F times a rounding
    size = expected.max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(np.sort(l, axis=1)[:, ::-1] - expected) / size, 30.0 * precision.epsilon)
