"""The posterior over sets of causes of a body: screened about the base, the best fitted without linearising.

A set's evidence is the sum over its places and sizes in the linear model. Where the best of these was fitted, what the
fit's Laplace evidence differs by from the linear one is added; a set that is one cause more than a fitted one is linear
about that fit, where what has been found already is as large as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError, SolveError
from warpbrain.inference import GaussianModel, Kind, Posterior, Search, posterior
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import Decision, decide
from warpbrain.inference.marginal import Marginal, marginal
from warpbrain.inference.noise import scales
from warpbrain.inference.subsets import Hypothesis, likely_places
from warpbrain.threads import in_threads
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses, causes_of
from warpbrain.worlds.body.dictionary import Candidates, candidates_beside
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.fitting import Refit, Refitting
from warpbrain.worlds.body.placing import placed
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]

#: Places of each cause of which pairs are made, and sets that are looked at with gross errors of their own.
_PLACES, _SETS = 20, 12
#: Places of each cause that are made anew about a fit.
_BESIDE = 8
#: Probability below which a set is not fitted, and how often at most sets are fitted or looked beside.
_WORTH, _MOST = 0.005, 10


@dataclass(frozen=True, eq=False)
class Weighed:
    """A set of causes and the linear model about its best point.

    Attributes
    ----------
    hypothesis : Hypothesis
    effects : tuple of Effect
        Of its mechanisms, in the order of the hypothesis.
    extra : (n, e) array
        Columns of its causes that are no mechanisms.
    residual : (n,) array
        With all coordinates at zero.
    columns : (n, q + e + k) array
        Of nuisances, `extra` and effects.
    marginal : Marginal
    refit : Refit or None
    why : str
        What kept it from being fitted.
    inherited : float or None
        Part of its evidence that it has from the last fit of some of its causes, or of none, until it is fitted itself;
        None of what is linear about a fit.
    """

    hypothesis: Hypothesis
    effects: tuple[Effect, ...]
    extra: Floats
    residual: Floats
    columns: Floats
    marginal: Marginal
    refit: Refit | None = None
    why: str = ""
    inherited: float | None = 0.0

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(self.hypothesis.causes)

    @property
    def mechanisms(self) -> tuple[str, ...]:
        """Names of those that are physics with a name, as `effects`."""
        each = zip(self.hypothesis.causes, self.hypothesis.kinds, strict=True)
        return tuple(name for name, kind in each if kind is Kind.PHYSICS)

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
        found, at = [], self.columns.shape[1] - sum(effect.columns.shape[1] for effect in self.effects)
        for effect in self.effects:
            own = slice(at, at + effect.columns.shape[1])
            found.append((mean[own], covariance[own, own]))
            at = own.stop
        return tuple(found)

    def with_evidence(self, log_evidence: float) -> Weighed:
        """The same with another evidence."""
        return replace(self, hypothesis=replace(self.hypothesis, log_evidence=log_evidence))


class HypothesisSearch:
    """Weighs sets of causes.

    Parameters
    ----------
    base : Base
    candidates : Candidates
    spacing : float
        Between the places of a scan [m].
    listener : Listener
    """

    def __init__(self, base: Base, candidates: Candidates, spacing: float, listener: Listener) -> None:
        self.base, self.candidates, self.spacing, self._listener = base, candidates, spacing, listener
        self.causes = causes_of(base, candidates)
        self.fits = Refitting(base)
        self._weighed: dict[frozenset[str], Weighed] = {}
        self._spread: list[frozenset[str]] = []

    @property
    def weighed(self) -> tuple[Weighed, ...]:
        """The most probable first."""
        found = list(self._weighed.values())
        chances = calibration().probabilities([one.hypothesis for one in found])
        return tuple(found[k] for k in np.argsort(-chances, kind="stable").tolist())

    @property
    def probabilities(self) -> Floats:
        """Of `weighed`."""
        return calibration().probabilities([one.hypothesis for one in self.weighed])

    @property
    def log_bayes_factor(self) -> float:
        """Of anything that may act over nothing, summed over all sets that were weighed, each as probable as it was."""
        sets = [one.hypothesis for one in self._weighed.values()]
        something = [one.log_evidence + one.log_prior for one in sets if one.causes]
        nothing = next(one.log_evidence for one in sets if not one.causes)
        # odds that any of them acts, before anything was recorded
        odds = np.expm1(np.sum(np.log1p(np.exp([cause.log_prior for cause in self.causes.causes]))))
        return float(np.logaddexp.reduce(something) - np.log(odds) - nothing) if something else 0.0

    def get(self, names: Iterable[str]) -> Weighed | None:
        """A set, if it was weighed."""
        return self._weighed.get(frozenset(names))

    def screen(self) -> None:
        """Weigh sets about the base, with all points sound and without what are gross errors if nothing acts."""
        self._listener.stage("screening")
        base = self.base
        nothing = marginal(base.model, base.residual, base.points)
        models = [base.model]
        if nothing.gross.any():
            louder = nothing.noise.noise_factor / nothing.scale
            models.append(GaussianModel(louder, base.nuisances.columns))
        for model in models:
            found = posterior(model, base.residual, self.causes.causes, _search(most=2))
            for one in in_threads(partial(self._linear, model=model), _worth_looking_at(found)):
                self._take(one)

    def fit(self, alone: bool = False) -> None:
        """Fit sets without linearising until no fit can be expected to change the verdict; `alone`: only nothing.

        The most probable set is fitted, and what may act beside it is weighed; then sets on which the verdict depends.
        """
        self._fit(frozenset())
        for _ in range(0 if alone else _MOST):
            wanted = self._wanted()
            if wanted is None:
                return
            names = self._first_for(wanted)
            if self._weighed[names].refit is None:
                self._fit(names)
            else:
                self._spread_from(names)

    def explaining(self, mechanisms: frozenset[str]) -> Weighed | None:
        """The most probable fitted set with just these mechanisms, fitted if none was; None if none can be."""
        sets = [one for one in self.weighed if frozenset(one.mechanisms) == mechanisms]
        known = next((one for one in sets if one.refit is not None), None)
        for one in sets if known is None else []:
            self._fit(one.names)
            if self._weighed[one.names].refit is not None:
                return self._weighed[one.names]
        return known

    def why_not(self, mechanisms: frozenset[str]) -> str:
        """What kept the most probable set with just these mechanisms from being fitted."""
        return next((one.why for one in self.weighed if frozenset(one.mechanisms) == mechanisms and one.why), "")

    def without(self, one: Weighed, name: str) -> Weighed:
        """A set less one of its mechanisms, linear about the same point; its evidence is comparable with the set's."""
        number = one.mechanisms.index(name)
        effect = one.effects[number]
        widths = [own.columns.shape[1] for own in one.effects]
        first = one.columns.shape[1] - sum(widths[number:])
        columns = np.delete(one.columns, np.s_[first : first + widths[number]], axis=1)
        residual = one.residual + effect.mean
        weighed = marginal(
            GaussianModel(self.base.model.noise_factor, columns), residual, self.base.points, one.marginal.scale
        )
        at = one.hypothesis.causes.index(name)
        hypothesis = replace(
            one.hypothesis,
            causes=one.hypothesis.causes[:at] + one.hypothesis.causes[at + 1 :],
            kinds=one.hypothesis.kinds[:at] + one.hypothesis.kinds[at + 1 :],
            log_evidence=one.hypothesis.log_evidence - one.marginal.log_evidence + weighed.log_evidence,
        )
        effects = one.effects[:number] + one.effects[number + 1 :]
        return Weighed(hypothesis, effects, one.extra, residual, columns, weighed)

    def _wanted(self) -> Weighed | None:
        """The set to be fitted, or looked beside, next; None if the verdict does not depend on any."""
        verdict = self._losses()[0]
        spoken = [one for one in self.weighed if frozenset(one.mechanisms) == frozenset(verdict.causes)]
        if spoken[:1] and spoken[0].mechanisms and not self._done(spoken):
            return next((one for one in spoken if one.refit is not None), spoken[0])
        chances = zip(self.weighed, self.probabilities.tolist(), strict=True)
        waiting = [(chance, one) for one, chance in chances if chance > _WORTH and one.refit is None and not one.why]
        waiting.sort(key=lambda each: -each[0])
        return next((one for _, one in waiting if self._matters(one, verdict)), None)

    def _done(self, spoken: list[Weighed]) -> bool:
        """Whether nothing is left to do about sets of what is named: one is fitted and looked beside."""
        fitted = [one for one in spoken if one.refit is not None]
        if not fitted:
            return all(one.why for one in spoken)
        return any(one.names in self._spread or len(one.names) > 2 for one in fitted)

    def _losses(self, other: Weighed | None = None, change: float = 0.0) -> tuple[Decision, dict[Decision, float]]:
        """The verdict and expected losses of all; as they would be if the evidence of a set was another."""
        hypotheses = [one.hypothesis for one in self.weighed if one is not other]
        if other is not None:
            hypotheses.append(other.with_evidence(other.hypothesis.log_evidence + change).hypothesis)
        return decide(hypotheses, calibration().probabilities(hypotheses), calibration().losses)

    def _matters(self, one: Weighed, verdict: Decision) -> bool:
        """Whether the verdict would be regretted if a fit found what it may find of a set."""
        for sign in (-1.0, 1.0):
            other, losses = self._losses(one, sign * belief("fits.change"))
            if losses.get(verdict, np.inf) - losses[other] > belief("fits.regret"):
                return True
        return False

    def _first_for(self, one: Weighed) -> frozenset[str]:
        """The set itself, or one of a cause less that is to be fitted, or looked beside, before it.

        Two causes that are linear about the base are often one that is not.
        """
        fewer = [self._weighed.get(one.names - {name}) for name in one.hypothesis.causes]
        smaller = [fitted for fitted in fewer if fitted is not None and fitted.mechanisms and not fitted.why]
        if one.refit is not None or not smaller or any(fitted.names in self._spread for fitted in smaller):
            return one.names
        return min(smaller, key=self.weighed.index).names

    def _take(self, one: Weighed) -> None:
        known = self._weighed.get(one.names)
        if known is None or one.hypothesis.log_evidence > known.hypothesis.log_evidence:
            self._weighed[one.names] = one

    def _linear(self, hypothesis: Hypothesis, model: GaussianModel) -> Weighed:
        """A set as screened, its gross errors its own."""
        base = self.base
        return self._beside(hypothesis, self.causes, base.residual, base.model.columns, (), model)

    def _beside(
        self,
        hypothesis: Hypothesis,
        causes: BodyCauses,
        residual: Floats,
        columns: Floats,
        there: tuple[Effect, ...],
        screened: GaussianModel,
    ) -> Weighed:
        """The members of a hypothesis beside columns that are there, weighed with gross errors of its own.

        What they gain over the screen, in which these were as in `screened`, is added to the hypothesis' evidence.
        """
        members = hypothesis.best.members
        effects = [(member, causes.effect(member)) for member in members]
        extra = [causes.columns(member) for member, effect in effects if effect is None]
        new = [effect for _, effect in effects if effect is not None]
        left = residual - sum((causes.mean(member) for member in members), start=np.zeros(len(residual)))
        own = np.column_stack([*extra, *(effect.columns for effect in new)]) if members else np.zeros((len(left), 0))
        values, log_prior = scales()
        plain = screened.with_columns(own).log_marginal(left, values, log_prior)
        # effects that are there already come first among effects
        known = sum(effect.columns.shape[1] for effect in there)
        split = columns.shape[1] - known
        ordered = np.column_stack([columns[:, :split], *extra, columns[:, split:], *(one.columns for one in new)])
        weighed = marginal(self.base.model.of_noise(ordered), left, self.base.points, hypothesis.best.scale)
        return Weighed(
            replace(hypothesis, log_evidence=hypothesis.log_evidence + weighed.log_evidence - plain),
            (*there, *new),
            np.column_stack([columns[:, self.base.nuisances.columns.shape[1] : split], *extra]),
            left,
            ordered,
            weighed,
        )

    def _fit(self, names: frozenset[str]) -> None:
        """Fit a set; one that cannot be says why."""
        one = self._weighed[names]
        self._listener.stage(f"fit without linearising: {' and '.join(sorted(names)) or 'nothing more'}")
        smaller = self._smaller(one)
        one = self._placed(one) if one.refit is None and len(names) <= 2 else one
        begins = [one.coordinates]
        nothing = self._weighed[frozenset()].refit
        near = None
        if nothing is not None and smaller is None:
            q = len(nothing.nuisances)
            beside = np.column_stack([nothing.columns, one.columns[:, q:]])
            model = GaussianModel(one.marginal.noise.noise_factor, beside)
            begins.append(model.coefficients(nothing.linear + one.residual - self.base.residual)[0])
            near = nothing.state
        about = None if smaller is None else (smaller, one.columns)
        try:
            refit = self.fits.fit(one.effects, one.extra, begins, one.marginal, near, about)
        except (SolveError, InputError) as error:
            self._weighed[names] = replace(one, why=str(error))
            return
        gain = refit.log_evidence - one.marginal.log_evidence
        if not names:
            # what the fit without any cause gains is of tissue and registration, which all others gain by, too; and a
            # search that ended too early must not make everything else look better
            gain = max(gain, 0.0)
        fitted = replace(one, residual=refit.linear, columns=refit.columns, marginal=refit.marginal, refit=refit)
        self._weighed[names] = fitted.with_evidence(one.hypothesis.log_evidence - (one.inherited or 0.0) + gain)
        for other in list(self._weighed.values()):
            # what some of its causes explain already a set does not gain once more
            if names < other.names and other.refit is None and other.inherited is not None:
                gained = other.with_evidence(other.hypothesis.log_evidence - other.inherited + gain)
                self._weighed[other.names] = replace(gained, inherited=gain)

    def _smaller(self, one: Weighed) -> Refit | None:
        """The fit that a set is linear about, of all its causes but one; None if it is about the base."""
        fitted = [self._weighed[names] for names in self._spread if names < one.names and one.refit is None]
        return next((other.refit for other in fitted if other.effects == one.effects[: len(other.effects)]), None)

    def _placed(self, one: Weighed) -> Weighed:
        """A set with its mechanisms at the best places of their cells."""
        effects = list(one.effects)
        at = one.columns.shape[1] - sum(effect.columns.shape[1] for effect in effects)
        for number, effect in enumerate(effects):
            own = slice(at, at + effect.columns.shape[1])
            at = own.stop
            if effect.proposal is None or effect.proposed.elsewhere is None:
                continue
            others = np.delete(one.marginal.model.columns, np.r_[own], axis=1)
            without = GaussianModel(one.marginal.model.noise_factor, others, one.marginal.scale)
            assert effect.proposed.centre is not None and effect.proposed.radius is not None
            usual = effect.proposed.elsewhere(effect.proposed.centre, effect.proposed.radius)
            size = float(np.max(effect.proposed.sd / usual.sd))
            found = placed(
                self.base, self.base.effects, effect, size, self.spacing, without, one.residual + effect.mean
            )
            columns = one.columns.copy()
            columns[:, own] = found.effect.columns
            residual = one.residual + effect.mean - found.effect.mean
            better = marginal(self.base.model.of_noise(columns), residual, self.base.points, one.marginal.scale)
            effects[number] = found.effect
            one = replace(
                one, effects=tuple(effects), residual=residual, columns=columns, marginal=better
            ).with_evidence(one.hypothesis.log_evidence + found.gain)
        return one

    def _spread_from(self, names: frozenset[str]) -> None:
        """Weigh every set of one cause more than a fitted one, linear about that fit."""
        one = self._weighed[names]
        assert one.refit is not None
        self._spread.append(names)
        self._listener.stage(f"what acts beside {' and '.join(sorted(names))}")
        noise = GaussianModel(one.marginal.noise.noise_factor, one.columns)
        places = likely_places(noise, one.residual, self.causes.causes, _BESIDE)
        candidates = candidates_beside(one.refit.state, one.effects, self.candidates, places)
        causes = causes_of(self.base, candidates)
        causes = replace(causes, causes=tuple(cause for cause in causes.causes if cause.name not in names))
        louder = GaussianModel(one.marginal.noise.noise_factor / one.marginal.scale, one.columns)
        found = posterior(louder, one.residual, causes.causes, _search(most=1))
        values, log_prior = scales()
        without = louder.log_marginal(one.residual, values, log_prior)
        worth = [hypothesis for hypothesis in _worth_looking_at(found, singles=False) if hypothesis.causes]
        each = in_threads(
            lambda more: self._beside(more, causes, one.residual, one.columns, one.effects, louder), worth
        )
        for hypothesis, beside in zip(worth, each, strict=True):
            gain = beside.hypothesis.log_evidence - without
            # the evidence without it has its own gross errors, too
            gain -= one.marginal.log_evidence - without
            total = replace(
                hypothesis,
                causes=(*hypothesis.causes, *one.hypothesis.causes),
                kinds=(*hypothesis.kinds, *one.hypothesis.kinds),
                log_prior=hypothesis.log_prior + one.hypothesis.log_prior,
                log_evidence=one.hypothesis.log_evidence + gain,
            )
            ordered = _in_order(replace(beside, hypothesis=total))
            known = self._weighed.get(ordered.names)
            if known is None or known.refit is None:
                self._weighed[ordered.names] = replace(ordered, inherited=None)


def _in_order(one: Weighed) -> Weighed:
    """Causes in the order of their effects: those that were there first."""
    hypothesis = one.hypothesis
    new, there = hypothesis.causes[0], hypothesis.causes[1:]
    kinds = hypothesis.kinds
    return replace(one, hypothesis=replace(hypothesis, causes=(*there, new), kinds=(*kinds[1:], kinds[0])))


def _search(most: int) -> Search:
    values, log_prior = scales()
    return Search(values, log_prior, places=_PLACES, beam=0, most=most)


def _worth_looking_at(found: Posterior, singles: bool = True) -> list[Hypothesis]:
    """The most probable sets, none, and every single cause if asked for."""
    best = list(found.hypotheses[:_SETS])
    return best + [one for one in found.hypotheses[_SETS:] if not one.causes or (singles and len(one.causes) == 1)]
