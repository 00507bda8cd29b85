"""Small bodies drawn at random: a distorted block of one or two tissues, what acts on it, and tracked points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.boundary import Boundary, Displaced, Fixed, Forced, Pressed
from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Noise of what is recorded [m].
NOISE = 1e-4
_DOWN, _DENSITY = (0.0, 0.0, -1.0), 1000.0
_PRIORS = ("hyperelastic/grey matter", "hyperelastic/white matter")


def drawn_case(seed: int, points: int = 40, cells: tuple[int, int] = (2, 3)) -> Case:
    """A case; `cells` is the range of cells along an edge."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(*cells, 3, endpoint=True)
    lengths = rng.uniform(0.04, 0.08, 3)
    mesh = box((int(counts[0]), int(counts[1]), int(counts[2])), (lengths[0], lengths[1], lengths[2]))
    z = mesh.points[:, 2]
    sets = {"bottom": z == 0.0, "top": z == z.max()}
    # off the lattice: no two places are alike
    moved = mesh.points + 0.08 * (lengths / counts) * rng.uniform(-1.0, 1.0, mesh.points.shape)
    tissues = int(rng.integers(1, 3))
    centres = moved[mesh.tetrahedra].mean(axis=1)
    labels = np.where(centres[:, 0] < np.median(centres[:, 0]), 1, tissues)
    mesh = TetMesh(moved, mesh.tetrahedra, labels, sets, {})
    boundaries, mechanisms = _loads(rng)
    case = Case(
        "drawn", "Drawn", "synthetic", Path("drawn/case.toml"), mesh,
        {k: Tissue(f"tissue {k}", NeoHookean(rng.uniform(700.0, 2500.0)), prior=_PRIORS[k - 1])
         for k in range(1, tissues + 1)},
        _DENSITY, 0.45, gravity_axis=_DOWN, boundaries=boundaries, mechanisms=mechanisms,
    )  # fmt: skip
    where = mesh.points.min(axis=0) + rng.uniform(0.12, 0.88, (points, 3)) * np.ptp(mesh.points, axis=0)
    u = locate(mesh.points, mesh.tetrahedra, where).interpolate(displacement(case))
    recording = PointsRecording(
        name="beads", file="beads.csv", sigma=NOISE, points=where, displacement=u + NOISE * rng.normal(size=u.shape),
        outside="nearest",
    )  # fmt: skip
    return _with(case, recording)


def _with(case: Case, recording: PointsRecording) -> Case:
    return replace(case, recordings=(recording,))


def _loads(rng: np.random.Generator) -> tuple[tuple[Boundary, ...], tuple[Mechanism, ...]]:
    table = Fixed(name="table", nodes="bottom")
    kind = rng.integers(4)
    if kind == 0:
        return (table, Forced(name="finger", nodes="top", total=_three(0.1 * rng.normal(size=3)))), ()
    if kind == 1:
        shift = Displaced(name="plate", nodes="top", times=(0.0,), values=(_three(2e-3 * rng.normal(size=3)),))
        return (table, shift), ()
    if kind == 2:
        return (table, Pressed(name="air", nodes="top", value=float(rng.uniform(20.0, 80.0)))), ()
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    # as a file says it: of the body's density, and imaged as the case's axis says
    return (table,), (Gravity(direction=_three(direction), imaged_direction=_DOWN, density=_DENSITY),)


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def displacement(case: Case, tolerance: float = 1e-10) -> np.ndarray:
    """Of all nodes (n, 3) [m] at rest, as `warpbrain run --tolerance` has it."""
    model = model_of(case)
    options = EquilibriumOptions(tolerance=tolerance)
    return EquilibriumSolver(System(model, "cpu"), options).solve(model.external_forces()).u
