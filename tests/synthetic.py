"""A small case whose tissue is known: a block of one or two tissues, what moves it, and what would be recorded."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapes import box

from warpbrain.cases.boundary import Boundary, Displaced, Fixed, Forced
from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import Law, NeoHookean
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.recording import ForceRecording, PointsRecording, SurfaceRecording
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.result import Result, result_of
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
SIDE = 0.05
#: Grey above, white below.
GREY, WHITE = NeoHookean(1370.0), NeoHookean(1000.0)


def block(laws: Mapping[str, Law], load: str, cells: int = 3, formulation: str = "coupled") -> Case:
    """A block that stands on a table: a tissue for each law, in layers; a load that is a weight, a push or a motion."""
    mesh = box((cells, cells, cells), (SIDE, SIDE, SIDE))
    height = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 2]
    tissue = 1 + np.minimum((height / SIDE * len(laws)).astype(int), len(laws) - 1)
    z = mesh.points[:, 2]
    mesh = TetMesh(mesh.points, mesh.tetrahedra, tissue, node_sets={"bottom": z < 1e-9, "top": z > SIDE - 1e-9})
    boundaries: list[Boundary] = [Fixed(name="table", nodes="bottom")]
    mechanisms = ()
    if load == "moved":
        boundaries.append(Displaced(name="plate", nodes="top", times=(0.0,), values=((0.004, 0.0, -0.005),)))
    elif load == "pushed":
        boundaries.append(Forced(name="finger", nodes="top", total=(0.1, 0.05, -0.2)))
    else:
        mechanisms = (Gravity(direction=(1.0, 0.0, -1.0), density=1000.0),)
    groups = ("hyperelastic/brain",) if len(laws) == 1 else ("hyperelastic/grey matter", "hyperelastic/white matter")
    tissues = {
        label: Tissue(name, law, formulation, group, law.name)
        for label, ((name, law), group) in enumerate(zip(laws.items(), groups, strict=True), start=1)
    }
    return Case(
        "block", "A block", "synthetic", Path("block/case.toml"), mesh, tissues, 1000.0, 0.45,
        boundaries=tuple(boundaries), mechanisms=mechanisms,
    )  # fmt: skip


def truth(case: Case, elements: str = "tet4") -> Result:
    """The state of a case under its own laws."""
    system = System(replace(model_of(case), elements=elements), "cpu")
    solve_equilibrium(system, EquilibriumOptions(tolerance=1e-12))
    return result_of(system)


def beads(
    result: Result, count: int = 40, noise: float = 0.0, sigma: float | None = 1e-4, seed: int = 0
) -> PointsRecording:
    """Points spread inside the block, recorded with normal noise [m]."""
    return beads_of(result.mesh, result.u, count, noise, sigma, seed)


def beads_of(
    mesh: TetMesh, u: Floats, count: int = 40, noise: float = 0.0, sigma: float | None = 1e-4, seed: int = 0
) -> PointsRecording:
    """The same of a displacement (n, 3) [m] of the nodes of a mesh of the block."""
    from warpbrain.recordings.location import locate

    rng = np.random.default_rng(seed)
    points = rng.uniform(0.02 * SIDE, 0.98 * SIDE, (count, 3))
    moved = locate(mesh.points, mesh.tetrahedra, points).interpolate(u)
    return PointsRecording(
        name="beads", file="", points=points, displacement=moved + noise * rng.normal(size=moved.shape), sigma=sigma
    )


def lid(result: Result, sigma: float | None = 1e-4) -> SurfaceRecording:
    """Points on the moved top, none of them a node."""
    from warpbrain.mesh.free_surfaces import faces_of_set

    faces = faces_of_set(result.mesh, "top", "test")
    weights = np.random.default_rng(1).dirichlet([2.0, 2.0, 2.0], len(faces))
    points = np.einsum("fi,fij->fj", weights, (result.mesh.points + result.u)[faces])
    return SurfaceRecording(name="lid", file="", points=points, nodes="top", sigma=sigma)


def scale(case: Case, result: Result, boundary: str, sigma: float | None = 1e-4) -> ForceRecording:
    """What holds a boundary, over time."""
    force = result.reactions[result.mesh.node_sets[case.boundary(boundary).nodes]].sum(axis=0)
    return ForceRecording(
        name="scale",
        file="",
        boundary=boundary,
        time=np.array([0.0, 1.0]),
        force=np.array([0.0 * force, force]),
        sigma=sigma,
    )


def with_laws(case: Case, *laws: Law) -> Case:
    """The case under other laws, as where an estimation starts."""
    tissues = {label: replace(tissue, law=law) for (label, tissue), law in zip(case.tissues.items(), laws, strict=True)}
    return replace(case, tissues=tissues)
