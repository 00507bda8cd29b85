"""warpbrain on the CPU, double precision; and, with `gpu`, on cuda:0 (wall time there)."""

import sys
import time
from collections.abc import Callable

import numpy as np
import warp as wp
from problem import ASSEMBLIES, MU, NU, STRETCH, TOLERANCE, cube, faces, report, seconds

from warpbrain import __version__
from warpbrain.mesh import TetMesh, ordered
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

device = "cuda:0" if "gpu" in sys.argv else "cpu"
clock = time.perf_counter if device != "cpu" else time.process_time
wp.config.log_level = wp.LOG_WARNING

nodes, tetrahedra = cube()
bottom, top = faces(nodes)
material = Material(NeoHookean(MU), NU, "uncoupled")


def set_up() -> tuple[float, TetMesh, System]:
    start = clock()
    marks = {"bottom": np.isin(np.arange(len(nodes)), bottom), "top": np.isin(np.arange(len(nodes)), top)}
    mesh = ordered(TetMesh(nodes, tetrahedra, node_sets=marks))
    constrained = np.repeat((mesh.node_sets["bottom"] | mesh.node_sets["top"])[:, None], 3, axis=1)
    prescribed = np.zeros_like(mesh.points)
    prescribed[mesh.node_sets["top"], 2] = STRETCH
    system = System(Model(mesh, {1: material}, constrained=constrained, prescribed=prescribed), device)
    wp.synchronize_device(device)
    return clock() - start, mesh, system


# the first in a process loads kernels and starts the device
setup, mesh, system = set_up()


def assemble() -> None:
    system.evaluate_tangents()
    system.gather_forces()
    system.assemble(k=1.0, m=0.0)
    wp.synchronize_device(device)


def best(work: Callable[[], None]) -> float:
    """Smallest time of some work [s], after it was done once."""
    work()
    if device == "cpu":
        return seconds(work, 40)
    times = []
    for _ in range(40):
        start = clock()
        work()
        wp.synchronize_device(device)
        times.append(clock() - start)
    return min(times)


figures = {"assembly": best(assemble)} if ASSEMBLIES else {}
# the same norm as `problem.imbalance`: there are no external forces
options = EquilibriumOptions(tolerance=TOLERANCE)
solves = []
for _ in range(4 if ASSEMBLIES else 1):
    start = clock()
    state = EquilibriumSolver(system, options).solve()
    solves.append(clock() - start)
if device != "cpu":
    figures["device_mb"] = wp.get_mempool_used_mem_high(device) / 2**20
if ASSEMBLIES:
    figures["solve_again"] = min(solves[1:])
    # of meshes that no cache has seen
    figures["setup_again"] = min(set_up()[0] for _ in range(5))
if "steps" in sys.argv:
    # of 1 ms, from the stretch of the ends alone; the first captures it
    system.u.assign(system.model.prescribed)
    figures["step"] = best(Simulator(system).step)
cg = sum(step.cg_iterations for step in state.history)
report(
    "warpbrain" if device == "cpu" else f"warpbrain on {system.device.name}",
    __version__,
    f"Warp CG, block Jacobi, {cg} iterations",
    state.u,
    (mesh.points, mesh.tetrahedra),
    setup=setup,
    solve=solves[0],
    newton=len(state.history),
    cg=cg,
    **figures,
)
