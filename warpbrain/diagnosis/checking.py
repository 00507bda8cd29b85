"""Checks of sets of causes: p-values, cross-validation by blocks of rows against patterns, and unseen recordings.

Blocks do not depend on any fit; each is predicted from all others by conditioning the same model. Blocks are regions.
What a local cause does cannot be predicted from other regions: where one acts, blocks are scattered points. Random
patterns in the place of mechanisms say what chance predicts. To recordings with role `check` nothing is fitted: each is
compared at its time.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.inference import Cause, GaussianModel, Kind, Place
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import Confirmation
from warpbrain.inference.predict import Prediction, along_own_axes, p_value, predict, predict_with, predictive_p
from warpbrain.inference.subsets import Blocks
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import width_of
from warpbrain.worlds.body.fit_columns import with_shapes_about
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.mesh_error import MeshErrors, expected
from warpbrain.worlds.body.nuisances import FIELD, RigidMotion
from warpbrain.worlds.body.sensors import Sensors, spread_points
from warpbrain.worlds.body.states import SolvedState, States
from warpbrain.worlds.body.time_courses import finite_times
from warpbrain.worlds.body.weighted_set import Refit, WeightedSet

#: Blocks, and random patterns.
_BLOCKS, _PATTERNS = 24, 100


def blocks_of(sensors: Sensors, local: bool) -> Ints:
    """Block (n,) of each row: scattered points if `local`, else regions; forces are one region."""
    if local:
        return sensors.groups % _BLOCKS
    rows = sensors.is_displacement
    blocks = np.zeros(len(sensors), dtype=np.int64)
    places = sensors.positions[rows]
    if not len(places):
        return blocks
    centres = spread_points(places, 0.0, min(_BLOCKS, len(np.unique(sensors.groups[rows]))))
    blocks[rows] = np.argmin(np.linalg.norm(places[:, None] - places[centres][None], axis=2), axis=1)
    blocks[~rows] = len(centres)
    return blocks


def distance(sensors: Sensors, errors: Floats) -> float:
    """Root mean square of the 3-D distances [m] that errors (n,) of displacements are, over all recorded points."""
    rows = sensors.is_displacement
    if not rows.any():
        return float("nan")
    _, group = np.unique(sensors.groups[rows], return_inverse=True)
    return root_mean_square(np.sqrt(np.bincount(group, weights=errors[rows] ** 2)))


class HeldOut:
    """Blocks of the rows of one case, each predicted from the others. `local`: whether a local cause acts."""

    def __init__(self, sensors: Sensors, local: bool) -> None:
        self.sensors, self.blocks = sensors, blocks_of(sensors, local)

    def error(self, prediction: Prediction) -> float:
        """Root mean square [m]."""
        return distance(self.sensors, prediction.errors)

    def with_patterns(
        self,
        without: GaussianModel,
        residual: Floats,
        modes: Floats,
        freedom: int,
        tries: int,
        random: np.random.Generator,
    ) -> tuple[Prediction, ...]:
        """Predictions with random patterns in the place of a mechanism.

        A pattern is a random mixture of the modes of a smooth force with the size that fits best. The best of `tries`
        patterns is taken, as the mechanism is the best of its places.

        `without`: of all else that acts.
        `residual` (n,).
        `modes` (n, m): as large as the noise.
        `freedom`: coefficients of the mechanism.
        """
        sizes = beliefs("unknown.sizes")
        chosen = []
        for _ in range(_PATTERNS):
            mixtures = random.normal(size=(tries, modes.shape[1], freedom)) / np.sqrt(freedom)
            patterns = [modes @ mixture for mixture in mixtures]
            blocks = Blocks(without, residual, [Cause("", tuple(map(Place, patterns)), 0.0, sizes)])
            logs = blocks.log_factors()
            place, size = np.unravel_index(int(np.argmax(logs)), logs.shape)
            chosen.append(sizes[size] * patterns[int(blocks.place[place])])
        return predict_with(without, residual, self.blocks, chosen)


class Confirming:
    """Checks the sets of one search.

    `draws`: of rows from each model at first. `alpha`: with which p-values are compared.
    """

    def __init__(self, search: HypothesisSearch, draws: int, random: np.random.Generator, alpha: float) -> None:
        self.search, self._draws, self._random, self._alpha = search, draws, random, alpha
        sensors = search.base.at.sensors
        self._held_out = {local: HeldOut(sensors, local) for local in (False, True)}
        #: Columns (n, m) of a smooth force as large as the noise, of which random patterns are mixtures.
        self.modes = search.base.typical_noise * along_own_axes(
            search.base.model, next(iter(search.base.unknown.values())).columns, search.base.residual
        )

    def p_of_nothing(self, nothing: WeightedSet) -> float:
        """p-value of the hypothesis that no cause acts.

        The smaller of two, times two (Bonferroni's correction). The first compares the Bayes factor of any cause with
        draws of the model without any, its gross errors included. These may hide what a local cause moves; the second
        takes the Bayes factor of all causes, each with gross errors of its own, which is `b` or more with a probability
        of `1 / b` at most if none acts (Markov's inequality).
        """
        levels = [level / 2.0 for level in (self._alpha, belief("fits.significance"))]
        bound = float(np.exp(-max(self.search.log_bayes_factor, 0.0) / calibration().temperature))
        return min(1.0, 2.0 * self._predictive_p(nothing, True, levels, bound))

    def p_left(self, weighted_set: WeightedSet) -> float:
        """p-value of the hypothesis that a set is all that acts, against unknown fields."""
        return self._predictive_p(weighted_set, False, [self._alpha])

    def _predictive_p(
        self, weighted_set: WeightedSet, mechanisms: bool, levels: Sequence[float], bound: float = 1.0
    ) -> float:
        fields, weights = [], []
        for cause in self.search.causes.causes:
            if cause.kind is Kind.UNKNOWN or (mechanisms and cause.kind is Kind.PHYSICS):
                columns = [
                    place.columns if place.mean is None else np.column_stack([place.mean, place.columns])
                    for place in cause.places
                ]
                fields += columns
                weights += [-np.log(len(columns))] * len(columns)
        logs = np.array(weights) - np.logaddexp.reduce(weights)
        model, residual, sizes = weighted_set.marginal.model, weighted_set.residual, beliefs("unknown.sizes")
        return predictive_p(model, fields, sizes, residual, self._draws, self._random, logs, levels, bound)

    def held_out_for(self, weighted_set: WeightedSet) -> HeldOut:
        """Held-out blocks for a set: scattered points if any of its effects is local, else regions."""
        return self._held_out[any(effect.proposed.centre is not None for effect in weighted_set.effects)]

    def predict(self, weighted_set: WeightedSet, held_out: HeldOut) -> Prediction:
        """Held-out rows predicted with a set."""
        return predict(weighted_set.marginal.model, weighted_set.residual, held_out.blocks)

    def confirmations(self, weighted_set: WeightedSet) -> tuple[Confirmation, ...]:
        """Of each mechanism of a set, given those that explain more.

        The one without which a set is most probable is left out first. Given all others, what two causes explain alike
        would confirm neither, and the weaker one where the stronger one is more like a third.
        """
        confirmed = {}
        while weighted_set.mechanisms:
            without = self._without(weighted_set)
            weakest = max(without, key=lambda name: without[name].hypothesis.log_evidence)
            confirmed[weakest] = self._confirm(weighted_set, weakest, without[weakest])
            weighted_set = without[weakest]
        return tuple(reversed(confirmed.values()))

    def _without(self, weighted_set: WeightedSet) -> dict[str, WeightedSet]:
        """Sets without one of the mechanisms of a set, by its name: those that were weighed, if any was.

        About a fit of all, what is left may do the work of a large cause that would be nothing without that.
        """
        every = {name: self.search.get(weighted_set.names - {name}) for name in weighted_set.mechanisms}
        weighed = {name: known for name, known in every.items() if known is not None}
        return weighed or {name: weighted_set.without(name, self.search.base) for name in every}

    def _confirm(self, weighted_set: WeightedSet, name: str, others: WeightedSet) -> Confirmation:
        effect = weighted_set.effects[weighted_set.acting.index(name)]
        held_out = self._held_out[effect.proposed.centre is not None]
        full, reduced = self.predict(weighted_set, held_out), self.predict(others, held_out)
        patterns = self._patterns(others, held_out, effect.columns.shape[1], (name,))
        return Confirmation(
            name,
            weighted_set.hypothesis.log_evidence - others.hypothesis.log_evidence,
            full.log_density - reduced.log_density,
            full.improvement(reduced, held_out.sensors.is_displacement, self._random),
            p_value(full.log_density, [pattern.log_density for pattern in patterns]),
        )

    def _patterns(
        self, others: WeightedSet, held_out: HeldOut, freedom: int, names: Sequence[str]
    ) -> tuple[Prediction, ...]:
        # places of a scan are far from independent of each other
        places = max(len(self.search.causes.named(name).places) for name in names)
        tries = int(min(places, belief("checks.tries")))
        model = others.marginal.model
        return held_out.with_patterns(model, others.residual, self.modes, freedom, tries, self._random)

    def improvement(
        self, others: WeightedSet, weighted_set: WeightedSet
    ) -> tuple[tuple[float, float], tuple[float, float, float]]:
        """Held-out errors with random patterns in the place of the mechanisms of a set, and what these improve.

        `others`: the set without mechanisms. Quantiles of 5 and 95 % of the former [m]; the part of its error that is
        removed, and its 95 % interval.
        """
        held_out = self.held_out_for(weighted_set)
        acting = zip(weighted_set.acting, weighted_set.effects, strict=True)
        freedom = width_of([effect for name, effect in acting if name not in others.names])
        patterns = self._patterns(others, held_out, freedom, weighted_set.mechanisms)
        low, high = np.quantile([held_out.error(pattern) for pattern in patterns], [0.05, 0.95]).tolist()
        without, explained = self.predict(others, held_out), self.predict(weighted_set, held_out)
        lengths = held_out.sensors.is_displacement
        return (low, high), explained.improvement(without, lengths, self._random)

    def ceiling(self, others: WeightedSet, held_out: HeldOut) -> float:
        """Least held-out error [m] with an unknown field of any size beside other causes."""
        base, sizes = self.search.base, beliefs("unknown.sizes")
        column_sets = [size * base.typical_noise * f.columns for f in base.unknown.values() for size in sizes]
        predictions = predict_with(others.marginal.model, others.residual, held_out.blocks, column_sets)
        return held_out.error(max(predictions, key=lambda prediction: prediction.log_density))


def check_errors(case: Case, base: Base, fits: Sequence[Refit]) -> tuple[float, ...] | None:
    """Root mean square distances [m]: of the case as declared, then of each fit; None if there is nothing to check.

    A fit predicts them by its state at their times, the expected error of the mesh, and its nuisances: an error of
    registration is the same for recordings that are fitted and for others.
    """
    if all(recording.kind == "force" for recording in case.recordings if recording.role == "check"):
        return None
    checks = States(case, base.states.device, "check")
    checks.centre = base.states.centre
    declared = _sensors(checks, base.declared, None)
    # fits are to realigned recordings, see `realigned`
    checks.realign(base.states.motion)
    return distance(declared, declared.residual), *(_error(checks, base, fit) for fit in fits)


def _error(checks: States, base: Base, fit: Refit) -> float:
    """Root mean square distance [m] of a fit."""
    error = None if base.mesh_errors is None else _mesh_error(base, base.mesh_errors, fit)
    sensors = _sensors(checks, fit.state, error)
    at_times = _at_nearest_times(sensors, base.states.times)
    nuisances, _ = base.for_sensors(at_times)
    columns = with_shapes_about(fit, nuisances, at_times, base)
    rigid = RigidMotion(checks, nuisances)
    linear = fit.nuisances[: nuisances.columns.shape[1]].copy()
    # which the state has
    linear[nuisances.part("tissue")] = linear[nuisances.part(FIELD)] = linear[rigid.part] = 0.0
    residual = sensors.residual - columns @ linear
    return distance(sensors, residual + rigid.change(sensors, fit.nuisances))


def _sensors(checks: States, state: SolvedState, error: Difference | None) -> Sensors:
    """What is checked beside a state; at times at which something else acts, beside the states of these."""
    case = checks.case_of(state.hypothesis)
    moments = Moments.of(case, checks.times)
    ended = moments.cases[0] is case and state.creep is None and len({id(i.system) for i in state.instants}) == 1
    if ended or checks.times == (math.inf,):
        instants = tuple(replace(state.instants[-1], time=time) for time in checks.times)
        return checks.corrected(replace(state, instants=instants, creep=None), error).sensors
    return checks.solve(state.hypothesis, state.u, error).sensors


def _at_nearest_times(sensors: Sensors, times: Sequence[float]) -> Sensors:
    """The rows as if their states were those of the nearest of some times [s]: what is linear about these is alike."""

    def nearest(wanted: Floats) -> Ints:
        ranks = np.concatenate([np.array(times), wanted])
        finite = finite_times(ranks)
        return np.abs(finite[len(times) :, None] - finite[: len(times)]).argmin(axis=1)

    if times == (math.inf,):
        return replace(sensors, after=np.zeros_like(sensors.after), before=np.full_like(sensors.before, -1))
    before = np.where(sensors.before < 0, -1, nearest(sensors.references))
    return replace(sensors, after=nearest(sensors.times), before=before)


def _mesh_error(base: Base, known: MeshErrors, fit: Refit) -> Difference:
    """The expected error of the mesh, with that of mechanisms where a finer mesh can be solved."""
    hypothesis = fit.state.hypothesis
    if not any(effect.proposed.changes_in_time for effect in fit.effects):
        try:
            return expected(known.finer.error(hypothesis, fit.state))
        except SolveError:
            pass
    return expected(known.of(hypothesis.theta, base.prior))
