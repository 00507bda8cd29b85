"""Blocks of gel that are held on one side."""

from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean


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
