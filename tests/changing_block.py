"""A block of gel with tracked points under loads that change while it is recorded."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.moments import case_at
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Edge and noise [m].
SIDE, NOISE = 0.06, 5e-5
DOWN = (0.0, 0.0, -1.0)


def block(cells: int = 5, mechanisms: tuple[Mechanism, ...] = ()) -> Case:
    """A block on a table, of which nothing was recorded."""
    mesh = box((cells, cells, cells), (SIDE, SIDE, SIDE))
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    one = np.ones(len(mesh.tetrahedra), dtype=np.int32)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, one, {"bottom": z == 0.0, "side": x == x.max()}, {})
    return Case(
        "changing",
        "A block",
        "synthetic",
        Path("changing/case.toml"),
        mesh,
        {1: Tissue("gel", NeoHookean(1000.0))},
        1000.0,
        0.45,
        gravity_axis=DOWN,
        boundaries=(Fixed(name="table", nodes="bottom"),),
        mechanisms=mechanisms,
    )


def level(height: float, ramp: Sequence[tuple[float, float]] = ()) -> Gravity:
    """The weight of what is above a level [m] of the fluid."""
    return Gravity(direction=DOWN, imaged_direction=DOWN, density=1000.0, csf_level=height, lowest=0.0, ramp=ramp)


def falling(times: Sequence[float], heights: Sequence[float]) -> tuple[Gravity, ...]:
    """A level that falls through heights [m] at times [s]."""
    hats = np.eye(len(times))
    return tuple(level(h, tuple(zip(times, hat.tolist(), strict=True))) for h, hat in zip(heights, hats, strict=True))


def displacements(case: Case, times: Sequence[float]) -> dict[float, np.ndarray]:
    """Of all nodes (N, 3) [m] at rest under what acts at each time: each solved by itself."""
    found = {}
    for time in times:
        model = model_of(case_at(case, time))
        found[time] = EquilibriumSolver(System(model, "cpu")).solve().u
    return found


def recorded(
    truth: Case,
    times: Sequence[float],
    points: int = 20,
    *,
    name: str = "beads",
    role: str = "fit",
    reference: float | None = None,
    noise: float = NOISE,
    seed: int = 7,
) -> PointsRecording:
    """Points of a body in which all of `truth` acts, with noise."""
    rng = np.random.default_rng(seed)
    where = rng.uniform(0.05, 0.95, size=(points, 3)) * SIDE
    matrix = locate(truth.mesh.points, truth.mesh.tetrahedra, where).matrix(len(truth.mesh.points))
    fields = displacements(truth, [*times, *([] if reference is None else [reference])])
    start = 0.0 if reference is None else fields[reference]
    moved = np.concatenate([matrix @ (fields[time] - start) for time in times])
    return PointsRecording(
        name=name,
        file=f"{name}.csv",
        role=role,
        sigma=NOISE,
        reference=reference,
        points=np.tile(where, (len(times), 1)),
        displacement=moved + noise * rng.normal(size=moved.shape),
        time=np.repeat(times, points).astype(float),
    )


def without(truth: Case, recordings: Sequence[PointsRecording]) -> Case:
    """The case with what was recorded, of which it leaves out all mechanisms."""
    return replace(truth, mechanisms=(), recordings=tuple(recordings))
