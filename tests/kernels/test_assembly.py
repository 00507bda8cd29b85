"""The matrix and the nodal forces against sums made by NumPy and SciPy."""

from itertools import pairwise

import numpy as np
import pytest
from bodies import matrix_of, model_of, stiffness_at
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.simulation.assembly import build_pattern
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def body(device: str, precision: Precision = DOUBLE, clamped: bool = True) -> System:
    """Two tissues of two laws; one face clamped, one more component held at an edge."""
    mesh = distorted(cube(3), 0.05, tissues=2)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    if clamped:
        low = cube(3).points[:, 2] < 1e-12
        constrained[low] = True
        constrained[-1, 1] = True
    materials = Material(LAWS["neo-hookean"]), Material(LAWS["ogden -4.7"], 0.4, "uncoupled")
    return System(model_of(mesh, *materials, constrained=constrained), device, precision.name)


def state(system: System) -> np.ndarray:
    return 0.02 * np.random.default_rng(1).uniform(-1.0, 1.0, (system.size, 3))


@pytest.mark.parametrize("clamped", [False, True])
@pytest.mark.parametrize(("k", "m"), [(1.0, 0.0), (0.0, 1.0), (2.5e-3, 1.1)])
def test_matrix(clamped: bool, k: float, m: float, precision: Precision, device: str) -> None:
    system = body(device, precision, clamped)
    K = stiffness_at(system, state(system))
    system.assemble(k, m)
    free = (~system.model.constrained).ravel()
    mass = np.repeat(system.model.node_masses, 3)
    expected = np.where(np.outer(free, free), k * K + np.diag(m * mass), 0.0) + np.diag(~free).astype(float)
    found = matrix_of(system).toarray()
    assert np.abs(found - expected).max() <= 50.0 * precision.epsilon * np.abs(expected).max()
    # constrained rows and columns are those of the identity to the last bit
    assert np.array_equal(found[~free], np.eye(len(free))[~free])
    assert np.array_equal(found[:, ~free], np.eye(len(free))[:, ~free])
    # mirrored blocks are copies; within a diagonal block symmetry holds to a rounding
    blocks = found.reshape(system.size, 3, system.size, 3).transpose(0, 2, 1, 3)
    mirrored = blocks.transpose(1, 0, 3, 2)
    apart = ~np.eye(system.size, dtype=bool)
    assert np.array_equal(blocks[apart], mirrored[apart])


def test_pattern() -> None:
    mesh = cube(3)
    tetrahedra = np.sort(mesh.tetrahedra, axis=1)
    n = len(mesh.points)
    pattern = build_pattern([tetrahedra], n)
    together = np.zeros((n, n), dtype=bool)
    for nodes in tetrahedra:
        together[np.ix_(nodes, nodes)] = True
    rows = np.repeat(np.arange(n), np.diff(pattern.offsets))
    found = np.zeros((n, n), dtype=bool)
    found[rows, pattern.columns] = True
    assert np.array_equal(found, together)
    assert len(pattern.columns) == together.sum()
    # columns ascend within a row, every diagonal block is where it is said to be
    assert all(np.all(np.diff(pattern.columns[a:b]) > 0) for a, b in pairwise(pattern.offsets))
    assert np.array_equal(pattern.columns[pattern.diagonal], np.arange(n))
    assert np.array_equal(rows[pattern.diagonal], np.arange(n))
    i, j = pattern.pairs.T
    assert np.all(i <= j)
    assert np.array_equal(rows[pattern.positions[:, 0]], i)
    assert np.array_equal(pattern.columns[pattern.positions[:, 0]], j)
    assert np.array_equal(rows[pattern.positions[:, 1]], j)
    assert np.array_equal(pattern.columns[pattern.positions[:, 1]], i)
    # every element block and every corner is used once, in a fixed order
    assert np.array_equal(np.sort(pattern.contributions), np.arange(10 * len(tetrahedra)))
    assert np.array_equal(np.sort(pattern.corners), np.arange(4 * len(tetrahedra)))
    assert np.array_equal(tetrahedra.ravel()[pattern.corners], np.repeat(np.arange(n), np.diff(pattern.corner_first)))


def test_forces(precision: Precision, device: str) -> None:
    system = body(device, precision)
    system.u.assign(state(system))
    system.evaluate_forces()
    system.gather_forces()
    expected = np.zeros((system.size, 3))
    np.add.at(expected, system.tetrahedra, system.element_forces.numpy().astype(float))
    found = system.internal.numpy()
    assert np.abs(found - expected).max() <= 50.0 * precision.epsilon * np.abs(expected).max()


def test_load_of_prescribed_displacements(precision: Precision, device: str) -> None:
    """`-k K d` on the free components, nothing on the constrained ones."""
    system = body(device, precision)
    K = stiffness_at(system, state(system))
    d = np.where(system.model.constrained, np.random.default_rng(2).normal(size=(system.size, 3)), 0.0)
    system.load.zero_()
    system.increment.assign(d)
    system.subtract_constrained_load(system.increment, 0.7)
    expected = np.where(system.model.constrained, 0.0, -0.7 * (K @ d.ravel()).reshape(-1, 3))
    assert np.abs(system.load.numpy() - expected).max() <= 50.0 * precision.epsilon * np.abs(expected).max()


def test_same_bits_every_time(precision: Precision, device: str) -> None:
    def run() -> tuple[np.ndarray, ...]:
        system = body(device, precision)
        system.u.assign(state(system))
        system.evaluate_tangents()
        system.gather_forces()
        system.assemble(1.0, 0.5)
        return system.internal.numpy(), system.matrix.values.numpy(), np.array(system.energy())

    for one, other in zip(run(), run(), strict=True):
        assert np.array_equal(one, other)
