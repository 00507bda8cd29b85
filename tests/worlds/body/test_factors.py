"""Factors: equilibria that do not depend on the number of threads."""

import numpy as np
import pytest
from scipy.sparse import csr_array, random_array

from warpbrain.errors import SolveError
from warpbrain.worlds.body.factors import Factors


def _matrix(n: int = 60):
    rng = np.random.default_rng(0)
    half = random_array((n, n), density=0.1, rng=rng).tocsr()
    return (half @ half.T + 3.0 * np.eye(n)), rng


def test_equilibria_are_the_same_in_any_number_of_threads(monkeypatch):
    dense, rng = _matrix()
    factors = Factors(csr_array(dense))
    columns = rng.normal(size=(60, 75))
    found = []
    for count in ("1", "2", "5"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        found.append(factors.solve(columns))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_allclose(found[0], np.linalg.solve(dense, columns), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(factors.solve(csr_array(columns)), found[0])
    between = factors.solve(csr_array(columns), left=csr_array(columns.T))
    np.testing.assert_allclose(between, columns.T @ found[0], rtol=1e-9, atol=1e-9)
    assert factors.solve(columns[:, :0]).shape == (60, 0)


def test_a_singular_matrix_is_said():
    with pytest.raises(SolveError, match="unstable"):
        Factors(csr_array(np.ones((3, 3))))


@pytest.mark.parametrize("transposed", [False, True])
def test_a_skew_part_of_few_rows(transposed):
    dense, rng = _matrix()
    skew = np.zeros((60, 60))
    some = rng.choice(60, 9, replace=False)
    half = rng.normal(size=(9, 9))
    skew[np.ix_(some, some)] = half - half.T
    columns = rng.normal(size=(60, 300))
    factors = Factors(csr_array(dense), skew=csr_array(skew))
    A = dense - skew if transposed else dense + skew
    np.testing.assert_allclose(A @ factors.solve(columns, transposed), columns, atol=1e-10)
    between = factors.solve(csr_array(columns), left=csr_array(columns.T))
    np.testing.assert_allclose(between, columns.T @ np.linalg.solve(dense + skew, columns), atol=1e-8)
