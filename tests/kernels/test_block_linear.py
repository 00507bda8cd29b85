"""Several right-hand sides at once, beside SciPy's direct solver."""

import numpy as np
import pytest
from bodies import matrix_of, model_of
from scipy.sparse.linalg import splu
from shapes import cube, distorted

from warpbrain.kernels.block_linear import BlockConjugateGradient
from warpbrain.kernels.precision import DOUBLE, Precision
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def held(device: str, precision: Precision) -> System:
    mesh = distorted(cube(4), 0.03)
    constrained = np.repeat((cube(4).points[:, 2] < 1e-12)[:, None], 3, axis=1)
    system = System(model_of(mesh, Material(NeoHookean(700.0)), constrained=constrained), device, precision.name)
    system.evaluate_tangents()
    system.assemble(k=1.0, m=0.0)
    return system


def solver_of(system: System, count: int, **options) -> BlockConjugateGradient:
    wanted = {"tolerance": 20.0 * system.precision.epsilon, "max_iterations": 2000} | options
    solver = BlockConjugateGradient(system.matrix, system.diagonal, count, system.precision, **wanted)
    solver.prepare()
    return solver


@pytest.mark.parametrize("count", [1, 2, 5])
def test_each_is_solved(count, precision, device):
    system = held(device, precision)
    b = np.random.default_rng(0).normal(size=(count, system.size, 3)) * 10.0 ** np.arange(count)[:, None, None]
    solver = solver_of(system, count)
    x = solver.solve(list(b))
    expected = splu(matrix_of(system).tocsc()).solve(b.reshape(count, -1).T).T.reshape(b.shape)
    for one, other, result in zip(x, expected, solver.results(), strict=True):
        assert result.converged and 10 < result.iterations < 2000 and result.curvature > 0.0
        assert np.abs(one - other).max() <= 1e4 * precision.epsilon * np.abs(other).max()


def test_one_has_the_same_bits_whatever_the_others_are(precision, device):
    system = held(device, precision)
    b = np.random.default_rng(1).normal(size=(3, system.size, 3))
    together, alone = solver_of(system, 3), solver_of(system, 1)
    x = together.solve([b[0], 1e-3 * b[1], 0.0 * b[2]])
    assert np.array_equal(x[0], alone.solve([b[0]])[0])
    assert np.array_equal(x[2], np.zeros_like(x[2]))
    # a solver serves again and again
    assert np.array_equal(together.solve([b[0], 1e-3 * b[1], 0.0 * b[2]]), x)


def test_an_indefinite_matrix_is_told(device):
    system = held(device, DOUBLE)
    system.assemble(k=-1.0, m=0.0)
    solver = solver_of(system, 1)
    solver.solve([np.random.default_rng(2).normal(size=(system.size, 3))])
    assert solver.results()[0].indefinite


def test_running_out_of_iterations_is_told(precision, device):
    system = held(device, precision)
    solver = solver_of(system, 1, max_iterations=16)
    solver.solve([np.random.default_rng(3).normal(size=(system.size, 3))])
    [result] = solver.results()
    assert not result.converged and result.iterations == 16
