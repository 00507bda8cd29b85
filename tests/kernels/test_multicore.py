"""Launches on all cores of a CPU: the same bits by any number of threads, whatever else these are at."""

import numpy as np
import pytest
import scipy.sparse.linalg as sparse_linalg
from bodies import matrix_of, model_of
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.kernels import multicore
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System
from warpbrain.threads import in_threads

#: More than there are processors, and a number that does not divide the rows.
THREADS = ("1", "2", "3")


@pytest.fixture(scope="module")
def model() -> Model:
    """A clamped cube of enough nodes (2,197) for four threads."""
    mesh = distorted(cube(12), 0.01)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[mesh.points[:, 2] < 0.02] = True
    return model_of(mesh, Material(LAWS["neo-hookean"]), constrained=constrained, density=1000.0)


def solved(model: Model) -> bytes:
    """Forces, matrix and the solution of a linear system of a deformed body."""
    system = System(model, "cpu")
    system.u.assign(1e-3 * np.random.default_rng(2).normal(size=(system.size, 3)) * ~model.constrained)
    system.evaluate_tangents()
    system.gather_forces()
    system.assemble(1.0, 1.0)
    system.load.assign(system.internal.numpy() * ~model.constrained)
    solutions = []
    for at_rest in (False, True):
        solver = system.linear_solver(tolerance=1e-6, max_iterations=1000, watch_curvature=True, at_rest=at_rest)
        system.solution.zero_()
        solver.prepare()
        solver.solve()
        assert solver.result().converged
        solutions.append(system.solution.numpy())
    arrays = (system.internal.numpy(), system.matrix.values.numpy(), *solutions)
    return b"".join(array.tobytes() for array in arrays)


def moved(simulator: Simulator) -> bytes:
    """Displacement after three steps of 1 ms of a cube that is thrown."""
    free = ~simulator.system.model.constrained
    simulator.restore(np.zeros(free.shape), 0.1 * np.random.default_rng(1).normal(size=free.shape) * free, 0.0)
    for _ in range(3):
        simulator.step()
    return simulator.system.u.numpy().tobytes()


def threads_used(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A list to which every launch on several threads adds how many these are."""
    used: list[int] = []
    run = multicore._run

    def counted(team, kernel, dim, inputs, device, changes):
        used.append(len(changes))
        run(team, kernel, dim, inputs, device, changes)

    monkeypatch.setattr(multicore, "_run", counted)
    return used


def test_bits_do_not_depend_on_the_number_of_threads(model, monkeypatch):
    used = threads_used(monkeypatch)
    answers = []
    for count in THREADS:
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        answers.append(solved(model))
    assert answers[1:] == answers[:1] * 2
    # ranges of items in twice as many parts as there are threads, conjugate gradients in as many
    assert set(used) == {2, 3, 4, 6}


def test_the_coarse_space_halves_the_iterations_and_changes_no_answer(model, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    system = System(model, "cpu")
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    points = model.mesh.points
    # bends the cube: what block-Jacobi takes long for
    load = np.stack([points[:, 2], np.zeros(len(points)), -points[:, 0]], axis=1) * ~model.constrained
    system.load.assign(load)
    expected = sparse_linalg.spsolve(matrix_of(system).tocsc(), load.ravel()).reshape(-1, 3)
    iterations = []
    for at_rest in (False, True):
        solver = system.linear_solver(tolerance=1e-10, max_iterations=1000, watch_curvature=True, at_rest=at_rest)
        system.solution.zero_()
        solver.prepare()
        solver.solve()
        result = solver.result()
        assert result.converged
        assert not result.indefinite
        iterations.append(result.iterations)
        assert np.linalg.norm(system.solution.numpy() - expected) <= 1e-7 * np.linalg.norm(expected)
    assert iterations[1] < 0.6 * iterations[0]


def at_rest(model: Model, precision: str = "double") -> System:
    """With a load that bends, and its matrix."""
    system = System(model, "cpu", precision)
    system.evaluate_tangents()
    system.assemble(1.0, 0.0)
    points = model.mesh.points
    system.load.assign(np.stack([points[:, 2], 0.0 * points[:, 0], -points[:, 0]], axis=1) * ~model.constrained)
    return system


def test_what_single_precision_cannot_hold_is_solved_in_double(model):
    system = at_rest(model)
    expected = sparse_linalg.spsolve(matrix_of(system).tocsc(), system.load.numpy().ravel()).reshape(-1, 3)
    for array in (system.matrix.values, system.load):
        array.assign(1e45 * array.numpy())
    solver = system.linear_solver(tolerance=1e-10, max_iterations=1000, watch_curvature=True, at_rest=True)
    solver.prepare()
    solver.solve()
    assert solver.result().converged
    assert np.linalg.norm(system.solution.numpy() - expected) <= 1e-7 * np.linalg.norm(expected)


def test_an_indefinite_matrix_is_told_with_a_coarse_space_too(model):
    system = at_rest(model)
    values = system.matrix.values.numpy()
    values[system.diagonal.numpy()] -= 0.01 * np.abs(values).max() * np.eye(3)
    system.matrix.values.assign(values)
    solver = system.linear_solver(tolerance=1e-8, max_iterations=5000, watch_curvature=True, at_rest=True)
    solver.prepare()
    solver.solve()
    assert solver.result().indefinite


def test_a_system_in_single_precision_has_a_coarse_space_too(model):
    solutions = []
    for precision in ("double", "single"):
        system = at_rest(model, precision)
        solver = system.linear_solver(tolerance=1e-5, max_iterations=1000, watch_curvature=True, at_rest=True)
        solver.prepare()
        solver.solve()
        assert solver.result().converged
        solutions.append(system.solution.numpy())
    assert np.linalg.norm(solutions[1] - solutions[0]) <= 1e-3 * np.linalg.norm(solutions[0])


def test_bits_are_the_same_in_a_captured_graph(model, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    simulator = Simulator(System(model, "cpu"))
    expected = moved(simulator)
    for count in THREADS:
        monkeypatch.setenv("OMP_NUM_THREADS", count)
        simulator.capture()
        assert moved(simulator) == expected
    # the graph was captured for three, and there are fewer now
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert moved(simulator) == expected


def test_threads_that_have_other_work_are_not_waited_for(model, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    expected = solved(model)
    team = multicore._team()
    assert team is not None
    with team.busy:
        assert solved(model) == expected
    assert in_threads(lambda _: solved(model), range(2)) == [expected] * 2


def test_threads_that_never_come_are_not_waited_for(model, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    expected = solved(model)
    multicore._team_of.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(multicore._Team, "_serve", lambda self, calls: None)
        patched.setenv("OMP_NUM_THREADS", "3")
        assert solved(model) == expected
        simulator = Simulator(System(model, "cpu"))
        simulator.capture()
        moved(simulator)
    multicore._team_of.cache_clear()
