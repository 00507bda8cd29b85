"""Everything that was recorded as rows of one linear system: residuals, and what moves them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.estimation.observations import Observations
from warpbrain.estimation.registration import rigid_columns
from warpbrain.mesh import TetMesh
from warpbrain.recordings.location import locate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sensors:
    """The n numbers that were recorded, at a state.

    Attributes
    ----------
    residual : (n,) array
        What was recorded less what was computed [m] or [N].
    by_displacement, by_reactions : (n, 3 N) SciPy CSR
        Derivatives of what was computed by displacement and reactions.
    rigid : (n, 6) array
        Derivatives of what was recorded by a rigid motion of it.
    sigma : (n,) array
        Declared standard deviation of the noise; NaN where it is to be estimated.
    positions : (n, 3) array
        Where [m]; NaN of forces.
    directions : (n, 3) array
        In which direction a displacement was recorded; zero of forces.
    groups : (n,) int array
        Number of the point, or of the row of a recording, that each belongs to.
    recordings : (n,) int array
        Number of the recording.
    names : tuple of str
        Of the recordings.
    """

    residual: Floats
    by_displacement: Any
    by_reactions: Any
    rigid: Floats
    sigma: Floats
    positions: Floats
    directions: Floats
    groups: Ints
    recordings: Ints
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.residual)

    @property
    def is_displacement(self) -> NDArray[np.bool_]:
        """Which rows are lengths, not forces."""
        return np.asarray(self.directions.any(axis=1))


def sensors_at(observations: Observations, u: Floats, reactions: Floats, centre: Floats | None = None) -> Sensors:
    """The rows of all recordings at a state; displacement and reactions (N, 3), see `Observations.at`."""
    from scipy.sparse import vstack

    parts = observations.at(u, reactions, centre)
    residual: list[Floats] = []
    rigid: list[Floats] = []
    sigma: list[Floats] = []
    positions: list[Floats] = []
    groups: list[Ints] = []
    recordings: list[Ints] = []
    first = 0
    for number, (one, part) in enumerate(zip(observations.each, parts, strict=True)):
        rows, size = part.values.shape
        residual.append(part.values.ravel())
        rigid.append(part.rigid.reshape(-1, 6))
        own = np.full(rows, np.nan) if one.sigma is None else one.sigma
        sigma.append(np.repeat(own, size))
        where = one.positions if len(one.positions) else np.full((rows, 3), np.nan)
        positions.append(np.repeat(where, size, axis=0))
        groups.append(first + np.repeat(np.arange(rows), size))
        recordings.append(np.full(rows * size, number))
        first += rows
    turned = np.concatenate(rigid)
    return Sensors(
        np.concatenate(residual),
        vstack([part.by_displacement for part in parts]).tocsr(),
        vstack([part.by_reactions for part in parts]).tocsr(),
        turned,
        np.concatenate(sigma),
        np.concatenate(positions),
        turned[:, :3].copy(),
        np.concatenate(groups),
        np.concatenate(recordings),
        tuple(one.name for one in observations.each),
    )


def tracked_points(mesh: TetMesh, points: Floats, centre: Floats) -> Sensors:
    """Rows of the displacement of points (k, 3) [m] that were not recorded."""
    from scipy.sparse import csr_matrix, eye, kron

    matrix = locate(mesh.points, mesh.tetrahedra, points).matrix(len(mesh.points))
    by_displacement = kron(matrix, eye(3), format="csr")
    count = 3 * len(points)
    return Sensors(
        np.zeros(count),
        by_displacement,
        csr_matrix(by_displacement.shape),
        rigid_columns(points, centre).reshape(-1, 6),
        np.ones(count),
        np.repeat(points, 3, axis=0),
        np.tile(np.eye(3), (len(points), 1)),
        np.repeat(np.arange(len(points)), 3),
        np.zeros(count, dtype=np.int64),
        ("points",),
    )


def spread_points(points: Floats, spacing: float, most: int = 2000) -> Ints:
    """Numbers of points that are at least a spacing apart and leave no other point farther than it from them.

    Farthest-point sampling (Gonzalez 1985), which begins at the point nearest to the middle.
    """
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    chosen = [int(np.argmin(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < most and distance.max() > spacing:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.int64)
