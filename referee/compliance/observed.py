"""The rows of everything that a case records to be fitted, and how each reads a displacement of the declared body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from referee.compliance.neo_hookean import NeoHookeanBody
from referee.errors import InputError
from referee.faces import Floats
from warpbrain.mesh import boundary_faces
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording

#: Noise that is taken where none is declared [m].
SIGMA = 0.35e-3


@dataclass(frozen=True, eq=False)
class Observed:
    """Rows of points (three each, at each time), of the wall along its normals, and of a force.

    Attributes
    ----------
    place, direction : (rows, 3) array
        At rest [m], and along what.
    kind : (rows,) array of str
        "displacement", "wall" or "force".
    point : (rows,) int array
        Rows of one number are of one point at one time: a gross error is in all of them.
    time : (rows,) array
        [s]; NaN where none is told.
    sigma : (rows,) array
        Declared noise [m] or [N]; `SIGMA` where none is declared.
    declares : bool
        Whether the case declares the noise of its points.
    recorded : (rows,) array
        [m] or [N]
    reading : (rows, 3 n) sparse array
        What reads displacements and, of a force, the change of internal forces by the tangent.
    force_nodes : (n,) bool array
        Nodes whose force is read.
    """

    place: Floats
    direction: Floats
    kind: NDArray[np.str_]
    point: NDArray[np.int64]
    time: Floats
    sigma: Floats
    declares: bool
    recorded: Floats
    reading: csr_matrix
    force_nodes: NDArray[np.bool_]


def observed(body: NeoHookeanBody, tangent: csr_matrix) -> Observed:
    """The rows of a case, about its declared state.

    Raises
    ------
    InputError
        If the case has a recording of another kind, or no points.
    """
    parts: list[tuple[str, Floats, Floats, Floats, float, Floats, csr_matrix]] = []
    nodes = np.zeros(len(body.mesh.points), dtype=bool)
    declares = True
    for recording in body.case.recordings:
        if recording.role != "fit":
            continue
        if isinstance(recording, PointsRecording):
            declares = recording.sigma is not None
            parts.append(_points(body, recording))
        elif isinstance(recording, SurfaceRecording):
            parts.append(_wall(body, recording))
        elif isinstance(recording, ForceRecording):
            boundary = next(b for b in body.case.boundaries if b.name == recording.boundary)
            nodes = body.mesh.node_sets[boundary.nodes]
            parts.append(_force(body, recording, nodes, tangent))
        else:
            raise InputError(f"{body.case.name}: the challenge has no recording of the kind '{recording.kind}'")
    if not any(part[0] == "displacement" for part in parts):
        raise InputError(f"{body.case.name}: has no points to be fitted")
    counts = [len(part[1]) for part in parts]
    per = [3 if part[0] == "displacement" else 1 for part in parts]
    starts = np.cumsum([0, *(count // each for count, each in zip(counts, per, strict=True))])
    points = [start + np.arange(count) // each for start, count, each in zip(starts, counts, per, strict=False)]
    return Observed(
        place=np.concatenate([part[1] for part in parts]),
        direction=np.concatenate([part[2] for part in parts]),
        kind=np.repeat([part[0] for part in parts], counts),
        point=np.concatenate(points),
        time=np.concatenate([part[3] for part in parts]),
        sigma=np.repeat([part[4] for part in parts], counts),
        declares=declares,
        recorded=np.concatenate([part[5] for part in parts]),
        reading=vstack([part[6] for part in parts]).tocsr(),
        force_nodes=nodes,
    )


def _sigma(recording: Recording) -> float:
    return recording.sigma or SIGMA


def _points(
    body: NeoHookeanBody, recording: PointsRecording
) -> tuple[str, Floats, Floats, Floats, float, Floats, csr_matrix]:
    located = locate(body.mesh.points, body.mesh.tetrahedra, recording.points)
    k = len(recording.points)
    rows = np.repeat(np.arange(3 * k), 4)
    columns = (3 * located.nodes[:, None, :].astype(np.int64) + np.arange(3)[:, None]).ravel()
    values = np.broadcast_to(located.weights[:, None, :], (k, 3, 4)).ravel()
    reading = csr_matrix((values, (rows, columns)), shape=(3 * k, body.mesh.points.size))
    time = np.full(k, np.nan) if recording.time is None else recording.time
    place, direction = np.repeat(recording.points, 3, axis=0), np.tile(np.eye(3), (k, 1))
    observed = recording.displacement.ravel()
    return "displacement", place, direction, np.repeat(time, 3), _sigma(recording), observed, reading


def _wall(
    body: NeoHookeanBody, recording: SurfaceRecording
) -> tuple[str, Floats, Floats, Floats, float, Floats, csr_matrix]:
    """Along the normal of the declared moved wall: a point of it has no partner."""
    faces = boundary_faces(body.mesh.tetrahedra)
    faces = faces[body.mesh.node_sets[recording.nodes][faces].all(axis=1)]
    moved = body.mesh.points + body.declared.reshape(-1, 3)
    nearest = closest_points(recording.points, moved, faces)
    nodes = faces[nearest.face].astype(np.int64)
    normals = np.cross(moved[nodes[:, 1]] - moved[nodes[:, 0]], moved[nodes[:, 2]] - moved[nodes[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    place = np.einsum("ka,kai->ki", nearest.weights, body.mesh.points[nodes])
    k = len(place)
    values = (nearest.weights[:, :, None] * normals[:, None, :]).ravel()
    columns = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    reading = csr_matrix((values, (np.repeat(np.arange(k), 9), columns)), shape=(k, body.mesh.points.size))
    observed = np.einsum("ki,ki->k", recording.points - place, normals)
    return "wall", place, normals, np.full(k, np.nan), _sigma(recording), observed, reading


def _force(
    body: NeoHookeanBody, recording: ForceRecording, nodes: NDArray[np.bool_], tangent: csr_matrix
) -> tuple[str, Floats, Floats, Floats, float, Floats, csr_matrix]:
    whole = csr_matrix(np.kron(nodes[None], np.eye(3)))
    place = np.tile(body.mesh.points[nodes].mean(axis=0), (3, 1))
    sigma = recording.sigma or 0.02 * float(np.linalg.norm(recording.force[-1]))
    return "force", place, np.eye(3), np.full(3, np.nan), sigma, recording.force[-1], (whole @ tangent).tocsr()
