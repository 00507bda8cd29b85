"""warpbrain on the CPU, double precision; and, with `gpu`, on cuda:0 (wall time there)."""

import sys
import time

import numpy as np
import warp as wp
from problem import MU, NU, REACTION, STRETCH, cube, faces, report, seconds

from warpbrain import __version__
from warpbrain.mesh import TetMesh, ordered
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

device = "cuda:0" if "gpu" in sys.argv else "cpu"
clock = time.perf_counter if device != "cpu" else time.process_time
wp.config.log_level = wp.LOG_WARNING

start = clock()
nodes, tetrahedra = cube()
bottom, top = faces(nodes)
marks = {"bottom": np.isin(np.arange(len(nodes)), bottom), "top": np.isin(np.arange(len(nodes)), top)}
mesh = ordered(TetMesh(nodes, tetrahedra, node_sets=marks))
constrained = np.repeat((mesh.node_sets["bottom"] | mesh.node_sets["top"])[:, None], 3, axis=1)
prescribed = np.zeros_like(mesh.points)
prescribed[mesh.node_sets["top"], 2] = STRETCH
material = Material(NeoHookean(MU), NU, "uncoupled")
system = System(Model(mesh, {1: material}, constrained=constrained, prescribed=prescribed), device)
setup = clock() - start


def assemble() -> None:
    system.evaluate_tangents()
    system.gather_forces()
    system.assemble(k=1.0, m=0.0)
    wp.synchronize_device(device)


start = clock()
assemble()
first = clock() - start
if device == "cpu":
    assembly = seconds(assemble, 40)
else:
    times = []
    for _ in range(40):
        start = clock()
        assemble()
        times.append(clock() - start)
    assembly = min(times)

# as exact as the direct solvers of the others: their last Newton correction is below 1e-9
options = EquilibriumOptions(tolerance=1e-10)
solves = []
for _ in range(4):
    start = clock()
    state = EquilibriumSolver(system, options).solve()
    solves.append(clock() - start)
reaction = float(state.internal[mesh.node_sets["top"], 2].sum())
report(
    "warpbrain" if device == "cpu" else f"warpbrain on {system.device.name}",
    __version__,
    f"Warp CG, block Jacobi, {sum(step.cg_iterations for step in state.history)} iterations",
    state.u,
    setup=setup,
    first_assembly=first,
    assembly=assembly,
    solve=solves[0],
    solve_again=min(solves[1:]),
    newton=len(state.history),
    reaction_error=abs(reaction / REACTION - 1.0),
)
