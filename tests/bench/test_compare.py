"""The comparison with other codes: who decides that a code has solved, and what a process is said to have cost."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from warpbrain.mesh import TetMesh, ordered
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

ROOT = Path(__file__).parents[2]
BENCH = ROOT / "bench"


@pytest.fixture(scope="module")
def problem():
    return runpy.run_path(str(BENCH / "problem.py"))


def clamped(problem, cells: int) -> Model:
    nodes, tetrahedra = problem["cube"](cells)
    bottom, top = problem["faces"](nodes)
    constrained, prescribed = np.zeros(nodes.shape, dtype=bool), np.zeros(nodes.shape)
    constrained[np.r_[bottom, top]] = True
    prescribed[top, 2] = problem["STRETCH"]
    material = Material(NeoHookean(problem["MU"]), problem["NU"], "uncoupled")
    return Model(TetMesh(nodes, tetrahedra), {1: material}, constrained=constrained, prescribed=prescribed)


def test_forces_that_judge_are_those_of_the_problem(problem, verify):
    model = clamped(problem, 3)
    system = System(model, "cpu")
    u = 0.05 * np.random.default_rng(1).standard_normal(model.mesh.points.shape)
    system.u.assign(u)
    system.evaluate_forces()
    system.gather_forces()
    ours = system.internal.numpy()
    theirs = problem["internal_forces"](model.mesh.points, model.mesh.tetrahedra, u)
    error = float(np.abs(ours - theirs).max() / np.abs(theirs).max())
    verify(
        "internal forces, uncoupled neo-Hookean, random displacements",
        "NumPy evaluation of bench/problem.py",
        error,
        1e-13,
    )


def test_one_norm_for_all(problem):
    model = clamped(problem, 3)
    solver = EquilibriumSolver(System(model, "cpu"), EquilibriumOptions(tolerance=problem["TOLERANCE"]))
    state = solver.solve()
    free = problem["free_nodes"](model.mesh.points)
    internal = problem["internal_forces"](model.mesh.points, model.mesh.tetrahedra, state.u)
    judged = problem["imbalance"](internal, free)
    # what our solver stops by is what it is judged by
    assert judged == pytest.approx(state.residual, rel=1e-3)
    assert judged <= problem["TOLERANCE"]
    assert not free[model.constrained.any(axis=1)].any() and free.sum() == len(free) - model.constrained[:, 0].sum()


def test_a_wrong_or_unsolved_answer_is_refused(problem, capsys):
    nodes, tetrahedra = problem["cube"]()
    model = clamped(problem, problem["CELLS"])
    u = EquilibriumSolver(System(model, "cpu"), EquilibriumOptions(tolerance=1e-8)).solve().u
    problem["report"]("a code", "1", "none", u, setup=1.0)
    assert '"code": "a code"' in capsys.readouterr().out
    # a code may number nodes as it likes
    mesh = ordered(TetMesh(nodes, tetrahedra, node_sets={}))
    with np.errstate(invalid="ignore"), pytest.raises(SystemExit, match="wrong answer"):
        problem["report"]("a code", "1", "none", u, (mesh.points, mesh.tetrahedra))
    near = u + 1e-8 * problem["free_nodes"](nodes)[:, None] * np.random.default_rng(0).standard_normal(u.shape)
    with pytest.raises(SystemExit, match="not solved: out-of-balance forces"):
        problem["report"]("a code", "1", "none", near)
    with np.errstate(invalid="ignore"), pytest.raises(SystemExit, match="wrong answer"):
        problem["report"]("a code", "1", "none", np.full_like(u, np.nan))


def test_what_a_process_cost_is_its_own():
    whole_process = runpy.run_path(str(BENCH / "process.py"))["whole_process"]
    ballast = np.ones(20_000_000)
    printed, _, small = whole_process(["sh", "-c", "echo one; echo two; exit 3"])
    assert (printed, small["status"]) == ("one\ntwo", 3)
    # not the memory of who started it
    assert small["peak_rss_mb"] < 30.0 < ballast.nbytes / 1e6
    program = "x = bytearray(80_000_000)\nfor i in range(0, len(x), 4096): x[i] = 1\nsum(range(3_000_000))"
    printed, _, large = whole_process([sys.executable, "-S", "-c", program])
    assert (printed, large["status"]) == ("", 0)
    assert 75.0 < large["peak_rss_mb"] < 110.0
    assert large["seconds"] > small["seconds"]


def test_the_page_says_what_was_recorded():
    tables = (ROOT / "bench" / "results" / "benchmarks.md").read_text(encoding="utf-8")
    made = runpy.run_path(str(ROOT / "docs" / "make_benchmarks.py"))["made"]
    assert made() == tables, "run docs/make_benchmarks.py"
