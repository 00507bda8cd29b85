"""Sets of causes with their probabilities: proposed to first order, the probable ones fitted without linearising.

The most probable set that was not fitted yet is fitted, its evidence replaced, and again, until those that are fitted
have nearly all of the probability. About each fit that is the best so far all other causes are linearised anew, so that
sets with more causes, or with causes that change each other, are proposed from where they are near. All sets compare by
the log density of the same rows; in which order they were found decides nothing.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.options import Listener
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Cause, Configuration, Hypothesis, Kind, Place
from warpbrain.inference.noise import scales
from warpbrain.inference.subsets import Search, posterior
from warpbrain.worlds.specimen.effects import Effect
from warpbrain.worlds.specimen.fit import CANNOT_BE, Component, Fit, fit

#: Part of the probability that fitted sets have in the end, fits at most, causes of a set at most, and pairs to which a
#: third cause is added.
_MASS, _FITS, _CAUSES, _BEAM = 0.99, 14, 4, 30
_ODDS = {Kind.PHYSICS: "causes.mechanism", Kind.NOT_PHYSICS: "causes.not_physics", Kind.UNKNOWN: "causes.unknown"}


def _log_odds(kind: Kind) -> float:
    """That a cause of a kind acts, before anything was recorded."""
    # probabilities divide all logarithms by the temperature, but it is evidence alone that is too sharp
    return calibration().temperature * float(np.log(belief(_ODDS[kind])))


@dataclass(frozen=True, eq=False)
class Linear:
    """All causes that a fit does not have, to first order about it, with columns at the fitted rows.

    `components` are of each place of each cause, at its largest size.
    """

    fit: Fit
    causes: tuple[Cause, ...]
    components: tuple[tuple[Component, ...], ...]

    def start(self, best: Configuration) -> tuple[tuple[Component, ...], Floats]:
        """Causes of the fit and of a configuration, and coefficients to begin at."""
        sizes = beliefs("specimen.sizes").tolist()
        new = [replace(self.components[m.cause][m.place], size=sizes[m.size]) for m in best.members]
        columns = [
            each.size * self.causes[m.cause].places[m.place].columns for each, m in zip(new, best.members, strict=True)
        ]
        model = self.fit.model.with_scale(best.scale).with_columns(np.concatenate(columns, axis=1))
        mean = model.coefficients(self.fit.residual[self.fit.rows])[0]
        first, *moves = np.split(mean, np.cumsum([len(self.fit.z), *(block.shape[1] for block in columns)])[:-1])
        parts = [first]
        for component, move in zip(new, moves, strict=True):
            c = component.variant.nothing + component.size * move @ (component.trial - component.variant.nothing)
            parts.append((c - component.variant.mean) / component.sd)
        return (*self.fit.assumed, *new), np.concatenate(parts)


def linearise(fit: Fit, effects: Sequence[Effect]) -> Linear:
    """All causes that a fit does not have; places where there is no state are left out."""
    causes, components = [], []
    for effect in effects:
        if effect.name in fit.names:
            continue
        each = [Component(effect, variant, trial, 1.0) for variant in effect.variants for trial in variant.trials]
        known = [(place, columns[fit.rows]) for place in each if (columns := _columns(fit, place)) is not None]
        if known:
            places = tuple(Place(columns) for _, columns in known)
            sizes = beliefs("specimen.sizes")
            causes.append(Cause(effect.name, places, _log_odds(effect.kind), sizes, effect.kind))
            components.append(tuple(component for component, _ in known))
    return Linear(fit, tuple(causes), tuple(components))


def _columns(fit: Fit, component: Component) -> Floats | None:
    """What trials of a cause change (n, m) beside all that the fit has; None where there is no state."""
    forward, variant = fit.forward, component.variant
    if variant.added is not None:
        return variant.added(forward.protocol) @ component.trial.T
    try:
        with np.errstate(all="ignore"):
            actions = forward.actions(fit.assumed, fit.z)
            each = [forward.stress_of([*actions, variant.act(c, forward)], fit.z) for c in component.trial]
    except CANNOT_BE:
        return None
    columns = np.column_stack(each) - fit.stress[:, None]
    return columns if np.isfinite(columns).all() else None


@dataclass(frozen=True, eq=False)
class CauseSet:
    """A set of causes, and the linear model from which it was proposed; its evidence is Laplace's once it was fitted.

    `spread` is what other places and sizes than the best add to the log evidence, with the weight of the best: of the
    causes of the linear model's own fit, and once fitted of all. `of_scale` is the same of other scales of the noise,
    where no cause is added.
    """

    hypothesis: Hypothesis
    linear: Linear
    spread: float
    of_scale: float
    fit: Fit | None = None

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(self.hypothesis.causes)


class Sets:
    """All sets of some effects that were proposed, by the names of their causes; `base` is the fit without any."""

    def __init__(self, effects: Sequence[Effect], base: Fit, listener: Listener) -> None:
        self.effects, self.base, self._listener = tuple(effects), base, listener
        self.by_names: dict[frozenset[str], CauseSet] = {}
        self._about: dict[Fit, Linear] = {}
        self._propose(base, 0.0)
        self.by_names[frozenset()] = replace(self.nothing, fit=base, spread=0.0)
        self._search()

    @property
    def nothing(self) -> CauseSet:
        """The empty one."""
        return self.by_names[frozenset()]

    def ordered(self) -> list[tuple[CauseSet, float]]:
        """Sets with their probabilities, the most probable first."""
        sets = list(self.by_names.values())
        chances = calibration().probabilities([candidate.hypothesis for candidate in sets])
        return [(sets[k], float(chances[k])) for k in np.argsort(-chances, kind="stable")]

    def about(self, fit: Fit) -> Linear:
        """All other causes, linearised about a fit."""
        if fit not in self._about:
            self._about[fit] = linearise(fit, self.effects)
        return self._about[fit]

    def fitted(self, names: frozenset[str]) -> Fit | None:
        """The fit of a set, made if it was not; None if none stands."""
        if names not in self.by_names:
            # proposed about the same set with one cause less
            for kept in (names - {name} for name in sorted(names)):
                if (fewer := self.fitted(kept)) is not None:
                    self._propose(fewer, self.by_names[kept].spread)
                    break
        candidate = self.by_names.get(names)
        return None if candidate is None else candidate.fit or self._fit(candidate)

    def _search(self) -> None:
        best = frozenset[str]()
        for _ in range(_FITS):
            ordered = self.ordered()
            before = itertools.accumulate((p for _, p in ordered), initial=0.0)
            likely = (candidate for (candidate, _), total in zip(ordered, before, strict=False) if total < _MASS)
            first = next((candidate for candidate in likely if candidate.fit is None), None)
            if first is None:
                break
            self._fit(first)
            leading = next(candidate for candidate, _ in self.ordered() if candidate.fit is not None)
            if leading.names != best and leading.fit is not None:
                best = leading.names
                self._propose(leading.fit, leading.spread)

    def _fit(self, candidate: CauseSet) -> Fit | None:
        hypothesis, linear = candidate.hypothesis, candidate.linear
        self._listener.stage(f"fit with {' and '.join(hypothesis.causes)}")
        best = hypothesis.best
        made = fit(linear.fit.forward, *linear.start(best), best.scale)
        if made is None:
            del self.by_names[candidate.names]
            return None
        # the best places and sizes have their probability among all of them, as the linear model has it
        weights = sum(float(linear.causes[m.cause].log_weights[m.place, m.size]) for m in best.members)
        spread = hypothesis.log_evidence - best.log_density + weights
        log_evidence = made.log_density + spread
        # sets with more causes sum over the scale of the noise themselves
        spread -= candidate.of_scale
        hypothesis = replace(hypothesis, log_evidence=log_evidence)
        self.by_names[candidate.names] = replace(candidate, hypothesis=hypothesis, spread=spread, fit=made)
        return made

    def _propose(self, fit: Fit, spread: float) -> None:
        """Sets with the causes of a fit and others: those that were not fitted take their evidence from here."""
        linear = self.about(fit)
        kinds = {component.effect.name: component.effect.kind for component in fit.assumed}
        search = Search(*scales(), beam=0 if kinds else _BEAM)
        hypotheses = posterior(fit.model.with_scale(1.0), fit.residual[fit.rows], linear.causes, search)
        nothing = next(hypothesis for hypothesis in hypotheses if not hypothesis.causes)
        of_scale = nothing.log_evidence - nothing.best.log_density
        for hypothesis in hypotheses:
            names = frozenset((*kinds, *hypothesis.causes))
            known = self.by_names.get(names)
            if len(names) > _CAUSES or (known is not None and known.fit is not None):
                continue
            joint = replace(
                hypothesis,
                causes=(*kinds, *hypothesis.causes),
                kinds=(*kinds.values(), *hypothesis.kinds),
                log_evidence=hypothesis.log_evidence + spread,
                log_prior=hypothesis.log_prior + sum(_log_odds(kind) for kind in kinds.values()),
            )
            self.by_names[names] = CauseSet(joint, linear, spread, of_scale)
