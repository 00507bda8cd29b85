"""Sparse factors, in a fork of a process that has made some, too."""

import os
import time

import numpy as np
import pytest
from scipy.sparse import csr_array

from warpbrain.simulation.factors import SparseFactors


def _matrix(n: int = 400):
    rng = np.random.default_rng(0)
    A = np.diag(np.full(n, 4.0)) + np.diag(np.full(n - 1, -1.0), 1) + np.diag(np.full(n - 1, -1.0), -1)
    return csr_array(A), rng.normal(size=(n, 3))


def test_solutions_of_one_side_and_of_several():
    A, b = _matrix()
    factors = SparseFactors(A)
    np.testing.assert_allclose(A @ factors.solve(b), b, atol=1e-12)
    np.testing.assert_allclose(A @ factors.solve(b[:, 0]), b[:, 0], atol=1e-12)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_in_a_fork():
    A, b = _matrix()
    SparseFactors(A)
    process = os.fork()
    if process == 0:
        factors = SparseFactors(A)
        right = np.abs(A @ factors.solve(b) - b).max() < 1e-12
        os._exit(0 if right else 1)
    end = time.monotonic() + 30.0
    while (ended := os.waitpid(process, os.WNOHANG))[0] == 0:
        if time.monotonic() > end:
            os.kill(process, 9)
        time.sleep(0.02)
    assert ended[1] == 0
