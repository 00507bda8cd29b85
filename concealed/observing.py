"""What is seen of a truth: a few points of each wall, badly aligned, and with noise that is partly shared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from concealed.body import Body, Floats
from concealed.published import OBSERVED
from warpbrain.recordings.location import locate

Nodes = NDArray[np.int64]

#: Declared noise of one component [m], one standard deviation.
SIGMA = 0.3e-3
WALLS = ("ventricles", "cavity")
#: A point is at most so many local edges outside a mesh that ships; the reader of cases lets one pass.
BESIDE = 0.6


@dataclass(frozen=True, kw_only=True)
class Blur:
    """How observation goes wrong.

    Parameters
    ----------
    noise_scale : float
        Factor on all noise; the declared noise does not know it.
    shared_sigma : float
        Part of the noise that neighbours share: standard deviation of one component [m].
    shared_length : float
        Over which it is shared [m].
    shift : (x, y, z)
        Error of registration [m].
    rotation : (x, y, z)
        And about the middle of the head: a rotation vector [rad].
    seed : int
        Of the noise.
    """

    noise_scale: float
    shared_sigma: float
    shared_length: float
    shift: tuple[float, float, float]
    rotation: tuple[float, float, float]
    seed: int

    def misaligned(self, points: Floats, displacement: Floats, middle: Floats) -> Floats:
        """Displacement (k, 3) [m] of points (k, 3) as seen in a badly registered image."""
        arm = points + displacement - middle
        return displacement + np.asarray(self.shift) + arm @ _rotation(np.asarray(self.rotation)).T - arm

    def seen(self, points: Floats, displacement: Floats, middle: Floats) -> Floats:
        """Displacement (k, 3) [m] of points (k, 3) as it is published: misaligned about the middle, with noise."""
        return self.misaligned(points, displacement, middle) + self.noise(points)

    def noise(self, points: Floats) -> Floats:
        """Noise (k, 3) [m] at points (k, 3)."""
        random = np.random.default_rng(self.seed)
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        shared = np.linalg.cholesky(np.exp(-apart / self.shared_length) + 1e-9 * np.eye(len(points)))
        return self.noise_scale * (
            SIGMA * random.normal(size=points.shape) + self.shared_sigma * shared @ random.normal(size=points.shape)
        )

    @property
    def mean_square(self) -> float:
        """Expected squared length of the noise [m2]."""
        return 3.0 * self.noise_scale**2 * (SIGMA**2 + self.shared_sigma**2)


def observed_nodes(name: str, body: Body, shipped: Sequence[Body]) -> tuple[Nodes, Nodes]:
    """Nodes that are observed on the ventricles and on the cavity's margin: as many as were published, far apart.

    Nodes on the skull base are left out: they are known not to move. So are nodes that a body which ships does not
    reach: a coarser mesh smooths away what a finer one shows.

    Parameters
    ----------
    name : str
        A clinical case.
    body : Body
        Whose nodes are meant.
    shipped : sequence of Body
    """
    held = body.mesh.node_sets["fixed"]
    walls = []
    for faces, count in zip((body.ventricle, body.cavity), OBSERVED[name], strict=True):
        nodes = np.unique(faces).astype(np.int64)
        nodes = nodes[~held[nodes]]
        for other in shipped:
            place = locate(other.mesh.points, other.mesh.tetrahedra, body.mesh.points[nodes])
            nodes = nodes[place.distance <= BESIDE * place.edge]
        walls.append(nodes[spread(body.mesh.points[nodes], count)])
    return walls[0], walls[1]


def spread(points: Floats, count: int) -> NDArray[np.int64]:
    """Farthest-point sampling: `count` rows of points (k, 3), in order of row; the same for the same points.

    Raises
    ------
    ValueError
        If there are fewer points than that.
    """
    if len(points) < count:
        raise ValueError(f"{len(points)} points, {count} wanted")
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.sort(np.array(chosen))


def rms(displacement: Floats) -> float:
    """Root mean square length of displacements (k, 3)."""
    return float(np.sqrt((displacement**2).sum(axis=1).mean()))


def _rotation(vector: Floats) -> Floats:
    """Matrix of a rotation vector [rad], by Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
