"""Conjugate gradients in one launch against those of many, on a GPU."""

import numpy as np
import pytest
from bodies import matrix_of, model_of
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.errors import SolveError
from warpbrain.kernels import persistent
from warpbrain.kernels.linear import LinearResult, conjugate_gradient
from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


@pytest.fixture
def cuda(device: str) -> str:
    if device == "cpu":
        pytest.skip("on a GPU only")
    return device


def system_of(size: int, device: str, precision: Precision = DOUBLE) -> System:
    """A distorted cube on a clamped face, with a random right-hand side."""
    mesh = distorted(cube(size), 0.2 / size)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[cube(size).points[:, 2] < 1e-12] = True
    model = model_of(mesh, Material(LAWS["neo-hookean"]), constrained=constrained, density=1.0)
    system = System(model, device, precision.name)
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    system.load.assign(np.random.default_rng(3).normal(size=(system.size, 3)) * ~constrained)
    return system


def solve(system: System, tolerance: float, start: float = 0.0) -> tuple[np.ndarray, LinearResult]:
    cg = conjugate_gradient(system.matrix.device)(
        system.matrix, system.diagonal, system.load, system.solution, system.precision,
        tolerance=tolerance, max_iterations=5000, watch_curvature=True,
    )  # fmt: skip
    cg.prepare()
    system.solution.fill_(start)
    cg.solve()
    return system.solution.numpy().astype(float), cg.result()


# 125 nodes for a handful of blocks, 2,197, and 24,389 of which a block has more than it has threads for
@pytest.mark.parametrize("size", [4, 12, 28])
def test_the_same_solution(size: int, cuda: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system = system_of(size, cuda)
    x, result = solve(system, 1e-12)
    assert result.converged and not result.indefinite
    A, b = matrix_of(system), system.load.numpy().ravel()
    # it is the residual itself, as far as rounding lets it be told
    rounding = 16.0 * DOUBLE.epsilon * np.linalg.norm(abs(A) @ abs(x.ravel()) + abs(b))
    assert result.residual == pytest.approx(np.linalg.norm(A @ x.ravel() - b), rel=1e-2, abs=rounding)
    monkeypatch.setenv("WARPBRAIN_PERSISTENT", "0")
    expected, many = solve(system, 1e-12)
    assert np.linalg.norm(x - expected) <= 1e-9 * np.linalg.norm(expected)
    assert abs(result.iterations - many.iterations) <= 2 + many.iterations // 20
    # the least over directions that differ by rounding after hundreds of iterations
    assert result.curvature == pytest.approx(many.curvature, rel=1e-2)


def test_the_same_bits_wherever_numbers_are_kept(
    cuda: str, precision: Precision, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = system_of(12, cuda, precision)
    x, _ = solve(system, 1e-5)
    for _ in range(20):
        assert np.array_equal(x, solve(system, 1e-5)[0])
    shared = system.device.max_shared_memory_per_block
    # vectors and a part of the matrix on the chip, hardly anything there
    for kept in (16384, 4096):
        monkeypatch.setattr(persistent, "_RESERVED", shared - kept)
        assert np.array_equal(x, solve(system, 1e-5)[0])


def test_a_guess_is_kept_if_it_will_do(cuda: str) -> None:
    system = system_of(4, cuda)
    system.load.assign(matrix_of(system) @ np.full(3 * system.size, 0.25))
    x, result = solve(system, 1e-6, start=0.25)
    assert result.iterations == 0
    assert np.all(x == 0.25)


def test_blocks_that_give_up_are_told(cuda: str) -> None:
    system = system_of(4, cuda)
    cg = conjugate_gradient(system.matrix.device)(
        system.matrix, system.diagonal, system.load, system.solution, DOUBLE, tolerance=1e-6, max_iterations=1000
    )
    cg._given.control.assign([0, 1])
    cg.solve()
    with pytest.raises(SolveError, match="waited two seconds for each other"):
        cg.result()
    cg.solve()
    assert cg.result().converged
