"""What kinds of elements are worth: `python bench/elements.py [cpu|cuda:0] [cells ...]` writes results/elements_*.json.

Cook's membrane (48 x 44/16 mm, one layer in plane strain, mu = 0.4225 N/mm2, 1 N upwards, uncoupled neo-Hookean), the
height by which the middle of its right side rises, and what that costs.
"""

from __future__ import annotations

import datetime
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, surface_forces
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import ELEMENTS, Material, Model
from warpbrain.simulation.system import System

DEVICE = sys.argv[1] if len(sys.argv) > 1 else "cpu"
CELLS = [int(n) for n in sys.argv[2:]] or [8, 16, 32]
POISSON = (0.49, 0.499)
#: The cube of the verification tests, each cell of six tetrahedra along its main diagonal.
_PATHS = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))


def membrane(n: int) -> TetMesh:
    """n x n cells in one layer of 1 mm."""
    axes = [np.linspace(0.0, 1.0, count + 1) for count in (n, n, 1)]
    x, y, z = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3).T
    low, high = 44.0 * x, 44.0 + 16.0 * x
    points = np.stack([48.0 * x, (1.0 - y) * low + y * high, z], axis=1)
    corner = np.stack(np.meshgrid(np.arange(n), np.arange(n), [0], indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([2 * (n + 1), 2, 1])
    paths = []
    for order in _PATHS:
        steps = np.vstack([np.zeros(3, int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        paths.append(np.stack([(corner + step) @ stride for step in steps], -1))
    tetrahedra = np.concatenate(paths)
    flip = np.linalg.det(points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]) < 0.0
    tetrahedra[flip] = tetrahedra[flip][:, [0, 2, 1, 3]]
    return TetMesh(points, tetrahedra)


def bend(n: int, poisson: float, elements: str) -> dict[str, Any]:
    """One row of the table."""
    mesh = membrane(n)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[:, 2] = True
    constrained[mesh.points[:, 0] < 1e-9] = True
    materials = {1: Material(NeoHookean(0.4225), poisson, "uncoupled")}
    system = System(Model(mesh, materials, constrained=constrained, elements=elements), DEVICE)
    force = surface_forces(system.quadratic or mesh, lambda x: np.outer(x[:, 0] > 48.0 - 1e-9, [0.0, 1.0 / 16.0, 0.0]))
    system.load_kernels()
    row = {"cells": n, "poisson": poisson, "elements": elements, "nodes": system.size, "blocks": system.matrix.nnz}
    # plain elements do not bear the whole load at once
    for step in (1.0, 0.2):
        solver = EquilibriumSolver(system, EquilibriumOptions(max_load_step=step, max_cg=40_000))
        start = time.perf_counter()
        try:
            state = solver.solve(external=force)
        except SolveError:
            continue
        tip = int(np.argmin(np.linalg.norm(mesh.points - [48.0, 52.0, 1.0], axis=1)))
        return row | {
            "tip_mm": float(state.u[tip, 1]),
            "newton": len(state.history),
            "cg_iterations": sum(one.cg_iterations for one in state.history),
            "seconds": time.perf_counter() - start,
        }
    return row | {"tip_mm": None}


if __name__ == "__main__":
    name = f"elements_{DEVICE.split(':')[0]}_{datetime.date.today().isoformat()}.json"
    rows = []
    for poisson in POISSON:
        for n in CELLS:
            for elements in ELEMENTS:
                rows.append(bend(n, poisson, elements))
                print(rows[-1], flush=True)
                text = json.dumps(rows, indent=1) + "\n"
                (Path(__file__).parent / "results" / name).write_text(text, encoding="utf-8")
