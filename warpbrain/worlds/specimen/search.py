"""Sets of causes with their probabilities: proposed to first order, the probable ones fitted without linearising.

The most probable set that was not fitted yet is fitted, its evidence replaced, and again, until those that are fitted
have nearly all of the probability. About each fit that is the best so far all other causes are linearised anew, so that
sets with more causes, or with causes that change each other, are proposed from where they are near. All sets compare by
the log density of the same rows; in which order they were found decides nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import UNKNOWN
from warpbrain.inference.hypothesis import Hypothesis
from warpbrain.worlds.listener import Listener
from warpbrain.worlds.specimen.actions import Effect
from warpbrain.worlds.specimen.fit import Fit, Fitting
from warpbrain.worlds.specimen.linear import Linear, linearise, log_odds

#: Part of the probability that fitted sets have in the end, fits at most, causes of a set at most, and pairs to which a
#: third cause is added.
_MASS, _FITS, _CAUSES, _BEAM = 0.99, 14, 4, 30


@dataclass(frozen=True, eq=False)
class CauseSet:
    """A set of causes.

    Attributes
    ----------
    hypothesis : Hypothesis
        Its evidence is Laplace's once it was fitted.
    linear : Linear
        From which it was proposed.
    spread : float
        What other places and sizes than the best add to the log evidence, with the weight of the best; of the causes of
        the linear model's own fit, and once fitted of all.
    of_scale : float
        The same of other scales of the noise, where no cause is added.
    fit : Fit or None
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
    """All sets that were proposed.

    Parameters
    ----------
    fitting : Fitting
    effects : sequence of Effect
    base : Fit
        Without any cause.
    listener : Listener
    """

    def __init__(self, fitting: Fitting, effects: Sequence[Effect], base: Fit, listener: Listener) -> None:
        self.fitting, self.effects, self.base, self._listener = fitting, tuple(effects), base, listener
        self.by_names: dict[frozenset[str], CauseSet] = {}
        self._about: dict[frozenset[str], Linear] = {}
        self._propose(base, 0.0)
        nothing = self.by_names[frozenset()]
        self.by_names[frozenset()] = replace(nothing, fit=base, spread=0.0)
        self._search()

    def ordered(self) -> list[tuple[CauseSet, float]]:
        """Sets with their probabilities, the most probable first."""
        found = list(self.by_names.values())
        chances = calibration().probabilities([one.hypothesis for one in found])
        return [(found[k], float(chances[k])) for k in np.argsort(-chances, kind="stable")]

    def about(self, fit: Fit) -> Linear:
        """All other causes, linearised about a fit."""
        names = fit.names
        if names not in self._about or self._about[names].fit is not fit:
            self._about[names] = linearise(fit, self.effects)
        return self._about[names]

    def fitted(self, names: frozenset[str]) -> Fit | None:
        """The fit of a set, made if it was not; None if none stands."""
        if names not in self.by_names:
            # proposed about the same set with one cause less
            for name in sorted(names):
                fit = self.fitted(names - {name})
                if fit is not None:
                    self._propose(fit, self.by_names[names - {name}].spread)
                    break
        found = self.by_names.get(names)
        if found is None:
            return None
        return (found if found.fit is not None else self._fit(found)).fit

    def _search(self) -> None:
        best = frozenset[str]()
        for _ in range(_FITS):
            first, total = None, 0.0
            for found, p in self.ordered():
                if found.fit is None and total < _MASS:
                    first = first or found
                total += p
            if first is None:
                break
            self._fit(first)
            leading = next(found for found, _ in self.ordered() if found.fit is not None)
            if leading.names != best and leading.fit is not None:
                best = leading.names
                self._propose(leading.fit, leading.spread)

    def _fit(self, found: CauseSet) -> CauseSet:
        hypothesis = found.hypothesis
        self._listener.stage(f"fit with {' and '.join(hypothesis.causes)}")
        assumed, unknown, z = found.linear.start(hypothesis.best)
        fit = self.fitting.fit(found.linear.fit.forward, assumed, unknown, z, hypothesis.best.scale)
        if fit is None:
            del self.by_names[found.names]
            return found
        # the best places and sizes have their probability among all of them, as the linear model has it
        own = hypothesis.best
        weights = sum(float(found.linear.causes[m.cause].log_weights[m.place, m.size]) for m in own.members)
        spread = hypothesis.log_evidence - own.log_density + weights
        log_evidence = fit.log_density + spread
        # sets with more causes sum over the scale of the noise themselves
        spread -= found.of_scale
        done = replace(found, hypothesis=replace(hypothesis, log_evidence=log_evidence), spread=spread, fit=fit)
        self.by_names[found.names] = done
        return done

    def _propose(self, fit: Fit, spread: float) -> None:
        """Sets with the causes of a fit and others: those that were not fitted take their evidence from here."""
        linear = self.about(fit)
        kinds = {one.effect.name: one.effect.kind for one in fit.assumed}
        if UNKNOWN in fit.names:
            kinds[UNKNOWN] = Kind.UNKNOWN
        hypotheses = linear.posterior(_BEAM if not kinds else 0).hypotheses
        nothing = next(one for one in hypotheses if not one.causes)
        of_scale = nothing.log_evidence - nothing.best.log_density
        for one in hypotheses:
            names = frozenset((*kinds, *one.causes))
            known = self.by_names.get(names)
            if len(names) > _CAUSES or (known is not None and known.fit is not None):
                continue
            whole = replace(
                one,
                causes=(*kinds, *one.causes),
                kinds=(*kinds.values(), *one.kinds),
                log_evidence=one.log_evidence + spread,
                log_prior=one.log_prior + sum(log_odds(kind) for kind in kinds.values()),
            )
            self.by_names[names] = CauseSet(whole, linear, spread, of_scale)
