"""From which size on a coarse space pays: equilibria of cubes, a slender bar and the shipped beam, with it and without.

python bench/coarse_space.py   # prints processor times, medians of five in turns, one thread, and CG iterations
"""

from __future__ import annotations

import os
from statistics import median

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from factors import seconds
from problem import cube

from warpbrain.cases.shipped import BEAM, find_case
from warpbrain.kernels import linear
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Side of a cell of a cube [m], shear modulus [Pa], and force on each node of a cube of one cell [N]. On other bodies
#: it is as much less as bends them by about the same part of their length.
CELL, MU, FORCE = 0.01, 1000.0, 5e-3


def bar(cells: int, slenderness: float = 1.0) -> tuple[Model, np.ndarray]:
    """A cube of so many cells along an edge, drawn out so many times along z and clamped below; forces (n, 3) [N]."""
    nodes, tetrahedra = cube(cells)
    mesh = TetMesh(CELL * cells * nodes * [1.0, 1.0, slenderness], tetrahedra)
    clamped = np.repeat(nodes[:, 2:] < 1e-12, 3, axis=1)
    forces = np.zeros_like(nodes)
    forces[:, 0] = FORCE / cells / slenderness**2
    materials = {label: Material(NeoHookean(MU)) for label in mesh.labels}
    return Model(mesh, materials, 1000.0, clamped), forces


def main() -> None:
    """Print the table."""
    bodies = {f"cube of {cells}": bar(cells) for cells in (4, 5, 6, 7, 9, 11)}
    bodies["bar, 4 times as long"] = bar(7, 4.0)
    beam = model_of(find_case(BEAM[1]))
    bodies["beam"] = beam, beam.external_forces()
    print("body                     rows   without       with a coarse space   ratio of times")
    for name, (model, forces) in bodies.items():
        solvers = {least: EquilibriumSolver(System(model, "cpu")) for least in (10**9, 0)}
        runs: dict[int, list[tuple[float, int]]] = {least: [] for least in solvers}
        for _ in range(6):
            for least, solver in solvers.items():
                linear._WORTH_A_COARSE_SPACE = least
                time, equilibrium = seconds(lambda solver=solver, forces=forces: solver.solve(forces))
                runs[least].append((1e3 * time, sum(step.cg_iterations for step in equilibrium.history)))
        # the first of each makes room
        without, with_space = (median(time for time, _ in timed[1:]) for timed in runs.values())
        iterations, fewer = (timed[-1][1] for timed in runs.values())
        print(
            f"{name:22} {len(forces):6} {without:6.0f} ms, {iterations:5} {with_space:6.0f} ms, {fewer:5}"
            f"   {with_space / without:.2f}"
        )


if __name__ == "__main__":
    main()
