"""Factors: against dense solutions, whatever is held, and the same in any number of threads."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from shapes import cube, distorted

from warpbrain.diagnosis.dissection import dissected
from warpbrain.diagnosis.factors import Factors
from warpbrain.diagnosis.multifrontal import Cholesky
from warpbrain.errors import SolveError

MESH = distorted(cube(6), 0.02)


def graph_of(mesh) -> np.ndarray:
    touching = np.zeros((len(mesh.points),) * 2)
    for nodes in mesh.tetrahedra:
        touching[np.ix_(nodes, nodes)] = 1.0
    return touching


def stiffness(definite: bool = True):
    """A matrix of chance on the edges of a mesh, some components of which are held, and where its rows are."""
    rng = np.random.default_rng(0)
    touching = np.kron(graph_of(MESH), np.ones((3, 3)))
    matrix = touching * rng.normal(size=touching.shape)
    matrix += matrix.T
    if definite:
        matrix += np.diag(np.abs(matrix).sum(axis=1))
    free = rng.random(len(matrix)) > 0.2
    return matrix[free][:, free], np.repeat(MESH.points, 3, axis=0)[free]


def test_every_node_is_eliminated_once_and_reaches_what_is_left():
    touching = graph_of(MESH)
    fronts = dissected(csr_array(touching), MESH.points)
    assert len(fronts) > 5
    order = np.concatenate([front.own for front in fronts])
    assert sorted(order.tolist()) == list(range(len(MESH.points)))
    # elimination by hand: who is left and touches the front becomes a clique
    left, done = touching[np.ix_(order, order)] > 0.0, 0
    for front in fronts:
        begin, done = done, done + len(front.own)
        reached = done + np.flatnonzero(left[begin:done, done:].any(axis=0))
        np.testing.assert_array_equal(front.reached, reached)
        left[np.ix_(reached, reached)] = True


def test_solutions_are_those_of_a_dense_solver():
    matrix, places = stiffness()
    columns = np.random.default_rng(1).normal(size=(len(matrix), 7))
    expected = np.linalg.solve(matrix, columns)
    np.testing.assert_allclose(Cholesky(csr_array(matrix), places).solve(columns), expected, rtol=1e-10, atol=1e-13)
    # places decide how much is to do, not what comes out
    elsewhere = np.random.default_rng(2).normal(size=places.shape)
    np.testing.assert_allclose(Cholesky(csr_array(matrix), elsewhere).solve(columns), expected, rtol=1e-10, atol=1e-13)


def test_a_matrix_that_is_not_definite_has_factors_too():
    matrix, places = stiffness(definite=False)
    with pytest.raises(np.linalg.LinAlgError):
        Cholesky(csr_array(matrix), places)
    columns = np.random.default_rng(1).normal(size=(len(matrix), 2))
    found = Factors(csr_array(matrix), places).solve(columns)
    np.testing.assert_allclose(matrix @ found, columns, atol=1e-6)


def test_equilibria_are_the_same_in_any_number_of_threads(monkeypatch):
    matrix, places = stiffness()
    factors = Factors(csr_array(matrix), places)
    columns = np.random.default_rng(1).normal(size=(len(matrix), 300))
    found = []
    for count in ("1", "2", "5"):
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        found.append(factors.solve(columns))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_allclose(found[0], np.linalg.solve(matrix, columns), rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(factors.solve(csr_array(columns)), found[0])
    between = factors.between(csr_array(columns.T), csr_array(columns))
    np.testing.assert_allclose(between, columns.T @ found[0], rtol=1e-9, atol=1e-9)
    assert factors.solve(columns[:, :0]).shape == (len(matrix), 0)


def test_a_singular_matrix_is_said():
    with pytest.raises(SolveError, match="unstable"):
        Factors(csr_array(np.ones((3, 3))), np.zeros((3, 3)))
