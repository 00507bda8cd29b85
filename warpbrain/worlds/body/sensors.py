"""Everything that was recorded as rows of one linear model: residuals, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.registration import rigid_columns
from warpbrain.mesh import TetMesh
from warpbrain.recordings.location import locate


@dataclass(frozen=True, eq=False)
class Sensors:
    """The n numbers that were recorded, at a state.

    Attributes
    ----------
    residual : (n,) array
        What was recorded less what was computed [m] or [N].
    computed : (n,) array
        What was computed; of surfaces the displacement along their normals.
    by_displacement, by_reactions : (n, 3 N) SciPy CSR
        Derivatives of what was computed by displacement and reactions at its time.
    rigid : (n, 6) array
        Derivatives of what was recorded by a rigid motion of it.
    sigma : (n,) array
        Declared standard deviation of the noise; NaN where it is to be estimated.
    positions : (n, 3) array
        Where [m]; NaN of forces.
    directions : (n, 3) array
        In which direction a displacement was recorded; zero of forces.
    over_element : (n, 3) array
        Change over an element of the mesh along each axis, as of `Observation` [m].
    groups : (n,) int array
        Number of the point, or of the row of a recording, that each belongs to.
    recordings : (n,) int array
        Number of the recording.
    times : (n,) array
        When [s]; infinite of the end.
    names : tuple of str
        Of the recordings.
    after, before : (n,) int array
        Numbers of the times of states that each row is compared with, and counted from; -1: from rest.
    references : (n,) array
        When the state was from which it is counted [s]; 0: rest.
    share : (n,) array or float
        How many times what changes the last state alike at all times changes a row: 1, and less where a state is
        smaller.
    weights : (n,) array or float
        Of rows whose noise is to be estimated: its variance is the recording's over this.
    """

    residual: Floats
    computed: Floats
    by_displacement: Any
    by_reactions: Any
    rigid: Floats
    sigma: Floats
    positions: Floats
    directions: Floats
    over_element: Floats
    groups: Ints
    recordings: Ints
    times: Floats
    names: tuple[str, ...]
    after: Ints
    before: Ints
    references: Floats
    share: Floats | float = 1.0
    weights: Floats | float = 1.0

    def __len__(self) -> int:
        return len(self.residual)

    @property
    def is_displacement(self) -> Bools:
        """Which rows are lengths, not forces."""
        return np.asarray(self.directions.any(axis=1))

    @property
    def of_surfaces(self) -> Bools:
        """Which rows are of points of a surface: each of these has one number, along the normal."""
        return np.asarray(self.is_displacement & (np.bincount(self.groups)[self.groups] == 1))

    def of_rows(self, rows: Ints, time: float) -> Sensors:
        """Some of the rows (k,) as if they were recorded at a time [s], and counted from rest."""
        count = len(rows)
        each = {
            name: getattr(self, name)[rows]
            for name in ("residual", "computed", "by_displacement", "by_reactions", "rigid", "sigma", "positions")
        }
        more = {name: getattr(self, name)[rows] for name in ("directions", "over_element", "groups", "recordings")}
        return Sensors(
            **each,
            **more,
            times=np.full(count, time),
            names=self.names,
            after=np.zeros(count, dtype=np.int64),
            before=np.full(count, -1),
            references=np.zeros(count),
            weights=np.broadcast_to(self.weights, len(self))[rows],
        )

    @property
    def is_counted_from_rest(self) -> bool:
        """Whether all rows are."""
        return bool((self.before < 0).all())

    def answer(self, du: Floats, dR: Floats) -> Floats:
        """Change (n,) of what is computed by changes of displacement and reactions (N, 3) at its time alone."""
        return np.asarray(self.by_displacement @ du.ravel() + self.by_reactions @ dR.ravel())


def rows_of_points(sensors: Sensors) -> list[Ints]:
    """Rows of each recorded point (g, s), those of points with as many rows together; forces have none."""
    rows = np.flatnonzero(sensors.is_displacement)
    sizes = np.bincount(sensors.groups[rows], minlength=1)
    order = rows[np.argsort(sensors.groups[rows], kind="stable")]
    size_of = sizes[sensors.groups[order]]
    return [order[size_of == size].reshape(-1, size) for size in np.unique(size_of).tolist()]


def kernel_columns(places: Floats, anchors: Floats, reach: float) -> Floats:
    """Kernel columns (k, a) of anchors: a random field of variance one at places (k, 3), correlated over a reach."""
    squares = np.sum((places[:, None] - anchors[None]) ** 2, axis=2)
    weights: Any = np.exp(-squares / reach**2)
    return np.asarray(weights / np.sqrt(np.sum(weights**2, axis=1, keepdims=True)))


def sensors_at(observations: Observations, u: Floats, reactions: Floats, centre: Floats) -> Sensors:
    """The rows of all recordings at the states of one or several times.

    Parameters
    ----------
    observations : Observations
    u, reactions : (s N, 3) array
        Displacement [m] and reactions [N] in s states, one after the other.
    centre : (3,) array
        As in `Observations.at`.
    """
    from scipy.sparse import vstack

    recordings = observations.recordings
    parts = observations.at(u, reactions, centre)
    sizes = [part.values.size for part in parts]

    def each(values: Sequence[Floats | Ints]) -> Any:
        """Values of rows, for each of their numbers."""
        return np.concatenate([np.repeat(v, o.size, axis=0) for v, o in zip(values, recordings, strict=True)])

    first = np.cumsum([0, *(len(part.values) for part in parts)])
    names = tuple(dict.fromkeys(observation.name for observation in recordings))
    rigid = np.concatenate([part.rigid.reshape(-1, 6) for part in parts])
    return Sensors(
        np.concatenate([part.values.ravel() for part in parts]),
        np.concatenate([-part.derivative(u[None], reactions[None]).ravel() for part in parts]),
        vstack([part.by_displacement for part in parts]).tocsr(),
        vstack([part.by_reactions for part in parts]).tocsr(),
        rigid,
        each([np.full(len(o.rows), np.nan) if o.sigma is None else o.sigma for o in recordings]),
        each([o.positions if len(o.positions) else np.full((len(o.rows), 3), np.nan) for o in recordings]),
        rigid[:, :3].copy(),
        np.concatenate([o.over_element.reshape(-1, 3) for o in recordings]),
        each([start + np.arange(len(part.values)) for start, part in zip(first, parts, strict=False)]),
        np.repeat([names.index(observation.name) for observation in recordings], sizes),
        each([o.times for o in recordings]),
        names,
        each([part.after for part in parts]),
        each([part.before for part in parts]),
        each([o.references for o in recordings]),
        weights=each([o.weights for o in recordings]),
    )


def tracked_points(mesh: TetMesh, points: Floats, centre: Floats) -> Sensors:
    """Rows of the displacement of points (k, 3) [m] that were not recorded."""
    from scipy.sparse import csr_matrix, eye, kron

    matrix = locate(mesh.points, mesh.tetrahedra, points).matrix(len(mesh.points))
    by_displacement = kron(matrix, eye(3), format="csr")
    count = 3 * len(points)
    return Sensors(
        np.zeros(count),
        np.zeros(count),
        by_displacement,
        csr_matrix(by_displacement.shape),
        rigid_columns(points, centre).reshape(-1, 6),
        np.ones(count),
        np.repeat(points, 3, axis=0),
        np.tile(np.eye(3), (len(points), 1)),
        np.zeros((count, 3)),
        np.repeat(np.arange(len(points)), 3),
        np.zeros(count, dtype=np.int64),
        np.full(count, np.inf),
        ("points",),
        np.full(count, -1),
        np.full(count, -1),
        np.zeros(count),
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
