"""Conjugate gradients with two levels, against SciPy's direct solver and those with one level."""

import numpy as np
import pytest
import scipy.sparse.linalg as sparse_linalg
from bodies import matrix_of, model_of
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.kernels.two_level import TwoLevelGradient
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.simulation.mesh_error import free_prolongation, prolongation
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

COARSE = distorted(cube(6), 0.03)


class Dense:
    """Solves on the coarse mesh."""

    def __init__(self, matrix) -> None:
        self.inverse = np.linalg.inv(matrix)

    def solve(self, columns):
        return self.inverse @ columns


def assembled(mesh, k: float = 1.0, m: float = 0.0) -> System:
    held = mesh.points[:, 2] < 0.02
    constrained = np.repeat(held[:, None], 3, axis=1)
    material = Material(LAWS["neo-hookean"])
    system = System(model_of(mesh, material, constrained=constrained, density=1.0), "cpu")
    system.evaluate_tangents()
    system.assemble(k, m)
    system.load.assign(np.random.default_rng(3).normal(size=(system.size, 3)) * ~constrained)
    return system


def two_levels(system: System, coarse, ends) -> TwoLevelGradient:
    free = ~coarse.model.constrained.ravel()
    prolong = free_prolongation(prolongation(ends, coarse.size), free, system.model.constrained)
    plain = system.linear_solver(tolerance=1e-9, max_iterations=5000, watch_curvature=True)
    matrix = matrix_of(coarse).tocsr()[free][:, free].toarray()
    return TwoLevelGradient(plain, system.load, system.solution, Dense(matrix), prolong, tolerance=1e-9)


@pytest.fixture(scope="module")
def meshes():
    return COARSE, *finer_mesh(COARSE)


def test_solution_in_a_tenth_of_the_iterations(meshes):
    coarse, finer, ends = meshes
    system = assembled(finer)
    solver = two_levels(system, assembled(coarse), ends)
    solver.prepare()
    solver.solve()
    result, found = solver.result(), system.solution.numpy().ravel().copy()
    A, b = matrix_of(system).tocsc(), system.load.numpy().ravel()
    assert result.converged
    assert not result.indefinite
    assert np.linalg.norm(A @ found - b) <= 1.1e-9 * np.linalg.norm(b)
    expected = sparse_linalg.spsolve(A, b)
    assert np.linalg.norm(found - expected) <= 1e-5 * np.linalg.norm(expected)
    plain = system.linear_solver(tolerance=1e-9, max_iterations=5000, watch_curvature=True)
    plain.prepare()
    system.solution.zero_()
    plain.solve(1e-9)
    assert result.iterations < 0.1 * plain.result().iterations


def test_the_cycle_is_symmetric_and_positive_definite(meshes):
    coarse, finer, ends = meshes
    system = assembled(finer)
    solver = two_levels(system, assembled(coarse), ends)
    solver.prepare()
    rng = np.random.default_rng(0)
    made, given = [], []
    for _ in range(4):
        r = rng.normal(size=3 * system.size) * ~system.model.constrained.ravel()
        given.append(r)
        made.append(solver._cycle(r).copy())
    products = np.array(given) @ np.array(made).T
    np.testing.assert_allclose(products, products.T, rtol=1e-9, atol=1e-9 * np.abs(products).max())
    assert (np.linalg.eigvalsh(products) > 0.0).all()


def test_it_goes_on_from_what_is_there(meshes):
    coarse, finer, ends = meshes
    system = assembled(finer)
    solver = two_levels(system, assembled(coarse), ends)
    solver.prepare()
    solver.solve(1e-6)
    solver.solve(1e-6)
    assert solver.result().iterations == 0


def test_an_indefinite_matrix_is_said(meshes):
    coarse, finer, ends = meshes
    system = assembled(finer, m=-1e6)
    solver = two_levels(system, assembled(coarse), ends)
    solver.prepare()
    solver.solve()
    assert solver.result().indefinite


def test_factors_that_are_of_no_help_leave_it_to_the_plain_solver(meshes):
    coarse, finer, ends = meshes
    system = assembled(finer)
    solver = two_levels(system, assembled(coarse), ends)
    # what no stable body would answer
    solver._coarse.inverse *= -1.0
    solver.prepare()
    solver.solve()
    assert solver.slow
    assert solver.result().converged
    A, b = matrix_of(system), system.load.numpy().ravel()
    assert np.linalg.norm(A @ system.solution.numpy().ravel() - b) <= 1.1e-9 * np.linalg.norm(b)
