"""Evidence of sets of causes in the linear model: with gross errors of their own, and places finer than a scan's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.inference import GaussianModel
from warpbrain.inference.causes import Hypothesis
from warpbrain.inference.noise import scales
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.dictionary import BETWEEN
from warpbrain.worlds.body.effects import Effect, Effects, width_of
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.placing import best_in_cell
from warpbrain.worlds.body.weighted_set import WeightedSet


def weigh(
    base: Base,
    hypothesis: Hypothesis,
    causes: BodyCauses,
    screened: GaussianModel,
    about: WeightedSet | None = None,
) -> WeightedSet:
    """A hypothesis of screening in the linear model about the base, or about a fit, with gross errors of its own.

    Screening gives all hypotheses the gross errors of one model. What this one gains by having its own is added to its
    log evidence: the mean over its likeliest places, since points that a local cause moves far are gross errors where
    it is thought to be elsewhere.

    `causes`: those that were screened. `screened`: of the rows without them. `about`: a fitted set, whose causes act
    beside those of the hypothesis; the base, where no cause acts, unless given.
    """
    configurations = (hypothesis.best, *hypothesis.elsewhere)
    weighed = [
        _weigh_at(base, replace(hypothesis, best=configuration), causes, screened, about)
        for configuration in configurations
    ]
    shares = np.array([configuration.log_density for configuration in configurations])
    logs = np.array([candidate.hypothesis.log_evidence for candidate in weighed]) + shares
    log_evidence = float(np.logaddexp.reduce(logs) - np.logaddexp.reduce(shares))
    best = int(np.argmax(logs))
    of_places = float(np.logaddexp.reduce([configuration.log_share for configuration in configurations]))
    log_share = min(float(logs[best] - np.logaddexp.reduce(logs)) + of_places, 0.0)
    return replace(weighed[best].with_evidence(log_evidence), log_share=log_share)


def _weigh_at(
    base: Base, hypothesis: Hypothesis, causes: BodyCauses, screened: GaussianModel, about: WeightedSet | None
) -> WeightedSet:
    """The same as if its best configuration stood for all places."""
    acting: tuple[Effect, ...]
    if about is None:
        start, model_columns, acting = base.residual, base.model.columns, ()
    else:
        start, model_columns, acting = about.residual, about.columns, about.effects
    members = hypothesis.best.members
    effects = [(member, causes.effect(member)) for member in members]
    linear = [causes.columns(member) for member, effect in effects if effect is None]
    added = [effect for _, effect in effects if effect is not None]
    residual = start - sum((causes.mean(member) for member in members), start=np.zeros(len(start)))
    blocks = [*linear, *(effect.columns for effect in added)]
    further = np.column_stack(blocks) if members else np.zeros((len(residual), 0))
    values, log_prior = scales()
    log_screened = screened.with_columns(further).log_marginal(residual, values, log_prior)
    # nuisances, linear causes, effects: those that act already come first
    split = model_columns.shape[1] - width_of(acting)
    columns = np.column_stack(
        [model_columns[:, :split], *linear, model_columns[:, split:], *(effect.columns for effect in added)]
    )
    columns, result = evidence_of(base, columns, residual, hypothesis.best.scale)
    return WeightedSet(
        replace(hypothesis, log_evidence=hypothesis.log_evidence + result.log_evidence - log_screened),
        (*acting, *added),
        residual,
        columns,
        result,
    )


def with_refined_places(
    base: Base, candidate: WeightedSet, spacing: float, source: Effects, placed: int = 0
) -> WeightedSet:
    """A set with its mechanisms at the best places within their cells of a scan.

    `spacing`: between the places of the scan [m]. `source`: which makes columns at the state that the set is linear
    about. `placed`: effects, the first ones, whose places stay: those of the fit that the set is linear about.
    """
    effects = list(candidate.effects)
    placed = len(effects) if candidate.refined else placed
    for number, (effect, part) in enumerate(zip(candidate.effects, candidate.slices, strict=True)):
        if number < placed or effect.proposal is None or effect.proposed.elsewhere is None:
            continue
        others = np.delete(candidate.columns, np.r_[part], axis=1)
        without = GaussianModel(candidate.marginal.model.noise_factor, others, candidate.marginal.scale)
        assert effect.proposed.centre is not None and effect.proposed.radius is not None
        usual = effect.proposed.elsewhere(effect.proposed.centre, effect.proposed.radius)
        size = float(np.max(effect.proposed.sd / usual.sd))
        residual = candidate.residual + effect.mean
        # what lets go has its columns at the base; centres are as far apart as those of a scan's patches
        at_base = effect.proposed.is_there_or_not
        apart, about = (BETWEEN * base.at.sensors.radius, base.effects) if at_base else (spacing, source)
        best = best_in_cell(base, about, effect, size, apart, without, residual)
        columns = candidate.columns.copy()
        columns[:, part] = best.effect.columns
        residual = residual - best.effect.mean
        columns, refined = evidence_of(base, columns, residual, candidate.marginal.scale)
        effects[number] = best.effect
        candidate = replace(
            candidate,
            effects=tuple(effects),
            residual=residual,
            columns=columns,
            marginal=refined,
            log_share=candidate.log_share + best.log_share,
        ).with_evidence(candidate.hypothesis.log_evidence + best.gain)
    return replace(candidate, refined=True)
