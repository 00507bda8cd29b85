"""Bodies with voids in a row, held at one end, and cases of them."""

from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean


def case_of(mesh: TetMesh, tissue: str = "gel") -> Case:
    boundaries = (Fixed(name="table", nodes="fixed"),)
    law = {1: Tissue(tissue, NeoHookean(1000.0))}
    return Case("a", "A", "synthetic", Path("a/case.toml"), mesh, law, 1000.0, 0.45, boundaries=boundaries)


def voids(axis: int, count: int = 2, sets: tuple[str, ...] = ()) -> TetMesh:
    """A block with voids in a row along an axis, held in one corner."""
    cells = np.full(3, 3)
    cells[axis] = 2 * count + 1
    block = box(tuple(cells.tolist()), tuple((0.01 * cells).tolist()))
    cell = np.floor(block.centres / 0.01).astype(int)
    others = np.delete(cell, axis, axis=1)
    hole = (others == 1).all(axis=1) & (cell[:, axis] % 2 == 1)
    mesh, _, _ = block.without(hole)
    mesh = TetMesh(mesh.points, mesh.tetrahedra)
    named = {"fixed": (mesh.points < 0.0101).all(axis=1)}
    size = mesh.points.max(axis=0)
    named |= {name: ((mesh.points > 1e-6) & (mesh.points < size - 1e-6)).all(axis=1) for name in sets}
    return mesh.with_node_sets(named)
