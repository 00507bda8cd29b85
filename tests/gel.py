"""Blocks of gel that are held on one side, and beads that were tracked in them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording


def block_of_gel(cells: tuple[int, int, int], sides: tuple[float, float, float], axis: int, mu: float, **more) -> Case:
    """A case of a block with sides [m] whose nodes at zero along an axis are fixed, of shear modulus `mu` [Pa].

    `more`: further fields of the case.
    """
    solid = box(cells, sides)
    mesh = TetMesh(solid.points, solid.tetrahedra, node_sets={"foot": np.abs(solid.points[:, axis]) < 1e-9})
    return Case(
        name="block",
        title="A block of gel",
        origin="synthetic",
        path=Path("case.toml"),
        mesh=mesh,
        tissues={label: Tissue("gel", NeoHookean(mu)) for label in mesh.labels},
        density=1000.0,
        poisson=0.45,
        boundaries=(Fixed(name="foot", nodes="foot"),),
        **more,
    )


def with_beads(
    case: Case, u: np.ndarray, at: np.ndarray, noise: float, rng: np.random.Generator, mesh: TetMesh | None = None
) -> Case:
    """A case that records a displacement of nodes (N, 3) [m] at points (n, 3) [m], with noise [m] of each axis.

    `mesh`: of these nodes; the case's own unless given.
    """
    mesh = case.mesh if mesh is None else mesh
    moved = locate(mesh.points, mesh.tetrahedra, at).interpolate(u) + noise * rng.normal(size=at.shape)
    beads = PointsRecording(name="beads", file="beads.csv", role="fit", points=at, displacement=moved, sigma=noise)
    return replace(case, recordings=(beads,))
