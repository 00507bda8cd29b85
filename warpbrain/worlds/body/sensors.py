"""Points of a body and rows of sensors: spread, tracked, the columns of smooth fields over them, and their noise."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.estimation.likelihood import Likelihood
from warpbrain.estimation.observations import Sensors as Sensors
from warpbrain.estimation.registration import rigid_columns
from warpbrain.mesh import TetMesh
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.recordings.location import locate


def kernel_columns(places: Floats, anchors: Floats, reach: float) -> Floats:
    """Kernel columns (k, a) of anchors: a random field of variance one at places (k, 3), correlated over a reach."""
    squares = np.sum((places[:, None] - anchors[None]) ** 2, axis=2)
    weights: Any = np.exp(-squares / reach**2)
    return np.asarray(weights / np.sqrt(np.sum(weights**2, axis=1, keepdims=True)))


def row_products(a: Floats, b: Floats) -> Floats:
    """Products (n, j k) of each of some columns (n, j) with each of others (n, k): Kronecker's, row by row."""
    return np.asarray((a[:, :, None] * b[:, None]).reshape(len(a), a.shape[1] * b.shape[1]))


def tracked_points(mesh: TetMesh, points: Floats, centre: Floats) -> Sensors:
    """Rows of the displacement of points (k, 3) [m] that were not recorded."""
    from scipy.sparse import csr_matrix, eye, kron

    matrix = locate(mesh.points, mesh.tetrahedra, points).matrix(len(mesh.points))
    by_displacement = kron(matrix, eye(3), format="csr")
    count = 3 * len(points)
    return Sensors(
        residual=np.zeros(count),
        computed=np.zeros(count),
        by_displacement=by_displacement,
        by_reactions=csr_matrix(by_displacement.shape),
        rigid=rigid_columns(points, centre).reshape(-1, 6),
        sigma=np.ones(count),
        positions=np.repeat(points, 3, axis=0),
        directions=np.tile(np.eye(3), (len(points), 1)),
        over_element=np.zeros((count, 3)),
        groups=np.repeat(np.arange(len(points)), 3),
        recordings=np.zeros(count, dtype=np.int64),
        times=np.full(count, np.inf),
        names=("points",),
        after=np.full(count, -1),
        before=np.full(count, -1),
        references=np.zeros(count),
        radius=mesh.radius,
    )


def spread_points(points: Floats, spacing: float, most: int = 2000) -> Ints:
    """Numbers of points that are at least a spacing apart and leave no other point farther than it from them.

    Farthest-point sampling (Gonzalez 1985), which begins at the point nearest to the middle.
    """
    return _spread(np.ascontiguousarray(points, dtype=np.float64).tobytes(), spacing, most)


@lru_cache(maxsize=16)
def _spread(points_as_bytes: bytes, spacing: float, most: int) -> Ints:
    """The same of points given as bytes, cached: every state of a diagnosis samples the same nodes."""
    from scipy.spatial.distance import cdist

    points = np.frombuffer(points_as_bytes).reshape(-1, 3)
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    chosen = [int(np.argmin(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))]
    distance = cdist(points, points[chosen])[:, 0]
    while len(chosen) < most and distance.max() > spacing:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, cdist(points, points[chosen[-1:]])[:, 0])
    numbers = np.array(chosen, dtype=np.int64)
    numbers.flags.writeable = False
    return numbers


def noise_of(sensors: Sensors, residual: Floats, nuisances: Floats, field: Floats) -> Floats:
    """Standard deviation (n,) of each row: where none is declared, as by an estimate, given nuisances and a field.

    `residual` (n,).
    `nuisances` (n, k): columns of one standard deviation.
    `field` (n, k): of a smooth force of 1 m.
    """
    undeclared = np.isnan(sensors.sigma)
    if not undeclared.any():
        return sensors.sigma
    lengths = sensors.is_displacement
    size = root_mean_square(residual[lengths]) if lengths.any() else 0.0
    columns = np.column_stack([nuisances, max(size, 1e-9) * field])
    # what the mesh does not resolve is found with each set of causes
    resolved = replace(sensors, over_element=np.zeros_like(sensors.over_element))
    noise = Likelihood().noise(resolved, residual, columns)
    # a factor on noise of which none is declared is its size
    return noise.scale * noise.sigma if undeclared.all() else noise.sigma
