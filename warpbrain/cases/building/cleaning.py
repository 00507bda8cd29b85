"""What every mesh goes through: crumbs removed, touching surfaces opened, angles made good."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.errors import BuildError
from warpbrain.cases.building.optimising import open_angles
from warpbrain.cases.building.remeshing import Cells, remesh
from warpbrain.mesh import boundary_faces, pinched_nodes, split_boundary
from warpbrain.mesh.quality import components, measure_arrays
from warpbrain.mesh.tet_mesh import signed_volumes

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

# pieces of a tissue smaller than this [mm3, template] go to their neighbour
SMALLEST_PIECE = 2000.0
# largest edge [mm] of the first pass, which only takes out the needles left by the cutting
FIRST_EDGE = 8.0
# bars a finished mesh must clear, and what the last step aims at [degrees]
MIN_DIHEDRAL = 15.0
FIRST_PERCENTILE = 20.0
WANTED_DIHEDRAL = 22.0


def small_pieces(
    points: Floats, tetrahedra: Integers, region: Bools, keep_largest: bool = False, smallest: float = SMALLEST_PIECE
) -> Bools:
    """The tetrahedra of a region (m,) in its face-connected pieces smaller than `smallest` [mm3]: (m,) bool.

    With `keep_largest` those of all pieces but the largest, whatever their size.
    """
    members = np.flatnonzero(region)
    if len(members) == 0:
        return np.zeros(len(tetrahedra), dtype=bool)
    piece = components(tetrahedra[members])
    volume = np.bincount(piece, weights=signed_volumes(points, tetrahedra[members]))
    small = np.arange(len(volume)) != volume.argmax() if keep_largest else volume < smallest
    result = np.zeros(len(tetrahedra), dtype=bool)
    result[members[small[piece]]] = True
    return result


def opened_out(tetrahedra: Integers, inside: Bools) -> Bools:
    """Fill around the nodes where the surface touches itself, until it does so nowhere: (m,) bool."""
    for _ in range(20):
        touching = pinched_nodes(boundary_faces(tetrahedra[inside]))
        if len(touching) == 0:
            return inside
        inside = inside | np.isin(tetrahedra, touching).any(axis=1)
    raise BuildError("the surface of the brain touches itself, and filling there did not help")


def first_pass(cells: Cells, edge: float = FIRST_EDGE) -> Cells:
    """Take out the needles that the cutting left; `edge` is the largest one [mm]."""
    made = remesh(cells, edge)
    if made is None:
        raise BuildError("MMG could not mesh the cut lattice")
    return made


def finished(cells: Cells, cavities: int | None = 1, easier: float = 0.0) -> Cells | None:
    """Open the sharp angles; None if the mesh is not good enough to ship.

    Parameters
    ----------
    cells : Cells
    cavities : int or None
        How many closed surfaces inside there must be; None: any number.
    easier : float
        How much lower [degrees] the bars for the angles are.
    """
    better = open_angles(cells, WANTED_DIHEDRAL)
    quality = measure_arrays(better.points * 1e-3, better.tetrahedra.astype(np.int32), better.labels.astype(np.int32))
    sound = (
        quality.inverted == 0
        and quality.components == 1
        and quality.min_dihedral >= MIN_DIHEDRAL - easier
        and quality.first_percentile_dihedral >= FIRST_PERCENTILE - easier
        and (cavities is None or len(split_boundary(better.points, better.tetrahedra)[1]) == cavities)
        and len(pinched_nodes(boundary_faces(better.tetrahedra))) == 0
    )
    return better if sound else None
