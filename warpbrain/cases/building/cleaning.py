"""What every mesh goes through: crumbs removed, touching surfaces opened, angles made good."""

from itertools import product

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.building.lattice import Field, cut
from warpbrain.cases.building.mmg import Cells
from warpbrain.errors import InputError
from warpbrain.mesh import boundary_faces, pinched_nodes, split_boundary
from warpbrain.mesh.quality import components, dihedral_angles, measure_arrays
from warpbrain.mesh.surface import FACES, face_vectors, interface_faces, node_vectors, paired_faces, unit
from warpbrain.mesh.tet_mesh import signed_volumes

# pieces of a tissue smaller than this [mm3, template] go to their neighbour
SMALLEST_PIECE = 2000.0
# bars a finished mesh must clear, and what the last step aims at [degrees]
MIN_DIHEDRAL = 15.0
FIRST_PERCENTILE = 20.0
WANTED_DIHEDRAL = 22.0


def small_pieces(cells: Cells, region: Bools, keep_largest: bool = False, smallest: float = SMALLEST_PIECE) -> Bools:
    """The tetrahedra of a region (m,) in its face-connected pieces smaller than `smallest` [mm3]: (m,) bool.

    With `keep_largest` those of all pieces but the largest, whatever their size.
    """
    members = np.flatnonzero(region)
    result = np.zeros(len(region), dtype=bool)
    if len(members):
        piece = components(cells.tetrahedra[members])
        volume = np.bincount(piece, weights=signed_volumes(cells.points, cells.tetrahedra[members]))
        small = np.arange(len(volume)) != volume.argmax() if keep_largest else volume < smallest
        result[members[small[piece]]] = True
    return result


def opened_out(tetrahedra: Ints, inside: Bools) -> Bools:
    """Fill around the nodes where the surface touches itself, until it does so nowhere: (m,) bool."""
    for _ in range(20):
        touching = pinched_nodes(boundary_faces(tetrahedra[inside]))
        if len(touching) == 0:
            return inside
        inside = inside | np.isin(tetrahedra, touching).any(axis=1)
    raise InputError("the surface of the brain touches itself, and filling there did not help")


def cut_body(cells: Cells, body: Field, cavity: Field, smallest: float, notes: list[str]) -> Cells:
    """What of a lattice is inside a body and outside of its cavities, by fields that are positive in these: cut along
    their surfaces, in one piece, and touching itself nowhere.

    Cavities below a volume [mm3] are filled, as are pockets outside that the lattice pinched off; what a user should
    know of it is noted.
    """
    cells, inside = cut(cells, body)
    pockets = small_pieces(cells, ~inside, keep_largest=True)
    if (filled := _volume(cells, pockets)) > smallest / 2:
        notes.append(f"clefts narrower than an element close: {filled / 1000:.3g} cm3 of outside become tissue")
    inside = inside | pockets
    inside = _in_one_piece(cells, inside, notes, "pieces that hang together by less than an element")
    cells, fluid = cut(cells.part(opened_out(cells.tetrahedra, inside)), cavity)
    fluid &= ~small_pieces(cells, fluid, smallest=smallest)
    tissue = _in_one_piece(cells, ~fluid, notes, "pieces of tissue that float in a cavity")
    return cells.part(opened_out(cells.tetrahedra, tissue))


def _volume(cells: Cells, region: Bools) -> float:
    return float(signed_volumes(cells.points, cells.tetrahedra[region]).sum())


def _in_one_piece(cells: Cells, region: Bools, notes: list[str], what: str) -> Bools:
    """The largest piece of a region; what is dropped is noted if it can be seen."""
    dropped = small_pieces(cells, region, keep_largest=True)
    lost = _volume(cells, dropped)
    share = lost / _volume(cells, region)
    if share > 1e-4:
        notes.append(f"{what} are left out: {lost / 1000:.3g} cm3 ({100 * share:.2g} %)")
    return region & ~dropped


def finished(cells: Cells, cavities: int | None = 1, easier: float = 0.0) -> Cells | None:
    """Open the sharp angles; None if the mesh is not good enough to ship, with bars that are `easier` by some degrees
    and a number of closed surfaces inside (None: any)."""
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


def crumbs_given_away(cells: Cells, smallest: float) -> Ints:
    """Labels (m,) without face-connected pieces of one label below a volume [mm3], of a mesh in one piece [mm]: these
    have the label of the larger piece with which they share the most area, starting with those that touch one."""
    points, tetrahedra, labels = cells.points, cells.tetrahedra, cells.labels.copy()
    volumes = signed_volumes(points, tetrahedra)
    pairs, _ = paired_faces(tetrahedra)
    owner = pairs // 4
    triangles = tetrahedra[owner[:, :1], FACES[pairs[:, 0] % 4]]
    area = np.linalg.norm(face_vectors(points, triangles), axis=1)
    while True:
        piece = components(tetrahedra, labels)
        volume = np.bincount(piece, weights=volumes)
        small = volume < smallest
        side = piece[owner]
        # faces between a small piece and one that stays, the small one first
        side, weight = np.concatenate([side, side[:, ::-1]]), np.concatenate([area, area])
        at = small[side[:, 0]] & ~small[side[:, 1]]
        if not at.any():
            return labels
        label_of = np.zeros(len(volume), dtype=np.int64)
        label_of[piece] = labels
        touched, shared = np.unique(np.stack([side[at, 0], label_of[side[at, 1]]], axis=1), axis=0, return_inverse=True)
        total = np.bincount(shared.ravel(), weights=weight[at])
        # the last of each piece in this order has the most area
        for number in np.argsort(total, kind="stable"):
            label_of[touched[number, 0]] = touched[number, 1]
        labels = label_of[piece]


SWEEPS = 12
# steps tried, as shares of the mean length of the edges at the node
STEPS = (0.3, 0.15, 0.07, 0.03)
# how far from its surface [share of that length] a boundary or interface node may end, so that surfaces stay smooth
LIFT = 0.1


def open_angles(cells: Cells, wanted: float) -> Cells:
    """Improve every tetrahedron whose smallest dihedral angle is below a bar [degrees], as far as its nodes allow:
    worst first, one node after the other.

    A move is made only if the smallest angle of all tetrahedra around the node grows, so no tetrahedron can turn over.
    Nodes on surfaces move along them.
    """
    points = cells.points.copy()
    tets = cells.tetrahedra
    # elements around each node
    ends = np.cumsum(np.bincount(tets.ravel(), minlength=len(points)))
    owners = np.split(np.argsort(tets.ravel(), kind="stable") // 4, ends[:-1])
    normals = _normals(cells)
    lifted = np.zeros(len(points))
    for _ in range(SWEEPS):
        worst = dihedral_angles(points, tets).min(axis=1)
        bad = np.flatnonzero(worst < wanted)
        nodes = dict.fromkeys(tets[bad[np.argsort(worst[bad], kind="stable")]].ravel().tolist())
        moved = sum(_improve(int(node), points, tets[owners[node]], normals[node], lifted) for node in nodes)
        if not moved:
            break
    return Cells(points, tets, cells.labels)


def _normals(cells: Cells) -> list[Floats]:
    """Directions each node must not move in: none inside, the normal of its surface, two where surfaces meet."""
    surfaces = (
        boundary_faces(cells.tetrahedra),
        interface_faces(cells.tetrahedra, cells.labels % 10),
        interface_faces(cells.tetrahedra, cells.labels // 10),
    )
    normals = np.stack([unit(node_vectors(cells.points, faces)) for faces in surfaces], axis=1)
    return [rows[rows.any(axis=1)] for rows in normals]


_CORNERS = np.array([ijk for ijk in product((-1.0, 0.0, 1.0), repeat=3) if any(ijk)])
_DIRECTIONS = _CORNERS / np.linalg.norm(_CORNERS, axis=1, keepdims=True)


def _improve(node: int, points: Floats, star: Ints, normals: Floats, lifted: Floats) -> bool:
    """Move one node to the best of the positions tried; true if it moved."""
    start = points[node].copy()
    around = points[np.unique(star[star != node])]
    length = float(np.linalg.norm(around - start, axis=1).mean())
    free = _DIRECTIONS
    if len(normals):
        basis = np.linalg.svd(normals, full_matrices=True)[2]
        tangent = basis[np.linalg.matrix_rank(normals, tol=0.2) :]
        free = _DIRECTIONS @ (tangent.T @ tangent)
    candidates = start + length * np.concatenate([step * free for step in STEPS])
    if len(normals):
        # off the surface by no more than the lift, over all sweeps together
        room = max(LIFT * length - lifted[node], 0.0)
        candidates = np.concatenate([candidates, start + room * np.concatenate([_DIRECTIONS, 0.4 * _DIRECTIONS])])
    corners = np.repeat(points[star][None], len(candidates) + 1, axis=0)
    corners[1:][:, star == node] = candidates[:, None]
    flat = corners.reshape(-1, 4, 3)
    cell = np.arange(len(flat) * 4).reshape(-1, 4)
    angles = dihedral_angles(flat.reshape(-1, 3), cell).min(axis=1)
    angles[signed_volumes(flat.reshape(-1, 3), cell) <= 0] = -1
    score = angles.reshape(len(candidates) + 1, -1).min(axis=1)
    best = int(score.argmax())
    if score[best] <= score[0] + 1e-3:
        return False
    points[node] = candidates[best - 1]
    if len(normals):
        lifted[node] += float(np.abs(normals @ (points[node] - start)).max())
    return True
