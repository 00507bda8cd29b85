"""Dense factors on a GPU beside those on the host, and who gets none."""

import numpy as np
import pytest
import warp as wp
from scipy.sparse import csr_array, eye_array, random_array

from warpbrain.simulation.factors import SparseFactors
from warpbrain.worlds.body import factors as module
from warpbrain.worlds.body.factors import DenseFactors, Factors, dense_factors


def _matrix(n: int = 60):
    rng = np.random.default_rng(0)
    half = random_array((n, n), density=0.1, rng=rng).tocsr()
    return csr_array(half @ half.T + 3.0 * eye_array(n)), rng


def test_a_host_has_none():
    assert dense_factors(_matrix()[0], wp.get_device("cpu")) is None


def test_a_gpu_without_cupy_has_none(monkeypatch):
    class Device:
        is_cuda, ordinal = True, 0

    monkeypatch.setattr(module, "_cupy_works", lambda: False)
    assert dense_factors(_matrix()[0], Device()) is None


def test_they_answer_as_those_on_the_host(gpu, monkeypatch):
    # several blocks of columns
    monkeypatch.setattr(module, "_TOGETHER_ON_GPU", 32)
    matrix, rng = _matrix()
    ours, host = Factors(matrix, gpu), Factors(matrix)
    assert isinstance(ours._factors, DenseFactors) and isinstance(host._factors, SparseFactors)
    columns = rng.normal(size=(60, 75))
    found = ours.solve(columns)
    assert found.flags.f_contiguous
    np.testing.assert_allclose(found, host.solve(columns), rtol=1e-9, atol=1e-12)
    sparse = csr_array(np.where(rng.random((60, 40)) < 0.1, 1.0, 0.0))
    np.testing.assert_allclose(ours.solve(sparse), host.solve(sparse), rtol=1e-9, atol=1e-12)
    between, expected = (factors.solve(sparse, left=sparse.T) for factors in (ours, host))
    np.testing.assert_allclose(between, expected, rtol=1e-9, atol=1e-12)
    assert ours.solve(columns[:, :0]).shape == (60, 0)


def test_what_is_not_positive_definite_is_for_the_host(gpu):
    matrix = _matrix()[0] - 20.0 * eye_array(60)
    assert dense_factors(matrix, gpu) is None
    columns = np.eye(60)
    np.testing.assert_allclose(matrix @ Factors(matrix, gpu).solve(columns), columns, atol=1e-8)


def test_what_is_too_large_is_for_the_host(gpu, monkeypatch):
    monkeypatch.setattr(module, "_MATRICES", 10**12)
    assert dense_factors(_matrix()[0], gpu) is None
    with pytest.raises(MemoryError, match="GB"):
        DenseFactors(_matrix()[0], gpu)
