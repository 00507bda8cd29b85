"""Stiffness that varies from place to place within tissues, which is a nuisance, never a cause.

`ln mu(X)` has a normal distribution with a squared exponential covariance. Its largest modes are computed on some of
the elements and extended to all of them (Nystroem's method; Williams and Seeger 2001).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.noise import log_shares
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.body.sensors import spread_points

#: Most places at which modes are computed.
_SITES = 400


@dataclass(frozen=True, eq=False)
class FieldSizes:
    """How uneven stiffness may be: sizes of the stiffness field that are summed over."""

    deviations: Floats  # (s,), of `ln mu` at each place, increasing
    log_prior: Floats  # (s,)

    @classmethod
    def of(cls, declared: float | None) -> FieldSizes:
        """What is believed of a tissue, or the one size that a case declares."""
        from scipy.stats import t

        if declared:
            return cls(np.array([declared]), np.zeros(1))
        sizes = beliefs("tissue.field_sizes")
        off = np.log(sizes / belief("tissue.field")) / belief("tissue.field_width")
        return cls(sizes, log_shares(sizes, t.logpdf(off, belief("noise.scale_tail"))))

    @property
    def typical(self) -> int:
        """Index of the size nearest to the prior mean."""
        mean = np.exp(self.log_prior) @ self.deviations
        return int(np.argmin(np.abs(np.log(self.deviations / mean))))

    @property
    def of_modes(self) -> float:
        """Standard deviation that `States.modes` have: the typical one."""
        return float(self.deviations[self.typical])

    @property
    def relative(self) -> Floats:
        """Of each to that (s,)."""
        return self.deviations / self.of_modes


def stiffness_modes(mesh: TetMesh, sd: float) -> Floats:
    """Modes (m, k) of `ln mu` of each element, each times its standard deviation, which at each place is `sd`.

    As few as hold all of its variance but `tissue.field_cut`: what fewer modes leave out is largest at the surfaces,
    and a cause that is soft or stiff would do its work.
    """
    reach = belief("tissue.field_reach") * mesh.radius
    sites = mesh.centres[spread_points(mesh.centres, 0.5 * reach, _SITES)]
    values, vectors = np.linalg.eigh(_correlation(sites, sites, reach))
    values, vectors = values[::-1], vectors[:, ::-1]
    count = 1 + int(np.searchsorted(np.cumsum(values), (1.0 - belief("tissue.field_cut")) * values.sum()))
    return np.asarray(sd * _correlation(mesh.centres, sites, reach) @ vectors[:, :count] / np.sqrt(values[:count]))


def _correlation(a: Floats, b: Floats, reach: float) -> Floats:
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1)[None] - 2.0 * a @ b.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / reach**2))


@dataclass(frozen=True, kw_only=True, eq=False)
class StiffnessField(Mechanism):
    """Moduli of each element times `exp(log_factor)`; no user assumes it, so it is in no registry."""

    log_factor: Floats = field(repr=False)  # (m,)
    kind: ClassVar[str] = "stiffness field"
    sentence: ClassVar[str] = "Stiffness varies from place to place."

    def stiffness_factor(self, mesh: TetMesh, scale: float) -> Floats:
        """See `warpbrain.physics.mechanism.Weakening`; a stiffness is there, however little of the load is."""
        return np.exp(self.log_factor)
