"""Batched kernels beside SciPy: products, sums and solves of each sample, and nothing that leaks between samples."""

from functools import cache

import numpy as np
import pytest
import scipy.sparse as sparse
import scipy.sparse.linalg
import warp as wp
from bodies import matrix_of, model_of
from shapes import box, distorted

from warpbrain.ensemble.batch import parts_of_clusters, pattern_of
from warpbrain.kernels.batched.linear import BatchedConjugateGradient
from warpbrain.kernels.batched.motion import batched_motion_kernels
from warpbrain.kernels.batched.solve_kernels import batched_solve_kernels
from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

SLOTS = 5
TOLERANCE = {"double": 1e-12, "single": 1e-5}


class Systems:
    """The matrix `k K + M` of a clamped block at several `k`, one a slot."""

    def __init__(self, device: str, precision, max_iterations: int = 500, clusters: bool = True) -> None:
        mesh = distorted(box((3, 3, 4), (0.03, 0.03, 0.04)), 0.001)
        constrained = np.repeat(mesh.points[:, 2:] < 0.002, 3, axis=1)
        self.system = System(
            model_of(mesh, Material(NeoHookean(1000.0)), constrained=constrained), device, precision.name
        )
        self.device, self.size = device, self.system.size
        self.system.evaluate_tangents()
        positions = self.system.pair_positions.numpy()
        self.matrices: list[sparse.bsr_matrix] = []
        values = np.empty((len(positions), 9, SLOTS))
        for slot in range(SLOTS):
            self.system.assemble(10.0**-slot * 1e-3, 1.0)
            self.matrices.append(matrix_of(self.system))
            values[:, :, slot] = self.system.matrix.values.numpy()[positions[:, 0]].reshape(-1, 9)
        self.solution, self.v = (
            wp.zeros((self.size, 3, SLOTS), dtype=precision.scalar, device=device) for _ in range(2)
        )
        self.cg = BatchedConjugateGradient(
            pattern_of(self.system), self.system.free, self.v, self.solution, precision,
            tolerance=TOLERANCE[precision.name], max_iterations=max_iterations,
            parts=parts_of_clusters(self.system) if clusters else None,
        )  # fmt: skip
        self.set_values(values)
        free = 1.0 - constrained
        self.b = free[:, :, None] * np.random.default_rng(1).normal(size=(self.size, 3, SLOTS))

    def set_values(self, values: np.ndarray) -> None:
        """The stored blocks, shape (pairs, 9, slots)."""
        # however they lie in memory
        wp.copy(self.cg.values, wp.array(values, dtype=self.cg.values.dtype, device=self.device))

    def listed(self, *slots: int) -> tuple[wp.array, wp.array]:
        padded = np.zeros(SLOTS, dtype=np.int32)
        padded[: len(slots)] = slots
        return (
            wp.array(padded, dtype=int, device=self.device),
            wp.array([len(slots)], dtype=int, device=self.device),
        )

    def solve(self, *slots: int, linger: int = 0, start: bool = True) -> None:
        if start:
            self.cg.right_hand_side.assign(self.b)
            self.solution.zero_()
            self.cg.start(*self.listed(*slots))
        self.cg.iterate(*self.listed(*slots), wp.array([linger], dtype=int, device=self.device))
        wp.synchronize_device(self.device)

    def residual(self, slot: int) -> float:
        x, b = (values[:, :, slot].ravel() for values in (self.solution.numpy().astype(float), self.b))
        return float(np.linalg.norm(b - self.matrices[slot] @ x) / np.linalg.norm(b))


@cache
def solved(device: str, precision: Precision) -> Systems:
    """All systems solved together, for all tests that compare with them."""
    systems = Systems(device, precision)
    systems.solve(*range(SLOTS))
    return systems


def test_every_system_is_solved(device: str, precision) -> None:
    systems = Systems(device, precision)
    systems.solve(*range(SLOTS))
    iterations, residual, goal = systems.cg.results()
    assert np.all(residual <= goal) and not np.any(systems.cg.solving.numpy())
    # systems of other conditions take other numbers of iterations
    assert len(set(iterations.tolist())) == SLOTS
    for slot in range(SLOTS):
        assert systems.residual(slot) < 20.0 * TOLERANCE[precision.name]
        if precision is DOUBLE:
            expected = scipy.sparse.linalg.spsolve(systems.matrices[slot].tocsc(), systems.b[:, :, slot].ravel())
            np.testing.assert_allclose(
                systems.solution.numpy()[:, :, slot].ravel(), expected, rtol=0, atol=1e-9 * np.abs(expected).max()
            )


def test_a_system_has_the_same_bits_alone(device: str, precision) -> None:
    together = solved(device, precision)
    for slot in range(SLOTS):
        alone = Systems(device, precision)
        alone.solve(slot)
        assert alone.solution.numpy()[:, :, slot].tobytes() == together.solution.numpy()[:, :, slot].tobytes()
        assert alone.cg.results()[0][slot] == together.cg.results()[0][slot]


@pytest.mark.parametrize("entry", range(9))
@pytest.mark.parametrize("diagonal", [False, True])
def test_a_system_that_is_not_a_number_ends_and_harms_no_other(
    diagonal: bool, entry: int, device: str, precision
) -> None:
    clean, broken = solved(device, precision), Systems(device, precision)
    values = broken.cg.values.numpy()
    # rows of nodes that are held in all directions are those of the identity, which a solver may leave out
    pairs = broken.system.pairs.numpy()
    free = np.all(broken.system.free.numpy() == 1.0, axis=1)
    pair = np.flatnonzero(np.all(free[pairs], axis=1) & ((pairs[:, 0] == pairs[:, 1]) == diagonal))[3]
    values[pair, entry, 2] = np.nan
    broken.set_values(values)
    broken.solve(*range(SLOTS))
    iterations, residual, goal = broken.cg.results()
    assert not residual[2] <= goal[2] and not np.any(broken.cg.solving.numpy())
    assert iterations[2] < iterations[0]
    for slot in (0, 1, 3, 4):
        assert clean.solution.numpy()[:, :, slot].tobytes() == broken.solution.numpy()[:, :, slot].tobytes()


def test_systems_that_linger_go_on_later_with_the_same_bits(device: str, precision) -> None:
    # clusters leave none over
    whole, parts = (Systems(device, precision, clusters=False) for _ in range(2))
    whole.solve(*range(SLOTS))
    parts.solve(*range(SLOTS), linger=3)
    left = np.flatnonzero(parts.cg.solving.numpy())
    assert 0 < len(left) <= 3
    parts.solve(*left.tolist(), linger=1, start=False)
    parts.solve(*np.flatnonzero(parts.cg.solving.numpy()).tolist(), start=False)
    assert whole.solution.numpy().tobytes() == parts.solution.numpy().tobytes()
    np.testing.assert_array_equal(whole.cg.results()[0], parts.cg.results()[0])


def test_the_number_of_iterations_has_a_limit(device: str, precision) -> None:
    systems = Systems(device, precision, max_iterations=3)
    systems.solve(*range(SLOTS))
    iterations, residual, goal = systems.cg.results()
    assert iterations.max() == 3 and residual[0] > goal[0]
    assert not np.any(systems.cg.solving.numpy())


def test_a_slot_that_is_not_listed_is_left_alone(device: str, precision) -> None:
    systems = Systems(device, precision)
    systems.solve(3, 1)
    assert not np.any(systems.solution.numpy()[:, :, [0, 2, 4]])
    assert systems.residual(1) < 20.0 * TOLERANCE[precision.name]
    assert systems.residual(3) < 20.0 * TOLERANCE[precision.name]


@pytest.mark.parametrize("flags", [[1, 0, 1, 1, 0, 0, 1], [0] * 7, [1] * 7, [0, 0, 0, 0, 0, 0, 1]])
@pytest.mark.parametrize("listed", [7, 3, 0])
def test_the_list_of_those_that_go_on_keeps_its_order(flags: list[int], listed: int, device: str) -> None:
    order = [4, 2, 6, 0, 1, 5, 3]
    slots, count, solving, active, active_count = (
        wp.array(values, dtype=int, device=device) for values in (order, [listed], flags, [-1] * 7, [-1])
    )
    kernel = batched_solve_kernels(DOUBLE)[1].gather_active
    wp.launch(kernel, 7, inputs=[slots, count, solving, active, active_count], device=device)
    expected = [slot for slot in order[:listed] if flags[slot]]
    assert active_count.numpy()[0] == len(expected)
    assert active.numpy()[: len(expected)].tolist() == expected


@pytest.mark.parametrize("bad", [None, 0, 11, 12, 29])
def test_the_smallest_value_of_each_sample(bad: int | None, device: str, precision) -> None:
    values = np.random.default_rng(2).normal(size=(30, SLOTS)).astype(precision.numpy)
    if bad is not None:
        values[bad, 3] = np.nan
    kernel = batched_motion_kernels(precision).smallest
    slots, count = wp.array(np.arange(SLOTS), dtype=int, device=device), wp.array([SLOTS], dtype=int, device=device)
    parts = wp.zeros((3, SLOTS), dtype=precision.scalar, device=device)
    least = wp.zeros((1, SLOTS), dtype=precision.scalar, device=device)
    whole = wp.array(values, dtype=precision.scalar, device=device)
    wp.launch(kernel, (3, SLOTS), inputs=[slots, count, 12, whole, parts], device=device)
    wp.launch(kernel, (1, SLOTS), inputs=[slots, count, 3, parts, least], device=device)
    np.testing.assert_array_equal(least.numpy()[0], values.min(axis=0))
