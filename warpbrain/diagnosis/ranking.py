"""Every cause with its probability, size, place and detectability."""

import math

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.diagnosis.checking import Confirming
from warpbrain.diagnosis.locating import ball_of
from warpbrain.inference import Cause, GaussianModel, Kind
from warpbrain.inference.subsets import Blocks
from warpbrain.physics.sizes import beyond_in_words
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.parameters import scanned_values, values_of
from warpbrain.worlds.body.weighted_set import WeightedSet
from warpbrain.worlds.verdict import Ranked


class Ranking:
    """Ranks the causes of one search."""

    def __init__(self, confirming: Confirming) -> None:
        self._search, self._confirming = confirming.search, confirming
        self._sets = list(zip(self._search.weighted_sets, self._search.probabilities.tolist(), strict=True))

    def all(self, of_verdict: WeightedSet) -> tuple[Ranked, ...]:
        """Every cause as it is in the set of the verdict, else in the most probable one that has it.

        The most probable first.
        """
        ranked, sets = [], (of_verdict, *(weighted_set for weighted_set, _ in self._sets))
        for cause in self._search.causes.causes:
            best = next((weighted_set for weighted_set in sets if cause.name in weighted_set.names), None)
            if best is not None:
                ranked.append(self._ranked(cause, best))
        return tuple(sorted(ranked, key=lambda cause: (-cause.probability, -cause.log_evidence)))

    def _ranked(self, cause: Cause, weighted_set: WeightedSet) -> Ranked:
        probability = sum(p for other, p in self._sets if cause.name in other.names)
        alone, nothing = self._search.get((cause.name,)), self._search.nothing
        # alone it was not weighed if about the base it changes nothing
        gain = 0.0 if alone is None else alone.hypothesis.log_evidence - nothing.hypothesis.log_evidence
        if cause.kind is not Kind.PHYSICS:
            why = "no physics" if cause.kind is Kind.NOT_PHYSICS else ""
            return Ranked(cause.name, False, gain, probability, 0.0, None, (), rejected_because=why)
        number = weighted_set.acting.index(cause.name)
        effect = weighted_set.effects[number]
        scanned, weights = self._places(cause, weighted_set, number)
        values = values_of(effect, *weighted_set.coefficients[number])
        fitted = {value.name for value in values}
        # linear about another state, a size may go beyond what there can be: it says nothing
        beyond = {} if weighted_set.refit is not None else {v.name: beyond_in_words(cause.name, v) for v in values}
        values = tuple(value for value in values if not beyond.get(value.name))
        # on a node set it has other parameters than on a patch
        alike = np.array([other.proposed.declared == effect.proposed.declared for other in scanned])
        of_alike = [other for other, is_alike in zip(scanned, alike.tolist(), strict=True) if is_alike]
        of_places = scanned_values(of_alike, weights[alike] / max(float(weights[alike].sum()), 1e-300))
        values += tuple(value for value in of_places if value.name not in fitted)
        centre, radius = _place(effect, scanned, weights)
        change = None
        if alone is not None and alone.refit is not None:
            held_out = self._confirming.held_out_for(alone)
            with_it, without = (self._confirming.predict(candidate, held_out) for candidate in (alone, nothing))
            change = held_out.error(with_it) - held_out.error(without)
        why = "" if weighted_set.refit is not None else "less probable than what was fitted"
        if weighted_set.failure:
            why = f"as large as it is seen it could not be simulated: {weighted_set.failure}"
        why = "; ".join(filter(None, (why, *beyond.values())))
        return Ranked(
            cause.name,
            True,
            gain,
            probability,
            _detectability(nothing, weighted_set, number),
            change,
            values,
            centre,
            radius,
            effect.proposed.region,
            why,
        )

    def _places(self, cause: Cause, weighted_set: WeightedSet, number: int) -> tuple[tuple[Effect, ...], Floats]:
        """An effect at every place where it may be (p), and the probabilities (p,) of these.

        Those of a scan; of what was fitted and moved those about the fit, as far as these are all.
        """
        scanned, weights = tuple(self._search.causes.effects[cause.name]), self._weights(cause, weighted_set)
        if number not in weighted_set.places:
            return scanned, weights
        about_fit, shares = weighted_set.places[number].spread(weighted_set.effects[number])
        share = math.exp(weighted_set.log_share)
        return (*about_fit, *scanned), np.concatenate([share * shares, (1.0 - share) * weights])

    def _weights(self, cause: Cause, weighted_set: WeightedSet) -> Floats:
        """Probabilities (p,) of the places of a scan given all other causes of a set."""
        from scipy.special import softmax

        model, residual = about_base(self._search, weighted_set, cause.name)
        blocks = Blocks(model, residual, [cause])
        logs = np.logaddexp.reduce(blocks.log_factors() + blocks.log_weights, axis=1)
        return np.asarray(softmax(logs))


def about_base(search: HypothesisSearch, weighted_set: WeightedSet, name: str) -> tuple[GaussianModel, Floats]:
    """The model and residual (n,) of a set without one mechanism, linear about the base.

    There the columns of all places of the mechanism are known; about a fit they differ.
    """
    base = search.base
    others = [effect for kind, effect in zip(weighted_set.acting, weighted_set.effects, strict=True) if kind != name]
    marginal = weighted_set.marginal
    of_nuisances = base.nuisances.columns_with_field(marginal.sizes.field)
    columns = np.column_stack([of_nuisances, *(effect.columns for effect in others), marginal.excess])
    residual = base.residual - sum((effect.mean for effect in others), start=np.zeros(len(base.residual)))
    return GaussianModel(marginal.model.noise_factor, columns, marginal.scale), residual


def _place(effect: Effect, scanned: tuple[Effect, ...], weights: Floats) -> tuple[Floats | None, float | None]:
    """Where a mechanism acts: centre and radius of a ball with 90 % of the probability."""
    proposed = effect.proposed
    if proposed.centre is None:
        return None, None
    located = [k for k, other in enumerate(scanned) if other.proposed.centre is not None]
    total = float(weights[located].sum())
    if not total > 0.0:
        # about the base it is more probable everywhere at once
        return proposed.centre, proposed.radius
    sites = np.array([scanned[k].proposed.centre for k in located])
    centre, radius = ball_of(sites, weights[located] / total)
    return centre, max(radius, float(proposed.radius or 0.0))


def _detectability(nothing: WeightedSet, weighted_set: WeightedSet, number: int) -> float:
    """Of the change by a mechanism, from zero to its best size by the trapezium rule, given all other causes."""
    # nuisances as at the base: at the best point tissue explains how large it is, not whether it is detected
    count = nothing.columns.shape[1]
    part = weighted_set.slices[number]
    others = np.delete(weighted_set.columns, np.r_[part], axis=1)[:, count:]
    columns = np.column_stack([nothing.columns, others])
    model = GaussianModel(nothing.marginal.model.noise_factor, columns, weighted_set.marginal.scale)
    effect, columns_at_best = weighted_set.effects[number], weighted_set.columns[:, part]
    z = weighted_set.coefficients[number][0]
    # switches and courses in time are solved as a whole, with no path from zero to their size
    whole = effect.proposed.is_there_or_not or effect.proposed.changes_in_time
    change = effect.mean + effect.columns @ z if whole else 0.5 * (effect.columns + columns_at_best) @ effect.offset(z)
    return float(np.linalg.norm(model.standardised(change)))
