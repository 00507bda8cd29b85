"""A body with all the walls of a brain, small enough to know by heart."""

import numpy as np
from shapes import cube

from concealed.body import Body, body_of
from warpbrain.mesh import TetMesh


def hollow(side: str = "left") -> tuple[Body, TetMesh]:
    """A cube of 14 cm with a hole, a corner at the left front to be taken out, held below; and what it was before."""
    mesh = cube(7)
    points = 0.14 * mesh.points
    middle = points[mesh.tetrahedra].mean(axis=1)
    hole = (np.abs(middle - 0.07) < 0.01).all(axis=1)
    whole, _, _ = TetMesh(
        points, mesh.tetrahedra, np.ones(len(middle), dtype=np.int32), {"fixed": points[:, 2] == 0.0}
    ).without(hole)
    middle = whole.points[whole.tetrahedra].mean(axis=1)
    corner = (middle[:, 0] < 0.04) & (middle[:, 1] > 0.10) & (middle[:, 2] > 0.08)
    whole = TetMesh(whole.points, whole.tetrahedra, whole.tissue, whole.node_sets, {"resection": corner})
    return body_of(whole, side), whole
