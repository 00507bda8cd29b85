"""What has no name and acts in one place: a force there, one that runs around it, or a stress, Gaussian.

To first order in its extent over the distance of the sensors a source of any kind is a force and a tensor of moments
(Aki and Richards, Quantitative Seismology, 2nd ed., section 3.3), whose antisymmetric part runs around the place and
whose symmetric part is a stress. It is a load that fits can follow as they follow mechanisms: what tissue does that
moves by more than its own size is far from linear, and a mechanism that is nearly right would explain it better than
the source that it is.
"""

from dataclasses import dataclass
from functools import cache, lru_cache, partial

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import beliefs
from warpbrain.mesh import QuadraticMesh, TetMesh, summed_at_nodes
from warpbrain.physics.proposal import Place, Proposal
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.unknown import (
    UnknownLoad,
    gaussians,
    root_mean_square,
    stress_patches,
    unit_stresses_of,
)

#: Columns are components, as of `unit_stresses`, of five deviatoric stresses and of an isotropic one, all of unit
#: Frobenius norm. The last moves nearly incompressible tissue so little that it has a standard deviation of its own.
_STRESSES = np.zeros((6, 6))
_STRESSES[:3, [0, 1, 5]] = np.linalg.svd(np.ones((1, 3)))[2][[1, 2, 0]].T
_STRESSES[3:, 2:5] = np.eye(3)
#: How far places are apart, in lengths, unless those of a scan are farther.
_APART = 0.7
#: Gaussians that are kept, the latest ones.
_KEPT = 64


@dataclass(frozen=True, kw_only=True)
class Source(UnknownLoad):
    """A source without a name in one place."""

    centre: Place  # [m]
    length: float  # [m]
    force: Place = (0.0, 0.0, 0.0)  # [N]
    turn: Place = (0.0, 0.0, 0.0)  # adds the force turn x arm / length at a node, arm from the centre [N]
    stress: tuple[float, ...] = ()  # six components as of `unit_stresses` at the centre [Pa]; none if empty

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        assert isinstance(mesh, TetMesh), "a diagnosis has linear elements"
        if self.stress:
            of_elements = np.tensordot(np.array(self.stress), unit_stresses_of(mesh), axes=1)
            heights = _heights_at(mesh, self.centre, self.length)
            return np.asarray(-summed_at_nodes(mesh, heights[:, None, None] * of_elements))
        arms = (mesh.points - np.array(self.centre)) / self.length
        forces = np.array(self.force) + np.cross(np.array(self.turn), arms)
        return np.asarray(_shares_at(mesh, self.centre, self.length)[:, None] * forces)


@lru_cache(maxsize=_KEPT)
def _heights_at(mesh: TetMesh, centre: Place, length: float) -> Floats:
    """Gaussian of height 1 about a centre [m] at the middles of elements (m,)."""
    return gaussians(mesh.centres, np.array([centre]), length)[:, 0]


@lru_cache(maxsize=_KEPT)
def _shares_at(mesh: TetMesh, centre: Place, length: float) -> Floats:
    """The part (N,) of a force about a centre [m] that each node bears."""
    return np.asarray(_shares(mesh, np.array([centre]), length)[:, 0])


def _shares(mesh: TetMesh, centres: Floats, length: float) -> Floats:
    """Parts (N, s) of a force about each centre (s, 3) [m] that nodes bear: of each centre they add up to 1."""
    shares = mesh.node_volumes[:, None] * gaussians(mesh.points, centres, length)
    return np.asarray(shares / np.maximum(shares.sum(axis=0), 1e-300))


def sources(at: Linearisation, spacing: float, size: float) -> tuple[Effect, ...]:
    """Forces, and stresses, of every length at places throughout the body.

    Each of their components moves what was recorded by as much as the others, in the mean over all places; together by
    a root mean square of `size` [m]. `spacing`: between places of a scan [m].
    """
    mesh = at.system.model.mesh

    @cache
    def places(apart: float) -> Floats:
        return np.asarray(mesh.centres[spread_points(mesh.centres, apart, 700)])

    effects: list[Effect] = []
    for is_force, lengths in ((True, beliefs("unknown.force_lengths")), (False, beliefs("unknown.stress_lengths"))):
        range_of_lengths = (spacing * float(lengths.min()), spacing * float(lengths.max()))
        for length in (spacing * lengths).tolist():
            effects += _sources(at, places(max(spacing, _APART * length)), length, range_of_lengths, is_force, size)
    return tuple(effects)


def _sources(
    at: Linearisation,
    centres: Floats,
    length: float,
    range_of_lengths: tuple[float, float],
    is_force: bool,
    size: float,
) -> list[Effect]:
    """Effects of one length [m], of forces or of stresses, at each centre (s, 3) [m].

    `range_of_lengths`: the smallest and the largest length [m]. `size`: as of `sources`.
    """
    columns_about = _force_columns if is_force else _stress_columns
    columns = at.summed(lambda moment: columns_about(moment.at, centres, length), "loads")  # (n, 6, s)
    if not columns.any():
        # between two states that are the same a constant load moves nothing, whatever its size
        return []
    rows, sd = at.sensors.of_one_unit, np.empty(len(_STRESSES))
    for part in (slice(0, 3), slice(3, 6)) if is_force else (slice(0, 5), slice(5, 6)):
        share = (part.stop - part.start) / len(sd)
        sd[part] = size * np.sqrt(share) / max(root_mean_square(columns[rows, part]), 1e-300)
    nothing = np.zeros(len(columns))
    return [
        Effect(
            _proposal(sd, is_force, range_of_lengths, centre, length),
            nothing,
            np.ascontiguousarray(sd * columns[:, :, number]),
        )
        for number, centre in enumerate(centres)
    ]


def _proposal(
    sd: Floats, is_force: bool, range_of_lengths: tuple[float, float], centre: Floats, length: float
) -> Proposal:
    """Six coefficients at a centre (3,) [m], with deviations `sd` (6,): force and turn [N], or stresses [Pa]."""
    x, y, z = centre.tolist()

    def make(c: Floats) -> Source:
        if is_force:
            return Source(centre=(x, y, z), length=length, force=tuple(c[:3].tolist()), turn=tuple(c[3:].tolist()))
        return Source(centre=(x, y, z), length=length, stress=tuple((_STRESSES @ c).tolist()))

    elsewhere = partial(_proposal, sd, is_force, range_of_lengths)
    return Proposal(
        make, np.zeros(len(sd)), sd, elsewhere=elsewhere, centre=centre, radius=length, radii=range_of_lengths
    )


def _force_columns(at: Linearisation, centres: Floats, length: float) -> Floats:
    """Columns (n, 6, s) of a force of 1 N along each axis, and of one that runs around each."""
    mesh = at.system.model.mesh
    weights = _shares(mesh, centres, length)
    arms = (mesh.points[:, None] - centres) / length
    pushes = at.answers_of_patches(weights).transpose(0, 2, 1)
    # forces along the axis after each, and along the one before it, times the arms along it
    moments = [at.answers_of_patches(weights * arms[..., i], ((i + 1) % 3, (i - 1) % 3)) for i in range(3)]
    turns = [moments[i - 2][..., 0] - moments[i - 1][..., 1] for i in range(3)]
    return np.concatenate([pushes, np.stack(turns, axis=1)], axis=1)


def _stress_columns(at: Linearisation, centres: Floats, length: float) -> Floats:
    """Columns (n, 6, s) of a stress of 1 Pa for each column of `_STRESSES`."""
    mesh = at.system.model.mesh
    columns = stress_patches(at, mesh.points, centres, length).reshape(len(at.sensors), len(_STRESSES), -1)
    return np.asarray(np.einsum("ij,nis->njs", _STRESSES, columns))
