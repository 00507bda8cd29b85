"""Shares of a matrix: what blocks and threads add up is the product, and each part is in the hands of one."""

import numpy as np
import pytest
from bodies import matrix_of, model_of
from shapes import box, distorted

from warpbrain.ensemble.batch import pattern_of
from warpbrain.kernels.batched.parts import ENDS, Parts, Pattern, bisected, parts_of, spread_over_banks
from warpbrain.kernels.module import DOUBLE
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


@pytest.fixture(scope="module")
def clamped() -> System:
    """A block that is held at one end, where only two of the three components of some nodes are."""
    mesh = distorted(box((3, 4, 5), (0.03, 0.04, 0.05)), 0.001)
    constrained = np.repeat(mesh.points[:, 2:] < 0.002, 3, axis=1)
    constrained[mesh.points[:, 0] < 0.005, 2] = False
    system = System(model_of(mesh, Material(NeoHookean(1000.0)), constrained=constrained), "cpu", DOUBLE.name)
    system.evaluate_tangents()
    system.assemble(1e-3, 1.0)
    return system


def product(parts: Parts, pattern: Pattern, stored: np.ndarray, x: np.ndarray) -> np.ndarray:
    """`A x` as a cluster computes it, zero on nodes that no block has; stored blocks (pairs, 3, 3), x (n, 3)."""
    y = np.zeros_like(x)
    for block in range(parts.blocks):
        own = parts.nodes[parts.starts[block] : parts.starts[block + 1]]
        outer = slice(parts.outer_starts[block], parts.outer_starts[block + 1])
        # outer numbers are read where they lie
        places = parts.outer_places[outer]
        elsewhere = parts.nodes[parts.starts[places >> 16] + (places & 0xFFFF)]
        np.testing.assert_array_equal(elsewhere, parts.outer_nodes[outer])
        numbers = x[np.concatenate([own, elsewhere])]
        segments = np.full((parts.segments, 3), np.nan)
        for thread in range(parts.threads):
            segment, total = parts.segment_starts[block, thread], np.zeros(3)
            for place in range(parts.places):
                pair, what = parts.pairs[block, thread, place], parts.columns[block, place, thread]
                A = stored[pair] if pair >= 0 else stored[-1 - pair].T
                total = total + A @ numbers[what & (ENDS - 1)]
                if what & ENDS:
                    assert np.all(np.isnan(segments[segment]))
                    segments[segment], total = total, np.zeros(3)
                    segment += 1
        first = parts.row_segments[parts.starts[block] + block :]
        for row, node in enumerate(own):
            y[node] = segments[first[row] : first[row + 1]].sum(axis=0)
    return y


@pytest.mark.parametrize(("blocks", "threads"), [(1, 512), (2, 64), (4, 32), (8, 512), (16, 32)])
def test_what_threads_add_up_is_the_product(blocks: int, threads: int, clamped: System) -> None:
    pattern = pattern_of(clamped)
    stored = clamped.matrix.values.numpy()[clamped.pair_positions.numpy()[:, 0]]
    parts = parts_of(pattern, blocks, threads, 16)
    x = pattern.active[:, None] * np.random.default_rng(4).normal(size=(clamped.size, 3))
    expected = (matrix_of(clamped) @ x.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(
        product(parts, pattern, stored, x), expected, rtol=0, atol=1e-14 * np.abs(expected).max()
    )
    assert sorted(parts.nodes) == np.flatnonzero(pattern.active).tolist()
    assert parts.rows >= len(parts.nodes) / blocks and parts.outer <= len(parts.nodes)


def test_parts_weigh_about_the_same_and_are_compact() -> None:
    points = np.random.default_rng(5).random((4000, 3)) * (4.0, 1.0, 1.0)
    weights = np.random.default_rng(6).integers(5, 20, size=4000).astype(np.int32)
    part = bisected(points, weights, 4)
    weight = np.bincount(part, weights)
    assert weight.max() - weight.min() <= 3 * weights.max()
    # four cubes side by side
    for number in range(4):
        assert np.all(np.ptp(points[part == number], axis=0) < 1.1)


def test_an_order_with_fewer_conflicts_of_banks_keeps_segments() -> None:
    random = np.random.default_rng(7)
    columns = random.integers(0, 500, size=(64, 8)).astype(np.int32)
    segments = np.cumsum(random.random((64, 8)) < 0.15, axis=1).astype(np.int32)
    order = spread_over_banks(columns, segments, 16)
    assert np.all(np.sort(order, axis=1) == np.arange(8))
    assert np.all(np.take_along_axis(segments, order, axis=1) == segments)

    def conflicts(of: np.ndarray) -> float:
        at_a_time = of.reshape(4, 16, 8).transpose(0, 2, 1).reshape(-1, 16)
        return float(np.mean([np.bincount(asked % 16).max() for asked in at_a_time]))

    assert conflicts(np.take_along_axis(columns, order, axis=1)) < 0.75 * conflicts(columns)
