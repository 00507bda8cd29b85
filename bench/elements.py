"""What kinds of elements are worth: `python bench/elements.py [cpu|cuda:0] [brain | cells ...]`, to results/elements_*.

`brain` measures the first of three bodies alone, into a file of its own.

A brain at nu = 0.45 (case 0529 as declared: its weight above the level of the fluid): how far the wall of its
ventricles moves in the mean, on its own mesh and with every element cut into eight. Two bodies near incompressibility,
and what they cost:

- a block of irregular tetrahedra, clamped at one end, that bends a little under its weight, beside P2-P1 elements of
  scikit-fem on the same mesh: the work of the weight;
- Cook's membrane (48 x 44/16 mm, one layer in plane strain, mu = 0.4225 N/mm2, 1 N upwards, uncoupled neo-Hookean) of
  regular ones: the height by which the middle of its right side rises.
"""

from __future__ import annotations

import datetime
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, surface_forces, volume_forces
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.mesh_error import FinerCase
from warpbrain.simulation.model import ELEMENTS, Material, Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from taylor_hood import SHEAR_MODULUS, WEIGHT, block, clamped, taylor_hood_work

DEVICE = sys.argv[1] if len(sys.argv) > 1 else "cpu"
BRAIN_ALONE = sys.argv[2:] == ["brain"]
CELLS = [] if BRAIN_ALONE else [int(n) for n in sys.argv[2:]] or [8, 16, 32]
POISSON = (0.49, 0.499)
#: Of the block: points moved at random, along its height less one; and Poisson ratios.
BLOCK_CELLS, BLOCK_POISSON = (3, 4, 6), (0.45, 0.49, 0.499, 0.4999)
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
    row = {
        "body": "Cook's membrane",
        "cells": n,
        "poisson": poisson,
        "elements": elements,
        "nodes": system.size,
        "blocks": system.matrix.nnz,
    }
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


def sag(n: int, poisson: float, elements: str, reference: float) -> dict[str, Any]:
    """One row of the table of the block; `reference` is what `taylor_hood_work` says."""
    mesh = block(n)
    material = Material(NeoHookean(SHEAR_MODULUS), poisson, "uncoupled")
    system = System(Model(mesh, {1: material}, constrained=clamped(mesh.points), elements=elements), DEVICE)
    force = volume_forces(system.quadratic or mesh, lambda x: np.tile(WEIGHT, (len(x), 1)))
    system.load_kernels()
    start = time.perf_counter()
    state = EquilibriumSolver(system, EquilibriumOptions(max_cg=100_000)).solve(external=force)
    work = float(np.vdot(force, state.u))
    return {
        "body": "irregular block",
        "cells": n,
        "poisson": poisson,
        "elements": elements,
        "tetrahedra": len(mesh.tetrahedra),
        "nodes": system.size,
        "blocks": system.matrix.nnz,
        "work_J": work,
        "work_of_P2_P1_J": reference,
        "error": work / reference - 1.0,
        "newton": len(state.history),
        "cg_iterations": sum(one.cg_iterations for one in state.history),
        "seconds": time.perf_counter() - start,
    }


def sink(elements: str, finer: bool) -> dict[str, Any]:
    """How far the wall of the ventricles of case 0529 moves."""
    case = find_case("0529")
    model = model_of(case)
    wall = np.flatnonzero(model.mesh.node_sets["ventricle"])
    model = replace(FinerCase(case).model(model) if finer else model, elements=elements)
    # of the mesh's own nodes: those in between follow the elements
    model = replace(model, constrained=model.constrained[: len(model.mesh.points)], prescribed=None)
    system = System(model, DEVICE)
    system.load_kernels()
    start = time.perf_counter()
    state = EquilibriumSolver(system, EquilibriumOptions(max_cg=100_000)).solve()
    return {
        "body": "0529",
        "elements": elements,
        "cut_into_eight": finer,
        "nodes": system.size,
        "blocks": system.matrix.nnz,
        "mean_motion_of_ventricles_mm": 1e3 * float(np.linalg.norm(state.u[wall], axis=1).mean()),
        "weight_N": float(np.linalg.norm(model.external_forces().sum(axis=0))),
        "newton": len(state.history),
        "cg_iterations": sum(one.cg_iterations for one in state.history),
        "seconds": time.perf_counter() - start,
    }


if __name__ == "__main__":
    what = "elements_brain" if BRAIN_ALONE else "elements"
    name = f"{what}_{DEVICE.split(':')[0]}_{datetime.date.today().isoformat()}.json"
    rows: list[dict[str, Any]] = []

    def keep(row: dict[str, Any]) -> None:
        rows.append(row)
        print(row, flush=True)
        text = json.dumps(rows, indent=1) + "\n"
        (Path(__file__).parent / "results" / name).write_text(text, encoding="utf-8")

    for elements in ELEMENTS:
        keep(sink(elements, finer=False))
    for elements in ("tet4", "tet4-averaged"):
        keep(sink(elements, finer=True))
    for n in () if BRAIN_ALONE else BLOCK_CELLS:
        for poisson in BLOCK_POISSON:
            reference = taylor_hood_work(block(n), poisson)
            for elements in ELEMENTS:
                keep(sag(n, poisson, elements, reference))
    for poisson in POISSON:
        for n in CELLS:
            for elements in ELEMENTS:
                keep(bend(n, poisson, elements))
