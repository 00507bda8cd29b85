"""Stiffness that varies from place to place within tissues: a nuisance, never a cause.

`ln mu(X)` has a normal distribution with a squared exponential covariance. Its largest modes are computed on some
of the elements and extended to all of them (Nystroem's method; Williams and Seeger 2001).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.body.sensors import spread_points

#: Most places at which modes are computed.
_SITES = 400


def stiffness_modes(mesh: TetMesh) -> Floats:
    """Modes (m, k) of `ln mu` of each element, each times its standard deviation.

    As few as hold all of its variance but `tissue.field_cut`: what fewer modes leave out is largest at the surfaces,
    and a cause that is soft or stiff would do its work.
    """
    reach = belief("tissue.field_reach") * mesh.radius
    sites = mesh.centres[spread_points(mesh.centres, 0.5 * reach, _SITES)]
    values, vectors = np.linalg.eigh(_covariance(sites, sites, reach))
    values, vectors = values[::-1], vectors[:, ::-1]
    count = 1 + int(np.searchsorted(np.cumsum(values), (1.0 - belief("tissue.field_cut")) * values.sum()))
    return np.asarray(_covariance(mesh.centres, sites, reach) @ vectors[:, :count] / np.sqrt(values[:count]))


def _covariance(a: Floats, b: Floats, reach: float) -> Floats:
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1)[None] - 2.0 * a @ b.T
    return np.asarray(belief("tissue.field") ** 2 * np.exp(-0.5 * np.maximum(squares, 0.0) / reach**2))


@dataclass(frozen=True, kw_only=True, eq=False)
class StiffnessField(Mechanism):
    """Moduli of each element times `exp(log_factor)`; no user assumes it, so it is in no registry."""

    log_factor: Floats = field(repr=False)  # (m,)
    kind: ClassVar[str] = "stiffness field"
    sentence: ClassVar[str] = "Stiffness varies from place to place."

    def stiffness_factor(self, mesh: TetMesh, scale: float) -> Floats:
        """See `warpbrain.physics.mechanism.Weakening`; a stiffness is there, however little of the load is."""
        return np.exp(self.log_factor)
