"""Systems in clusters of multiprocessors, on a GPU that has them, against the same solver in many launches."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from bodies import model_of
from shapes import box, distorted

from warpbrain.ensemble.batch import pattern_of
from warpbrain.kernels.batched import cluster
from warpbrain.kernels.batched.linear import BatchedConjugateGradient
from warpbrain.kernels.batched.parts import Parts
from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

#: More than there are clusters at a time, of the smallest size.
SLOTS = 300
TOLERANCE = {"double": 1e-9, "single": 1e-5}
#: How near two ways through the same arithmetic come.
NEAR = {"double": 1e-10, "single": 1e-4}


@pytest.fixture
def clustered(device: str) -> str:
    if not cluster.forms_clusters(wp.get_device(device)):
        pytest.skip("on a GPU with clusters only")
    return device


def system_of(cells: tuple[int, int, int], device: str, precision: Precision) -> System:
    """A distorted block that is held at one end, and there not everywhere in all directions."""
    mesh = distorted(box(cells, (0.03, 0.03, 0.05)), 0.0005)
    constrained = np.repeat(mesh.points[:, 2:] < 0.002, 3, axis=1)
    constrained[mesh.points[:, 0] < 0.005, 2] = False
    system = System(model_of(mesh, Material(NeoHookean(1000.0)), constrained=constrained), device, precision.name)
    system.evaluate_tangents()
    system.assemble(1e-3, 1.0)
    return system


def fitting(system: System) -> Parts | None:
    return cluster.fitting_parts(pattern_of(system), system.precision.numpy.itemsize, system.device)


def solved(
    system: System, slots: list[int], most: int = 500, clusters: bool = True
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Solutions (n, 3, slots) and iterations of systems of numbers of their own, and whether clusters had them."""
    device, precision = system.device, system.precision
    random = np.random.default_rng(1)
    shape = (system.size, 3, SLOTS)
    v, x, b = (wp.array(random.normal(size=shape), dtype=precision.scalar, device=device) for _ in range(3))
    free = system.free.numpy()[:, :, None]
    x.assign(0.1 * free * x.numpy())
    cg = BatchedConjugateGradient(
        pattern_of(system), system.free, v, x, precision, tolerance=TOLERANCE[precision.name], max_iterations=most,
        parts=fitting(system) if clusters else None,
    )  # fmt: skip
    cg.right_hand_side.assign(free * b.numpy())
    stored = system.matrix.values.numpy()[system.pair_positions.numpy()[:, 0]].reshape(-1, 9, 1)
    diagonal = np.zeros((len(stored), 9, 1), dtype=stored.dtype)
    diagonal[pattern_of(system).diagonal, ::4] = 1.0
    scales = np.abs(stored).max() * np.linspace(0.01, 1.0, SLOTS)
    wp.copy(cg.values, wp.array(stored + scales * diagonal, dtype=precision.scalar, device=device))
    listed = [wp.array(values, dtype=int, device=device) for values in (np.resize(slots, SLOTS), [len(slots)])]
    with wp.ScopedCapture(device=device) as capture:
        cg.start(*listed)
        cg.iterate(*listed, wp.zeros(1, dtype=int, device=device))
    wp.capture_launch(capture.graph)
    wp.synchronize_device(device)
    iterations, residual, goal = (values[slots] for values in cg.results())
    assert np.all((residual <= goal) | (iterations == most))
    return x.numpy().astype(float), iterations, cg._cluster is not None


@pytest.mark.parametrize("size", [1, 2, 4, 8, 16])
def test_the_same_solutions_as_of_many_launches(
    size: int, clustered: str, precision: Precision, monkeypatch: pytest.MonkeyPatch
) -> None:
    # one multiprocessor has room for a small one only
    system = system_of((6, 6, 10) if size > 1 else (4, 4, 6), clustered, precision)
    monkeypatch.setattr(cluster, "SIZES", (size,))
    x, iterations, on_chip = solved(system, list(range(SLOTS)))
    assert on_chip
    expected, many, on_chip = solved(system, list(range(SLOTS)), clusters=False)
    assert not on_chip
    np.testing.assert_allclose(x, expected, rtol=0, atol=NEAR[precision.name] * np.abs(expected).max())
    # of which each has numbers of its own
    assert len(set(many.tolist())) > 3
    assert np.abs(iterations - many).max() <= (0 if precision is DOUBLE else 2)


def test_the_same_bits_alone_and_among_many(clustered: str, precision: Precision) -> None:
    system = system_of((6, 6, 10), clustered, precision)
    together, iterations, _ = solved(system, list(range(SLOTS)))
    for slots in ([7], [299, 0, 151], list(range(298, -1, -2))):
        few, again, _ = solved(system, slots)
        assert np.array_equal(few[:, :, slots], together[:, :, slots])
        assert again.tolist() == iterations[slots].tolist()


def test_a_limit_and_no_room(clustered: str, precision: Precision) -> None:
    _, iterations, _ = solved(system_of((6, 6, 10), clustered, precision), [3, 5], most=4)
    assert iterations.tolist() == [4, 4]
    pattern = pattern_of(system_of((6, 6, 10), clustered, precision))
    # a hundred times the blocks, and nodes of which hardly one is active
    larger = replace(pattern, columns=np.tile(pattern.columns, 100))
    assert cluster.fitting_parts(larger, 8, wp.get_device(clustered)) is None
    held = replace(pattern, active=np.zeros_like(pattern.active))
    assert cluster.fitting_parts(held, 8, wp.get_device(clustered)) is None
