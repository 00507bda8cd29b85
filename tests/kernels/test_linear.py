"""Conjugate gradients against SciPy's direct solver, and how they say that they failed."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse.linalg as sparse_linalg
from bodies import matrix_of, model_of
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.kernels.linear import LinearResult, conjugate_gradient
from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

every_kind = pytest.mark.parametrize("only_blocks", [True, False], ids=["of one launch", "a loop of launches"])


def system_with(k: float, m: float, device: str, precision: Precision = DOUBLE, clamped: bool = True) -> System:
    """A cube on a clamped face with `k K + m M` in its matrix and a random right-hand side."""
    mesh = distorted(cube(4), 0.04)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[cube(4).points[:, 2] < 1e-12] = clamped
    system = System(
        model_of(mesh, Material(LAWS["neo-hookean"]), constrained=constrained, density=1.0), device, precision.name
    )
    system.evaluate_tangents()
    system.assemble(k, m)
    system.load.assign(np.random.default_rng(3).normal(size=(system.size, 3)) * ~constrained)
    return system


def solve(system: System, only_blocks: bool = True, **options: Any) -> tuple[np.ndarray, LinearResult]:
    options = {"tolerance": 1e-10, "max_iterations": 2000, "watch_curvature": True, **options}
    cg = conjugate_gradient(system.matrix.device, only_blocks=only_blocks)(
        system.matrix, system.diagonal, system.load, system.solution, system.precision, **options
    )
    cg.prepare()
    system.solution.zero_()
    cg.solve()
    result = cg.result()
    return system.solution.numpy().astype(float), result


@every_kind
def test_solution(only_blocks: bool, precision: Precision, device: str) -> None:
    system = system_with(1.0, 0.0, device, precision)
    tolerance = {"double": 1e-12, "single": 1e-5}[precision.name]
    x, result = solve(system, only_blocks, tolerance=tolerance)
    assert result.converged
    assert not result.indefinite
    A, b = matrix_of(system).tocsc(), system.load.numpy().astype(float)
    expected = sparse_linalg.spsolve(A, b.ravel()).reshape(-1, 3)
    # the error is the residual times the condition number, some 1e3 here
    assert np.linalg.norm(x - expected) <= 1e3 * tolerance * np.linalg.norm(expected)
    residual = np.linalg.norm(A @ x.ravel() - b.ravel())
    assert residual <= 2.0 * tolerance * np.linalg.norm(b)
    # it is carried along from step to step, and rounding adds up: 0.05 % off, in single precision 16 %
    assert result.residual == pytest.approx(residual, rel=2e-3 if precision is DOUBLE else 0.3)


def test_curvature_lies_among_the_eigenvalues(device: str) -> None:
    system = system_with(1.0, 0.0, device)
    _, result = solve(system)
    free = (~system.model.constrained).ravel()
    eigenvalues = np.linalg.eigvalsh(matrix_of(system).toarray()[np.ix_(free, free)])
    # a Rayleigh quotient: between the extremes, and among the soft modes since CG has to find those too
    assert eigenvalues[0] <= result.curvature <= np.median(eigenvalues)


@every_kind
def test_prepare_follows_new_values(only_blocks: bool, device: str) -> None:
    system = system_with(1.0, 0.0, device)
    cg = conjugate_gradient(system.matrix.device, only_blocks=only_blocks)(
        system.matrix, system.diagonal, system.load, system.solution, system.precision,
        tolerance=1e-10, max_iterations=2000,
    )  # fmt: skip
    counts = []
    for k in (1.0, 1e6):
        system.assemble(k, 0.0)
        cg.prepare()
        system.solution.zero_()
        cg.solve()
        result = cg.result()
        counts.append(result.iterations)
        assert result.converged
        expected = sparse_linalg.spsolve(matrix_of(system).tocsc(), system.load.numpy().ravel())
        x = system.solution.numpy().ravel()
        assert np.linalg.norm(x - expected) <= 1e-6 * np.linalg.norm(expected)
    # constrained rows stay those of the identity, which inverse blocks see through
    assert abs(counts[0] - counts[1]) <= 3


def test_multiply(precision: Precision, device: str) -> None:
    system = system_with(1.0, 0.1, device, precision)
    cg = conjugate_gradient(system.matrix.device)(
        system.matrix, system.diagonal, system.load, system.solution, system.precision,
        tolerance=1e-3, max_iterations=1,
    )  # fmt: skip
    cg.multiply(system.load, system.solution)
    expected = matrix_of(system) @ system.load.numpy().ravel().astype(float)
    found = system.solution.numpy().ravel()
    assert np.abs(found - expected).max() <= 100.0 * precision.epsilon * np.abs(expected).max()


@every_kind
@pytest.mark.parametrize(
    ("k", "m"),
    [
        pytest.param(-1.0, 0.0, id="negative definite"),
        pytest.param(1.0, -1e6, id="negative mass"),
        pytest.param(1.0, -2e4, id="some negative eigenvalues"),
    ],
)
def test_indefinite_matrix_is_told(only_blocks: bool, k: float, m: float, device: str) -> None:
    system = system_with(k, m, device)
    eigenvalues = np.linalg.eigvalsh(matrix_of(system).toarray())
    assert eigenvalues[0] < 0.0
    _, result = solve(system, only_blocks, max_iterations=300)
    assert result.indefinite


def test_an_indefinite_matrix_ends_the_solve() -> None:
    """On the CPU, where the loop is ours: nothing is found by going on, and there may be 10,000 iterations to come."""
    system = system_with(1.0, -1e5, "cpu")
    assert np.linalg.eigvalsh(matrix_of(system).toarray())[0] < 0.0
    _, watched = solve(system, max_iterations=300, tolerance=1e-30)
    _, blind = solve(system, max_iterations=300, tolerance=1e-30, watch_curvature=False)
    assert watched.indefinite and not watched.converged
    assert watched.iterations < blind.iterations == 300


@every_kind
def test_too_few_iterations_are_told(only_blocks: bool, device: str) -> None:
    _, result = solve(system_with(1.0, 0.0, device), only_blocks, max_iterations=3)
    assert not result.converged
    assert not result.indefinite
    assert result.residual > result.tolerance


@every_kind
def test_a_matrix_with_nan_ends_and_is_told(only_blocks: bool, device: str) -> None:
    system = system_with(1.0, 0.0, device)
    system.matrix.values.fill_(float("nan"))
    _, result = solve(system, only_blocks, max_iterations=50)
    assert not result.converged


def test_a_solve_can_be_repeated(device: str) -> None:
    """A solver replays what it recorded, on new values and a new right-hand side."""
    system = system_with(1.0, 0.0, device)
    cg = conjugate_gradient(system.matrix.device)(
        system.matrix, system.diagonal, system.load, system.solution, system.precision,
        tolerance=1e-10, max_iterations=2000, watch_curvature=True,
    )  # fmt: skip
    with pytest.raises(RuntimeError, match="no solve has been run"):
        cg.result()
    b = system.load.numpy()
    for k, scale in ((-1.0, 1.0), (1.0, 1.0), (5.0, 0.0), (2.0, 3.0)):
        system.assemble(k, 0.0)
        system.load.assign(scale * b)
        cg.prepare()
        system.solution.zero_()
        cg.solve()
        result = cg.result()
        assert result.indefinite == (k < 0.0)
        if k > 0.0:
            assert result.converged
            expected = sparse_linalg.spsolve(matrix_of(system).tocsc(), scale * b.ravel())
            x = system.solution.numpy().ravel()
            assert np.linalg.norm(x - expected) <= 1e-7 * np.linalg.norm(expected)
    # from the solution itself there is nothing left to do
    cg.solve()
    assert cg.result().iterations <= 1


def test_no_load_no_answer_but_zero(device: str) -> None:
    system = system_with(1.0, 0.0, device)
    system.load.zero_()
    x, result = solve(system)
    assert result.converged
    assert not result.indefinite
    assert np.all(x == 0.0)


def test_same_bits_every_time(precision: Precision, device: str) -> None:
    one, other = (solve(system_with(1.0, 0.0, device, precision), tolerance=1e-4)[0] for _ in range(2))
    assert np.array_equal(one, other)
