"""A set of causes of a body with its evidence, the linear model about its most probable point, and its fit.

Of what is known of the error of the mesh a part is the causes', in proportion to their sizes. A finer mesh shows the
error of the state that is fitted. What of it is beyond the error that tissue alone is known to have is the mechanisms',
each of which pulls the elements in its own way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.estimation.parameters import Gaussian
from warpbrain.inference import Kind
from warpbrain.inference.beliefs import belief
from warpbrain.inference.causes import Hypothesis
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import UNKNOWN
from warpbrain.worlds.body.effects import Effect, column_slices, width_of
from warpbrain.worlds.body.evidence import SetMarginal, evidence_of
from warpbrain.worlds.body.mesh_error import ENOUGH, FinerStates, MeshErrors, expected_answer
from warpbrain.worlds.body.nuisances import LAW, shared_parameter
from warpbrain.worlds.body.places import LikelyPlaces
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

    def with_scaled(self, part: slice, scales: Floats) -> MeshShare:
        """The same, of coefficients of which those of a part were divided by some scales (j,)."""
        gradient = self.gradient.copy()
        gradient[part] *= scales
        return replace(self, gradient=gradient)

    def with_fixed(self, part: slice, z: Floats) -> MeshShare:
        """The same without some of the coefficients, which stay where they are (j,)."""
        constant = self.constant + float(self.gradient[part] @ z)
        return replace(self, gradient=np.delete(self.gradient, part), constant=constant)

    def columns(self, part: slice = slice(None)) -> Floats:
        """Derivatives (n, k) by the coefficients, or by some of them."""
        return np.outer(self.answer, self.gradient[part])


def excess_error(known: MeshErrors, error: Difference, state: SolvedState, prior: Gaussian) -> Floats:
    """Error of the mesh (n,) in what is recorded, beyond that which the tissue of a state alone is known to have."""
    return expected_answer(state.sensors, error.less(known.of(state.hypothesis.theta, prior)))


def mesh_share_of(
    effects: Sequence[Effect],
    coefficients: Sequence[Floats],
    state: SolvedState,
    known: MeshErrors,
    finer: FinerStates,
    prior: Gaussian,
) -> MeshShare | None:
    """The share of mechanisms at a state; None if a finer mesh does not tell.

    A switch has no size: alone it has a constant share, beside others none. While stress relaxes a body that moves less
    has less of the error of the state in the end.

    `coefficients` (k,): of each effect, in standard deviations about its mean.
    `state`: with these mechanisms.
    `known`: of tissue alone.
    `prior`: of the tissues' parameters.
    """
    sized = [not effect.proposed.is_there_or_not for effect in effects]
    parts = list(zip(sized, effects, coefficients, strict=True))
    scaled = np.concatenate([has_size * _size(effect, z) for has_size, effect, z in parts])
    mean = np.concatenate([has_size * _size(effect, np.zeros(len(z))) for has_size, effect, z in parts])
    square = float(scaled @ scaled)
    # the finer mesh is solved in the end state alone
    if (square < 1e-6 and any(sized)) or any(effect.proposed.follows == "course" for effect in effects):
        return None
    of_tissue, hypothesis = known.of(state.hypothesis.theta, prior), state.hypothesis
    # in the end, where nothing fades any more
    left = replace(hypothesis, mechanisms=tuple(m for m in hypothesis.mechanisms if not m.changes_by_itself))
    fading = all(effect.proposed.history is not None for effect in effects)
    try:
        error = of_tissue if fading else finer.error(left, state, ENOUGH)
    except SolveError:
        return None
    gradient = scaled / square if any(sized) else np.zeros(len(scaled))
    constant = float(gradient @ mean) if any(sized) else 1.0
    sensors = state.sensors
    return MeshShare(expected_answer(sensors, error) - expected_answer(sensors, of_tissue), gradient, constant)


def _size(effect: Effect, z: Floats) -> Floats:
    """Coefficients (k,) less those that have no effect; of what fades the first alone, in proportion to which it is."""
    offset = effect.offset(z)
    return offset if effect.proposed.history is None else np.eye(1, len(offset))[0] * offset


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
    marginal: SetMarginal  # its Laplace evidence, the scale of the noise and gross errors
    converged: bool
    #: Part of the error of the mesh that belongs to its mechanisms, if that is known.
    mesh_share: MeshShare | None = None
    #: By how much the linear model says that a better point exists [nats], if the search has not come to it.
    unreached: float = 0.0
    #: Log probability of its mechanisms' numbers to be in the ranges that are expected of them.
    within_expected: float = 0.0

    @property
    def log_evidence(self) -> float:
        """Laplace approximation, at the best point that was reached.

        That a linear model would explain everything beyond the last state that has an equilibrium is no evidence.
        """
        return self.marginal.log_evidence - self.unreached + self.within_expected

    def scaled(self, number: int, factor: float) -> Refit:
        """The same point, the prior standard deviations of the amounts of an effect times a factor."""
        part, share = column_slices(self.effects, 0)[number], self.mesh_share
        scales = self.effects[number].proposed.scales(factor)
        columns, first = self.columns.copy(), len(self.nuisances)
        columns[:, first + part.start : first + part.stop] *= scales

        def changed(values: tuple[Any, ...], change: Callable[[Any], Any]) -> tuple[Any, ...]:
            return (*values[:number], change(values[number]), *values[number + 1 :])

        return replace(
            self,
            effects=changed(self.effects, lambda effect: effect.scaled(factor)),
            columns=columns,
            coefficients=changed(self.coefficients, lambda z: z / scales),
            covariances=changed(self.covariances, lambda covariance: covariance / np.outer(scales, scales)),
            mesh_share=None if share is None else share.with_scaled(part, scales),
        )

    def without(self, number: int, base: Base) -> Refit:
        """The same point without one of its effects, from which a set without it is fitted."""
        part = column_slices(self.effects, 0)[number]
        share, nuisances = self.mesh_share, self.nuisances.copy()
        if (shared := shared_parameter(self.effects[number])) is not None:
            coordinate = base.nuisances.part(LAW).start + shared.column
            nuisances[coordinate] += float(self.coefficients[number][0]) / shared.ratio
        nuisances = base.nuisances.without_shapes_of(number, nuisances[None])[0]

        def others(values: tuple[Any, ...]) -> tuple[Any, ...]:
            return values[:number] + values[number + 1 :]

        return replace(
            self,
            effects=others(self.effects),
            nuisances=nuisances,
            coefficients=others(self.coefficients),
            covariances=others(self.covariances),
            mesh_share=None if share is None else share.with_fixed(part, self.coefficients[number]),
        )


@dataclass(frozen=True, eq=False)
class WeightedSet:
    """A set of causes and the linear model about its best point."""

    hypothesis: Hypothesis
    #: Names of its causes that act through an equilibrium: mechanisms, and the unknown but where it changes in time.
    acting: tuple[str, ...]
    effects: tuple[Effect, ...]  # of these
    residual: Floats  # (n,), with all coordinates at zero
    #: (n, q + e + k): of nuisances, of causes that act linearly (what is no physics, or changes in time), and of
    #: effects.
    columns: Floats
    marginal: SetMarginal
    refit: Refit | None = None
    failure: str = ""  # why it could not be fitted; empty if it could, or was not tried
    #: Part of its log evidence that the fit of some of its causes (or of none) has gained over the linear model, until
    #: it is fitted itself. None if its linear model is about a fit, whose gain it has already.
    inherited_gain: float | None = 0.0
    refined: bool = False  # whether its mechanisms are at the best places within their cells
    moved: bool = False  # whether its mechanisms were moved to where they are better placed
    #: Where these are, by the numbers of their effects, in the model that is linear about the fit.
    places: Mapping[int, LikelyPlaces] = field(default_factory=dict)
    #: Numbers of the columns of its causes before it is fitted: of those beside the fit that its linear model is
    #: about, or of all if that is about the base.
    further: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    #: The same causes with other placements, which no fit leads to from this one; see `with_alternatives`.
    alternatives: tuple[WeightedSet, ...] = ()
    #: Log of the part of the cells of these places in the evidence, which is a sum over all places. What a fit, or one
    #: at another place of a cell, gains is taken to be gained by the whole cell: its likely places move about in it.
    log_share: float = 0.0

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(self.hypothesis.causes)

    @property
    def mechanisms(self) -> tuple[str, ...]:
        """Names of its mechanisms."""
        return self.hypothesis.of_kind(Kind.PHYSICS)

    @property
    def log_evidence_of_cells(self) -> float:
        """The part of its log evidence [nats] that the cells of its places have in the sum over all places."""
        return self.hypothesis.log_evidence + self.log_share

    @property
    def is_open(self) -> bool:
        """Whether a fit of it, or at neighbouring places, is still to be done."""
        return self.may_move if self.refit is not None else not self.failure

    @property
    def may_move(self) -> bool:
        """Whether it is fitted, and other places of its mechanisms were not looked at."""
        return self.refit is not None and not self.moved and (self.is_placed or bool(self.alternatives))

    @property
    def is_placed(self) -> bool:
        """Whether any of its causes acts in a place."""
        return any(effect.is_placed for effect in self.effects)

    def has_placed(self, cause: str) -> bool:
        """Whether a cause acts in a place, with a size of its own there."""
        return any(name == cause and effect.is_placed for name, effect in zip(self.acting, self.effects, strict=True))

    @property
    def slices(self) -> tuple[slice, ...]:
        """Columns of each effect."""
        return column_slices(self.effects, self.columns.shape[1] - width_of(self.effects))

    @property
    def coordinates(self) -> Floats:
        """The most probable ones (q + e + k,)."""
        return self.marginal.coordinates(self.residual)

    @property
    def coefficients(self) -> tuple[tuple[Floats, Floats], ...]:
        """Mean and covariance of the coefficients of each effect."""
        if self.refit is not None:
            return tuple(zip(self.refit.coefficients, self.refit.covariances, strict=True))
        mean, covariance = self.marginal.model.coefficients(self.residual)
        return tuple((mean[part], covariance[part, part]) for part in self.slices)

    @property
    def best_residual(self) -> Floats:
        """What is left of what was recorded (n,) at the best point."""
        if self.refit is not None:
            return self.refit.residual
        return np.asarray(self.residual - self.columns @ self.coordinates)

    @cached_property
    def linear_error(self) -> float:
        """Expected size of the change of its log evidence by a fit [nats]; of a set that is not fitted.

        The displacement by its causes (beside those of the fit that the linear model is about) is taken to be wrong by
        a fraction `fits.not_linear` of its length. Let the error have the length `e` in standard deviations of the
        noise. Residuals that are noise differ in log density with it and without by `e z` and `e^2 / 2`, `z` standard
        normal: `e + e^2 / 2` at one standard deviation. At most `fits.change`.
        """
        mean, covariance = self.marginal.model.coefficients(self.residual)
        white, among = self.marginal.noise.whitened(self.columns[:, self.further]), np.ix_(self.further, self.further)
        square = np.sum((white @ mean[self.further]) ** 2) + np.sum((white @ covariance[among]) * white)
        error = belief("fits.not_linear") * float(np.sqrt(square))
        return min(error + 0.5 * error**2, belief("fits.change"))

    def inheriting(self, gain: float) -> WeightedSet:
        """The set, not fitted yet, with the gain [nats] of a fit of fewer causes in the place of an earlier one."""
        assert self.inherited_gain is not None
        log_evidence = self.hypothesis.log_evidence - self.inherited_gain + gain
        return replace(self.with_evidence(log_evidence), inherited_gain=gain)

    @property
    def inheriting_alternatives(self) -> tuple[WeightedSet, ...]:
        """`alternatives`, each with the gain [nats] that this set has inherited from the fit of fewer causes."""
        return tuple(alternative.inheriting(self.inherited_gain or 0.0) for alternative in self.alternatives)

    def with_evidence(self, log_evidence: float) -> WeightedSet:
        """The same with another log evidence."""
        return replace(self, hypothesis=replace(self.hypothesis, log_evidence=log_evidence))

    def fitted(self, refit: Refit) -> WeightedSet:
        """The set linear about its fit."""
        return replace(
            self,
            effects=refit.effects,
            residual=refit.linear,
            columns=refit.columns,
            marginal=refit.marginal,
            refit=refit,
            places={},
        )

    @property
    def placement(self) -> tuple[bool, frozenset[str]]:
        """Whether any of its causes acts in a place, not throughout the body, and the surfaces of these places."""
        return self.is_placed, frozenset(effect.surface for effect in self.effects if effect.surface)

    def with_alternatives(self, others: Iterable[WeightedSet]) -> WeightedSet:
        """The set, with `alternatives`: of `others`, which have the same causes, the first of each other placement.

        A fit does not lead from a field to a source, nor from one surface to another: each has a local optimum of its
        own. An alternative of mechanisms is left out if its log evidence in the linear model is less by more than
        fits at better places gain (`fits.moved`). One of the unknown is not: its size is not that of the linear model.
        """
        by_placement = {self.placement: self}
        least = self.marginal.log_evidence - belief("fits.moved")
        for other in others:
            if UNKNOWN in self.names or other.marginal.log_evidence > least:
                by_placement.setdefault(other.placement, replace(other, alternatives=()))
        return replace(self, alternatives=tuple(by_placement.values())[1:])

    def with_gain(self, gain: float) -> WeightedSet:
        """The set whose log evidence at its own places is larger by a gain [nats], and in other cells is as it was.

        What is lost by a fit is lost by all: that the effect is not linear is no matter of the place. A gain may be,
        and one place of many at which an effect is found to be another than in the linear model must not count for all
        of them.
        """
        return self.with_gain_of_cell(gain) if gain > 0.0 else self.with_evidence(self.hypothesis.log_evidence + gain)

    def with_overlap(self, gain: float) -> WeightedSet:
        """The set whose fit gains so much [nats] by the priors of other places, see `log_overlap`.

        What the linear model had of these is in its evidence already: only what is beyond that counts.
        """
        in_cell = self.log_share + gain
        beyond = max(in_cell, 0.0)
        return replace(self.with_evidence(self.hypothesis.log_evidence + beyond), log_share=min(in_cell, 0.0))

    def with_gain_of_cell(self, gain: float) -> WeightedSet:
        """The set whose log evidence in the cells of its places alone is larger by a gain, or less by a loss [nats]."""
        log_share, of_all = self.log_share, gain
        if log_share < 0.0:
            of_all = float(np.logaddexp(log_share + gain, np.log(-np.expm1(log_share))))
            log_share = min(log_share + gain - of_all, 0.0)
        return replace(self.with_evidence(self.hypothesis.log_evidence + of_all), log_share=log_share)

    def without(self, mechanism: str, base: Base) -> WeightedSet:
        """The set less one of its mechanisms, linear about the same point, with an evidence to be compared with its."""
        number = self.acting.index(mechanism)
        columns = base.nuisances.without_shapes_of(number, self.columns)
        columns = np.delete(columns, self.slices[number], axis=1)
        residual, shared = self.residual + self.effects[number].mean, shared_parameter(self.effects[number])
        if shared is not None and self.refit is not None:
            # as a nuisance, which it is again
            of_effect = self.columns[:, self.slices[number].start]
            columns[:, base.nuisances.part(LAW).start + shared.column] = shared.ratio * of_effect
        columns, reduced = evidence_of(base, columns, residual, self.marginal.sizes, self.marginal.scale)
        at = self.hypothesis.causes.index(mechanism)
        hypothesis = replace(
            self.hypothesis,
            causes=self.hypothesis.causes[:at] + self.hypothesis.causes[at + 1 :],
            kinds=self.hypothesis.kinds[:at] + self.hypothesis.kinds[at + 1 :],
            log_evidence=self.hypothesis.log_evidence - self.marginal.log_evidence + reduced.log_evidence,
        )
        acting = self.acting[:number] + self.acting[number + 1 :]
        effects = self.effects[:number] + self.effects[number + 1 :]
        return WeightedSet(hypothesis, acting, effects, residual, columns, reduced)
