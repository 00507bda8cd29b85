"""What a fit of a set of causes without linearising has come to, and which part of the mesh's error is the causes'.

That part is in proportion to their sizes. A finer mesh shows the error of the state that is fitted. What of it is
beyond the error that tissue alone is known to have is the mechanisms', each of which pulls the elements in its own way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.estimation.parameters import Gaussian
from warpbrain.inference.gross_errors import Marginal
from warpbrain.worlds.body.effects import Effect, column_slices
from warpbrain.worlds.body.mesh_error import ENOUGH, FinerStates, MeshErrors, expected_answer
from warpbrain.worlds.body.states import SolvedState


@dataclass(frozen=True, eq=False)
class MeshShare:
    """Part of the error of the mesh at coefficients z of all mechanisms: `answer (constant + gradient z)`."""

    answer: Floats  # (n,), at the coefficients for which it was computed
    gradient: Floats  # (k,)
    constant: float

    def at(self, z: Floats) -> Floats:
        """Of coefficients (k,): (n,)."""
        return self.answer * (self.constant + float(self.gradient @ z))

    def extended(self, count: int) -> MeshShare:
        """The same where further mechanisms have coefficients after these, `count` in all."""
        return replace(self, gradient=np.append(self.gradient, np.zeros(count - len(self.gradient))))

    def with_fixed(self, part: slice, z: Floats) -> MeshShare:
        """The same without some of the coefficients, which stay where they are (j,)."""
        constant = self.constant + float(self.gradient[part] @ z)
        return replace(self, gradient=np.delete(self.gradient, part), constant=constant)

    def columns(self, part: slice = slice(None)) -> Floats:
        """Derivatives (n, k) by the coefficients, or by some of them."""
        return np.outer(self.answer, self.gradient[part])


def excess_error(known: MeshErrors, error: Difference, state: SolvedState, prior: Gaussian) -> Floats:
    """Error of the mesh (n,) in what is recorded, beyond that which the tissue of a state alone is known to have."""
    return expected_answer(state.sensors, error.less(known.of(state.hypothesis, prior)))


def mesh_share_of(
    effects: Sequence[Effect],
    coefficients: Sequence[Floats],
    state: SolvedState,
    known: MeshErrors,
    finer: FinerStates,
    prior: Gaussian,
) -> MeshShare | None:
    """The share of mechanisms at a state; None if a finer mesh does not tell.

    A switch has no size: alone it has a constant share, beside others none.

    `coefficients` (k,): of each effect, in standard deviations about its mean. `state`: with these mechanisms. `known`:
    of tissue alone. `prior`: of the tissues' parameters.
    """
    sized = [not effect.proposed.is_there_or_not for effect in effects]
    parts = list(zip(sized, effects, coefficients, strict=True))
    scaled = np.concatenate([has_size * effect.offset(z) for has_size, effect, z in parts])
    mean = np.concatenate([has_size * effect.offset(np.zeros(len(z))) for has_size, effect, z in parts])
    square = float(scaled @ scaled)
    # the finer mesh is solved in the end state alone
    changing = any(effect.proposed.changes_in_time for effect in effects)
    if (square < 1e-6 and any(sized)) or changing:
        return None
    try:
        error = finer.error(state.hypothesis, state, ENOUGH)
    except SolveError:
        return None
    gradient = scaled / square if any(sized) else np.zeros(len(scaled))
    constant = float(gradient @ mean) if any(sized) else 1.0
    return MeshShare(excess_error(known, error, state, prior), gradient, constant)


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
