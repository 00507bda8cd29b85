"""What a fit of a set of causes without linearising has come to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from warpbrain.arrays import Floats
from warpbrain.inference.marginal import Marginal
from warpbrain.worlds.body.effects import Effect, column_slices
from warpbrain.worlds.body.mesh_share import MeshShare
from warpbrain.worlds.body.states import SolvedState


@dataclass(frozen=True, eq=False)
class Refit:
    """A set of causes at its best point."""

    effects: tuple[Effect, ...]  # of its mechanisms beside those of the case
    state: SolvedState
    nuisances: Floats  # (q,), coordinates of the nuisances, and of causes that act linearly
    coefficients: tuple[Floats, ...]  # (k,), of each effect, in standard deviations about its mean
    covariances: tuple[Floats, ...]  # (k, k), of these
    #: (n,): what is left at the best point, linear nuisances and the expected error of the mesh taken off.
    residual: Floats
    linear: Floats  # (n,), residual of the linear model about that point, with all coordinates at zero
    columns: Floats  # (n, q + k), of that model
    marginal: Marginal  # its Laplace evidence, the scale of the noise and gross errors
    converged: bool
    #: Part of the error of the mesh that belongs to its mechanisms, if that is known.
    mesh_share: MeshShare | None = None

    @property
    def log_evidence(self) -> float:
        """Laplace approximation."""
        return self.marginal.log_evidence

    def without(self, number: int) -> Refit:
        """The same point without one of its effects, from which a set without it is fitted."""
        part = column_slices(self.effects, 0)[number]
        share = self.mesh_share

        def others(values: tuple[Any, ...]) -> tuple[Any, ...]:
            return values[:number] + values[number + 1 :]

        return replace(
            self,
            effects=others(self.effects),
            coefficients=others(self.coefficients),
            covariances=others(self.covariances),
            mesh_share=None if share is None else share.with_fixed(part, self.coefficients[number]),
        )
