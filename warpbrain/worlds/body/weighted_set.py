"""A set of causes with its evidence, and the linear model about its most probable point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import Kind
from warpbrain.inference.causes import Hypothesis
from warpbrain.inference.marginal import Marginal
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect, column_slices, width_of
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.refit import Refit


@dataclass(frozen=True, eq=False)
class WeightedSet:
    """A set of causes and the linear model about its best point."""

    hypothesis: Hypothesis
    effects: tuple[Effect, ...]  # of its mechanisms, in the order of the hypothesis
    residual: Floats  # (n,), with all coordinates at zero
    #: (n, q + e + k): of nuisances, of causes that are no mechanisms (unknown fields, and what is no physics), and of
    #: effects.
    columns: Floats
    marginal: Marginal
    refit: Refit | None = None
    failure: str = ""  # why it could not be fitted; empty if it could, or was not tried
    #: Part of its log evidence that the fit of some of its causes (or of none) has gained over the linear model, until
    #: it is fitted itself. None if its linear model is about a fit, whose gain it has already.
    inherited_gain: float | None = 0.0
    refined: bool = False  # whether its mechanisms are at the best places within their cells
    #: Log of the part of these places in the evidence of a set that is not fitted, which is a sum over all places.
    log_share: float = 0.0

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(self.hypothesis.causes)

    @property
    def mechanisms(self) -> tuple[str, ...]:
        """Names of its mechanisms, in the order of `effects`."""
        return self.hypothesis.of_kind(Kind.PHYSICS)

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
        )

    def without(self, mechanism: str, base: Base) -> WeightedSet:
        """The set less one of its mechanisms, linear about the same point, with an evidence to be compared with its."""
        number = self.mechanisms.index(mechanism)
        columns = np.delete(self.columns, self.slices[number], axis=1)
        residual = self.residual + self.effects[number].mean
        columns, reduced = evidence_of(base, columns, residual, self.marginal.scale)
        at = self.hypothesis.causes.index(mechanism)
        hypothesis = replace(
            self.hypothesis,
            causes=self.hypothesis.causes[:at] + self.hypothesis.causes[at + 1 :],
            kinds=self.hypothesis.kinds[:at] + self.hypothesis.kinds[at + 1 :],
            log_evidence=self.hypothesis.log_evidence - self.marginal.log_evidence + reduced.log_evidence,
        )
        effects = self.effects[:number] + self.effects[number + 1 :]
        return WeightedSet(hypothesis, effects, residual, columns, reduced)
