"""Patches of a mesh: what threads and blocks of threads add up is the matrix, and no two of them write to one place."""

import numpy as np
import pytest
from bodies import model_of
from shapes import box, distorted

from warpbrain.errors import InputError
from warpbrain.kernels.batched.patches import FIRST, Patches, Sums, patches_of, rounds_of
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

WIDTH = 8


@pytest.fixture(scope="module")
def clamped() -> System:
    """A block that is held at one end, where only two of the three components of some nodes are."""
    mesh = distorted(box((3, 4, 5), (0.03, 0.04, 0.05)), 0.001)
    constrained = np.repeat(mesh.points[:, 2:] < 0.002, 3, axis=1)
    constrained[mesh.points[:, 0] < 0.005, 2] = False
    system = System(model_of(mesh, Material(NeoHookean(1000.0)), constrained=constrained), "cpu")
    system.u.assign(np.random.default_rng(2).normal(scale=3e-4, size=(system.size, 3)))
    system.evaluate_tangents()
    system.assemble(1e-3, 1.0)
    return system


def shared_out(system: System, groups: list[np.ndarray], numbers: int) -> tuple[list[Patches], Sums]:
    return patches_of(
        system.mesh.points, system.tetrahedra, system.pairs.numpy(), system.free.numpy() != 0.0, groups, WIDTH, 2,
        lambda edges, nodes: 9 * (edges + 1) + 3 * nodes <= numbers,
    )  # fmt: skip


def assembled(system: System, made: list[Patches], sums: Sums, k: float, m: float) -> np.ndarray:
    """Blocks of the pairs (p, 3, 3), as blocks of threads add them up from those of elements."""
    blocks = system.element_blocks.numpy()
    # of PAIRS, those of two nodes
    between, bits = blocks[:, [1, 2, 3, 5, 6, 8]], 1 << np.arange(9).reshape(3, 3)
    pairs = len(system.pairs)
    values = np.full((pairs + sums.extras, 3, 3), np.nan)
    for of in made:
        for patch, edges in enumerate(of.edge_counts):
            total = np.zeros((edges + 1, 3, 3))
            for turn in range(of.round_counts[patch]):
                elements = of.elements[patch, turn]
                at = of.edges[patch, turn][elements >= 0]
                assert len(np.unique(at)) == at.size
                total[at] += between[elements[elements >= 0]]
            assert np.all(of.elements[patch, of.round_counts[patch] :] < 0) and not np.any(total[edges:])
            assert np.all(of.edges[patch][of.elements[patch] < 0] == edges)
            nodes = slice(of.node_starts[patch], of.node_starts[patch + 1])
            diagonal = np.zeros((nodes.stop - nodes.start, 3, 3))
            for node in range(nodes.start, nodes.stop):
                for spoke in of.spokes[of.spoke_starts[node] : of.spoke_starts[node + 1]]:
                    diagonal[node - nodes.start] -= total[-1 - spoke].T if spoke < 0 else total[spoke]
            span = slice(of.row_starts[patch], of.row_starts[patch + 1])
            kept, rows = of.kept[span], of.rows[span]
            free = (kept[:, None, None] & bits) != 0
            found = np.where(free, k * np.concatenate([total[:edges], diagonal]), 0.0)
            first = np.flatnonzero(kept & FIRST)
            assert np.all(first >= edges)
            mass = system.mass.numpy()[of.nodes[nodes][first - edges], None, None]
            found[first] += np.eye(3) * np.where(free[first], m * mass, 1.0)
            assert np.all(np.isnan(values[rows]))
            values[rows] = found
    for pair, start, end in zip(sums.pairs, sums.extra_starts[:-1], sums.extra_starts[1:], strict=True):
        values[pair] += values[pairs + start : pairs + end].sum(axis=0)
    return values[:pairs]


@pytest.mark.parametrize("numbers", [700, 3000, 10**6])
@pytest.mark.parametrize("groups", [1, 2])
def test_what_patches_add_up_is_the_matrix(groups: int, numbers: int, clamped: System) -> None:
    chosen = np.random.default_rng(3).random(clamped.elements) < 0.3
    members = [np.flatnonzero(chosen), np.flatnonzero(~chosen)] if groups == 2 else [np.arange(clamped.elements)]
    made, sums = shared_out(clamped, members, numbers)
    assert len(made[0].edge_counts) == 1 if numbers == 10**6 else len(made[-1].edge_counts) > 1
    for of, elements in zip(made, members, strict=True):
        assert sorted(of.elements[of.elements >= 0]) == elements.tolist()
        assert np.all(of.round_counts % 2 == 0) and of.elements.shape[2] == WIDTH
        assert np.all(9 * (of.edge_counts + 1) + 3 * np.diff(of.node_starts) <= numbers)
        corners = of.nodes[of.node_starts[:-1, None, None, None] + of.corners]
        there = of.elements >= 0
        np.testing.assert_array_equal(corners[there], clamped.tetrahedra[of.elements[there]])
    expected = clamped.matrix.values.numpy()[clamped.pair_positions.numpy()[:, 0]]
    found = assembled(clamped, made, sums, 1e-3, 1.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max())


def test_no_room_for_one_element_is_an_error(clamped: System) -> None:
    with pytest.raises(InputError, match="no room for one element"):
        shared_out(clamped, [np.arange(clamped.elements)], 9 * 7 + 3 * 4 - 1)


def test_no_two_elements_of_a_round_share_an_edge() -> None:
    edges = np.random.default_rng(5).integers(0, 300, size=(200, 6)).astype(np.int32)
    rounds = rounds_of(edges, 16)
    assert sorted(element for chosen in rounds for element in chosen) == list(range(200))
    for chosen in rounds:
        assert 0 < len(chosen) <= 16
        assert sum(len(np.unique(edges[element])) for element in chosen) == len(np.unique(edges[chosen]))
