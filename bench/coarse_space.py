"""From which size on a coarse space pays: equilibria of cubes, a slender bar and the shipped beam, with it and without.

python bench/coarse_space.py   # prints medians of five, in turns, one thread
"""

from __future__ import annotations

import os
import time

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from problem import cube

from warpbrain.cases.shipped import BEAM, find_case
from warpbrain.kernels import linear
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: What a cell of all bodies but the beam weighs across the body [N/m2], and its side [m].
LOAD, CELL = 50.0, 0.01


def bar(cells: int, sides: tuple[float, float, float]) -> tuple[Model, np.ndarray]:
    """A cube of so many cells along an edge, drawn out to sides [m] and held at one end, and a load (n, 3) [N]."""
    nodes, tetrahedra = cube(cells)
    mesh = TetMesh(nodes * np.array(sides), tetrahedra)
    constrained = np.repeat(nodes[:, 2:] < 1e-12, 3, axis=1)
    load = np.zeros_like(nodes)
    load[:, 0] = LOAD * CELL**2 * (CELL * cells / sides[2]) ** 2 / cells
    materials = {label: Material(NeoHookean(1000.0)) for label in mesh.labels}
    return Model(mesh, materials, 1000.0, constrained), load


def main() -> None:
    """Print the table."""
    bodies = {f"cube of {cells}": bar(cells, (CELL * cells,) * 3) for cells in (4, 5, 6, 7, 9, 11)}
    bodies["bar, 4 times as long"] = bar(7, (0.07, 0.07, 0.28))
    beam = model_of(find_case(BEAM[1]))
    bodies["beam"] = (beam, beam.external_forces())
    print("body                    rows   without           with         ratio of times")
    for name, (model, load) in bodies.items():
        times: dict[bool, list[float]] = {False: [], True: []}
        iterations = {}
        solvers = {wanted: EquilibriumSolver(System(model, "cpu")) for wanted in times}
        for _ in range(6):
            for wanted, solver in solvers.items():
                linear._WORTH_A_COARSE_SPACE = 0 if wanted else 10**9
                began = time.process_time()
                history = solver.solve(load).history
                times[wanted].append(time.process_time() - began)
                iterations[wanted] = sum(step.cg_iterations for step in history)
        without, with_space = (1e3 * float(np.median(times[wanted][1:])) for wanted in times)
        print(
            f"{name:22} {len(load):6} {without:6.0f} ms, {iterations[False]:5} {with_space:6.0f} ms, "
            f"{iterations[True]:5}   {with_space / without:.2f}"
        )


if __name__ == "__main__":
    main()
