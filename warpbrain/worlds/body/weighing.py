"""Sets of causes in the linear model about the base, or about a fit, with gross errors of their own.

Screening gives all sets the gross errors of one model. Of the most probable ones evidence and gross errors are found
again, each with its own causes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference import GaussianModel, Search, posterior
from warpbrain.inference.causes import Hypothesis, Member
from warpbrain.inference.noise import scales
from warpbrain.threads import in_threads
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.effects import Effect, width_of
from warpbrain.worlds.body.evidence import SetMarginal, Sizes, evidence_of
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Places of each cause of which pairs are made, and sets that are weighed with gross errors of their own.
_PLACES, _SETS = 20, 12
#: Other places at which a single cause is weighed with gross errors of its own.
_ELSEWHERE = 2


class Weighing:
    """Hypotheses of screening in the linear model about the base, or about a fit, with gross errors of their own.

    `causes`: those that are screened. `sizes`: see `evidence_of`. `about`: a fitted set, whose causes act beside those
    of each hypothesis; the base, where no cause acts, unless given.
    """

    def __init__(self, base: Base, causes: BodyCauses, sizes: Sizes, about: WeightedSet | None = None) -> None:
        self._base, self._causes, self._sizes, self._about = base, causes, sizes, about
        self._names: tuple[str, ...] = () if about is None else about.acting
        self._acting: tuple[Effect, ...] = () if about is None else about.effects
        self._residual = base.residual if about is None else about.residual
        self._columns = base.nuisances.columns_with_field(sizes.field) if about is None else about.columns
        # the same ones are often found with several noises
        self._at = cache(self._acting_with)

    def most_probable(self, models: Sequence[GaussianModel], most: int) -> Iterator[tuple[Hypothesis, WeightedSet]]:
        """The most probable sets of so many causes at most, under each of several models of the rows (n,).

        Of pairs at most also that without any cause, and every single one; else neither.
        """
        pairs, search = most > 1, search_of(most)
        screened = in_threads(lambda model: posterior(model, self._residual, self._causes.causes, search), models)
        tasks = [
            (hypothesis, model)
            for model, of_model in zip(models, screened, strict=True)
            for hypothesis in _most_probable(of_model, pairs)
            if pairs or hypothesis.causes
        ]
        weighed = in_threads(lambda task: self.weigh(*task), tasks)
        return zip((hypothesis for hypothesis, _ in tasks), weighed, strict=True)

    def supersets(self, unscaled: Sequence[GaussianModel]) -> Iterator[WeightedSet]:
        """The most probable sets of one cause more than the fitted one, with that at the best place of a scan.

        `unscaled`: models of the rows with the fitted causes, at a scale of one.
        """
        fitted = self._about
        assert fitted is not None
        for hypothesis, candidate in self.most_probable(unscaled, most=1):
            # both with gross errors of their own
            gain = candidate.hypothesis.log_evidence - fitted.marginal.log_evidence
            # causes in the order of their effects
            joint = replace(
                hypothesis,
                causes=(*fitted.hypothesis.causes, *hypothesis.causes),
                kinds=(*fitted.hypothesis.kinds, *hypothesis.kinds),
                log_prior=hypothesis.log_prior + fitted.hypothesis.log_prior,
                log_evidence=fitted.hypothesis.log_evidence + gain,
            )
            log_share = fitted.log_share + candidate.log_share
            yield replace(candidate, hypothesis=joint, inherited_gain=None, alternatives=(), log_share=log_share)

    def weigh(self, hypothesis: Hypothesis, screened: GaussianModel) -> WeightedSet:
        """A hypothesis with gross errors of its own.

        Screening gives all hypotheses the gross errors of one model. What this one gains by having its own is added to
        its log evidence: the mean over its likeliest places, since points that a local cause moves far are gross errors
        where it is thought to be elsewhere.

        `screened`: of the rows without its causes.
        """
        configurations = (hypothesis.best, *hypothesis.elsewhere)
        weighed = [self._weigh_at(replace(hypothesis, best=best), screened) for best in configurations]
        shares = np.array([configuration.log_density for configuration in configurations])
        logs = np.array([candidate.hypothesis.log_evidence for candidate in weighed]) + shares
        log_evidence = float(np.logaddexp.reduce(logs) - np.logaddexp.reduce(shares))
        best = int(np.argmax(logs))
        of_places = float(np.logaddexp.reduce([configuration.log_share for configuration in configurations]))
        log_shares = np.minimum(logs - np.logaddexp.reduce(logs) + of_places, 0.0)
        weighed = [
            replace(each.with_evidence(log_evidence), log_share=share)
            for each, share in zip(weighed, log_shares.tolist(), strict=True)
        ]
        return weighed[best].with_alternatives(weighed[k] for k in np.argsort(-logs).tolist())

    def _weigh_at(self, hypothesis: Hypothesis, screened: GaussianModel) -> WeightedSet:
        """The same as if its best configuration stood for all places."""
        acting, effects, residual, columns, further, result = self._at(hypothesis.best.members, hypothesis.best.scale)
        values, log_prior = scales()
        log_screened = screened.with_columns(columns[:, further]).log_marginal(residual, values, log_prior)
        log_evidence = hypothesis.log_evidence + result.log_evidence - log_screened
        hypothesis = replace(hypothesis, log_evidence=log_evidence)
        return WeightedSet(hypothesis, acting, effects, residual, columns, result, further=further)

    def _acting_with(
        self, members: tuple[Member, ...], scale: float
    ) -> tuple[tuple[str, ...], tuple[Effect, ...], Floats, Floats, Ints, SetMarginal]:
        """Names of what acts, effects, residual (n,) and columns (n, q + k) with members of a hypothesis.

        And numbers (k,) of the columns of these, and the evidence, whose sum begins at a scale of the noise.
        """
        causes, effects = self._causes, [self._causes.effect(member) for member in members]
        linear = [causes.columns(member) for member, effect in zip(members, effects, strict=True) if effect is None]
        added = [effect for effect in effects if effect is not None]
        names = [causes.causes[m.cause].name for m, effect in zip(members, effects, strict=True) if effect is not None]
        residual = self._residual - sum(
            (causes.mean(member) for member in members), start=np.zeros(len(self._residual))
        )
        # nuisances, linear causes, effects: those that act already come first
        split = self._columns.shape[1] - width_of(self._acting)
        before, after = np.hsplit(self._columns, [split])
        columns = np.column_stack([before, *linear, after, *(effect.columns for effect in added)])
        columns, result = evidence_of(self._base, columns, residual, self._sizes, scale)
        count, linear_count = columns.shape[1], sum(of_cause.shape[1] for of_cause in linear)
        further = np.r_[split : split + linear_count, count - width_of(added) : count].astype(np.int64)
        return (*self._names, *names), (*self._acting, *added), residual, columns, further, result


def keep_better(sets: dict[frozenset[str], WeightedSet], candidate: WeightedSet) -> None:
    """Put a set among others by its names, unless the same is there with as much evidence.

    That of less evidence is an alternative of the other where a single cause has another placement.
    """
    known = sets.get(candidate.names)
    if known is None:
        sets[candidate.names] = candidate
        return
    is_better = candidate.hypothesis.log_evidence > known.hypothesis.log_evidence
    better, other = (candidate, known) if is_better else (known, candidate)
    alternatives = (*better.alternatives, other, *other.alternatives) if len(better.names) == 1 else ()
    sets[better.names] = better.with_alternatives(alternatives)


def best_of_placements(fits: Sequence[WeightedSet], known: Sequence[WeightedSet]) -> WeightedSet:
    """The best of several fits of the same causes, with the log evidence of all of them.

    Before the fits each has the evidence of the sum over all places. The first fit stands for all places but the cells
    of the others, each other one for its own cells. One must not keep that sum where the places that made it large have
    lost it in their own fit: further causes would be credited with what those places explain.

    `known`: the same sets before they were fitted, with their shares of the sum.
    """
    first, fitted = fits[0], [number for number, fit in enumerate(fits) if fit.refit is not None]
    if not fitted:
        return first
    best = max((fits[number] for number in fitted), key=lambda fit: fit.log_evidence_of_cells)
    logs = [fits[number].log_evidence_of_cells for number in fitted if number > 0]
    if first.refit is not None:
        of_others = sum(np.exp(known[number].log_share) for number in fitted[1:])
        # shares of sets that were weighed with other gross errors may add up to more than one: its own cells are left
        logs.append(first.hypothesis.log_evidence + np.log(max(1.0 - of_others, np.exp(first.log_share))))
    total = float(np.logaddexp.reduce(logs))
    return replace(best.with_evidence(total), log_share=min(best.log_evidence_of_cells - total, 0.0))


def search_of(most: int) -> Search:
    """How sets of so many causes at most are screened."""
    values, log_prior = scales()
    return Search(values, log_prior, places=_PLACES, beam=0, most=most, elsewhere=_ELSEWHERE)


def _most_probable(screened: Sequence[Hypothesis], singles: bool) -> list[Hypothesis]:
    """The most probable sets, that without any cause, and every single cause if `singles`."""
    others = screened[_SETS:]
    kept = [other for other in others if not other.causes or (singles and len(other.causes) == 1)]
    return [*screened[:_SETS], *kept]
