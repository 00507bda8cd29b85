"""One addition to what is assumed: whether anything is left, and what explains it best."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.calibration import SPECIMENS, probabilities
from warpbrain.diagnosis.held_out import Predicted
from warpbrain.diagnosis.specimen.acting import Assumption
from warpbrain.diagnosis.specimen.fitting import Fitting, SpecimenFit
from warpbrain.diagnosis.specimen.folds import Folds, held_out
from warpbrain.diagnosis.specimen.screening import Columns, columns_of, p_value, with_smooth_changes
from warpbrain.diagnosis.verdict import LARGEST, SURE, TOGETHER

Floats = NDArray[np.float64]

UNKNOWN = "unknown"
#: Kinds whose prediction of held-out tests is computed even if they are no physics.
_PREDICTED = 3
#: A rival predicts better if its held-out error is smaller than this part; it counts if its log evidence is not farther
#: behind than this, by which curves that are smooth can mislead.
_RIVAL, _NEAR = 0.8, 25.0
#: Probability that another branch of what was added already needs.
_MORE = 0.5
#: Probability below which a kind is in no label set.
_LEAST = 0.02


@dataclass(frozen=True, eq=False)
class Candidate:
    """A kind at a stage.

    Attributes
    ----------
    kind : str
    physics : bool
    log_evidence : float
        Against the fit without it, anything smooth left over being allowed to both.
    probability : float
        Among all, nothing else being left over.
    at_most : float
        The larger one of that and of anything smooth being left over.
    fit : SpecimenFit or None
        None of the unknown, and where no fit stands.
    predicted : Predicted or None
        Of held-out tests.
    stress : (n,) array or None
        Held-out prediction [Pa].
    """

    kind: str
    physics: bool
    log_evidence: float
    probability: float
    at_most: float
    fit: SpecimenFit | None
    predicted: Predicted | None
    stress: Floats | None

    @property
    def assumption(self) -> Assumption | None:
        """Which way of the kind."""
        return self.fit.hypothesis.assumptions[-1] if self.fit is not None else None

    @property
    def size(self) -> float:
        """Largest of its coefficients in standard deviations of the prior."""
        if self.fit is None or self.assumption is None:
            return 0.0
        return float(np.abs(self.fit.z[-len(self.assumption.mean) :]).max())


@dataclass(frozen=True, eq=False)
class Stage:
    """What one addition came to.

    Attributes
    ----------
    without : SpecimenFit
    p_value : float
        Of nothing being left.
    columns : list of Columns
    candidates : tuple of Candidate
        The most probable first; empty if nothing is left.
    predicted : Predicted
        Of held-out tests by the fit without.
    stress : (n,) array
        Held-out prediction [Pa].
    accepted : Candidate or None
        What is added.
    label_set : tuple of str
        The fewest kinds that are probable enough together, where none is alone.
    why : str
        What kept a name from being spoken.
    """

    without: SpecimenFit
    p_value: float
    columns: list[Columns]
    candidates: tuple[Candidate, ...]
    predicted: Predicted
    stress: Floats
    accepted: Candidate | None
    label_set: tuple[str, ...]
    why: str


class Staging:
    """Runs stages.

    Parameters
    ----------
    fitting : Fitting
    folds : Folds
    ways : mapping of str to sequence of Assumption
        Candidates by kind.
    alpha : float
    draws : int
    rng : Generator
    say : callable
        Told what is done.
    """

    def __init__(
        self,
        fitting: Fitting,
        folds: Folds,
        ways: Mapping[str, Sequence[Assumption]],
        alpha: float,
        draws: int,
        rng: np.random.Generator,
        say: Callable[[str], None],
    ) -> None:
        self.fitting, self.folds, self.ways = fitting, folds, ways
        self.alpha, self.draws, self.rng, self.say = alpha, draws, rng, say

    def run(self, without: SpecimenFit) -> Stage:
        """Everything about one addition."""
        forward = self.fitting.forward
        repeatable = {kind for kind, own in self.ways.items() if own[0].runs and kind == "viscoelasticity"}
        ways = {
            kind: own for kind, own in self.ways.items() if kind not in without.hypothesis.kinds or kind in repeatable
        }
        forward.use_shape_of(forward.material(without.hypothesis, without.z))
        columns = columns_of(forward, without, ways)
        p = p_value(without, columns, self.draws, self.rng)
        predicted, stress = held_out(self.fitting, without, self.folds)
        nothing = Stage(without, p, columns, (), predicted, stress, None, (), "")
        if p > self.alpha or not ways:
            return nothing
        candidates = self._candidates(without, ways)
        best = candidates[0]
        # more of what is added already needs no new name
        known = best.kind in without.hypothesis.kinds
        vetoes = self._vetoes(best, candidates)
        if best.physics and not known and best.predicted is not None and best.predicted.rmse >= predicted.rmse:
            vetoes.append("held-out tests are not predicted better with it")
        why = "; ".join(vetoes)
        sure = best.at_most >= _MORE if known else best.probability >= SURE
        spoken = best.physics and sure and not why
        accepted = best if spoken or (best.fit is not None and not best.physics and best.probability >= 0.5) else None
        label_set = () if accepted else _label_set(candidates)
        return Stage(without, p, columns, candidates, predicted, stress, accepted, label_set, why)

    def _candidates(self, without: SpecimenFit, ways: Mapping[str, Sequence[Assumption]]) -> tuple[Candidate, ...]:
        from scipy.special import logsumexp

        forward = self.fitting.forward
        base = float(np.logaddexp(without.log_evidence, with_smooth_changes(forward, without)) - np.log(2.0))
        log_evidence: dict[str, float] = {}
        log_alone: dict[str, float] = {}
        fits: dict[str, SpecimenFit | None] = {}
        for kind, own in ways.items():
            self.say(f"fit with {kind}")
            found = [one for one in (self._fit(without, way) for way in own) if one is not None]
            fits[kind] = max(found, key=lambda one: one.log_evidence) if found else None
            # alone, or with something smooth left over: half each; over the ways of a kind: the mean
            alone = np.array([one.log_evidence for one in found])
            either = [np.logaddexp(one.log_evidence, with_smooth_changes(forward, one)) - np.log(2.0) for one in found]
            log_evidence[kind] = (float(logsumexp(either)) - np.log(len(own)) if found else -np.inf) - base
            log_alone[kind] = (float(logsumexp(alone)) - np.log(len(own)) if found else -np.inf) - without.log_evidence
        smooth = with_smooth_changes(forward, without)
        fits[UNKNOWN], log_evidence[UNKNOWN] = None, smooth - base
        physics = {kind: kind != UNKNOWN and ways[kind][0].physics for kind in log_evidence}
        alternatives = frozenset(kind for kind, own in physics.items() if not own and kind != UNKNOWN)
        # Smooth changes of single tests carry over to no other test: beside them half a cause fits as well as a whole
        # one. They say whether there is a name at all; which it is, is said without them, and by held-out tests.
        with_rest, alone_only = (probabilities(each, alternatives, SPECIMENS) for each in (log_evidence, log_alone))
        known = 1.0 - with_rest[UNKNOWN]
        chances = {UNKNOWN: with_rest[UNKNOWN]} | {kind: known * own for kind, own in alone_only.items()}
        at_most = {kind: max(own, with_rest[kind]) for kind, own in chances.items()}
        order = sorted(chances, key=lambda kind: -chances[kind])
        candidates = []
        for number, kind in enumerate(order):
            fit = fits[kind]
            predicted = (
                held_out(self.fitting, fit, self.folds)
                if fit is not None and (number < _PREDICTED or physics[kind])
                else None
            )
            candidates.append(
                Candidate(
                    kind,
                    physics[kind],
                    log_evidence[kind],
                    chances[kind],
                    at_most[kind],
                    fit,
                    predicted[0] if predicted else None,
                    predicted[1] if predicted else None,
                )
            )
        return tuple(candidates)

    def _fit(self, without: SpecimenFit, way: Assumption) -> SpecimenFit | None:
        begin = []
        for start in way.starts:
            own = np.zeros(len(way.mean))
            own[: len(start)] = start
            begin.append(np.concatenate([without.z, own]))
        return self.fitting.fit(without.hypothesis.with_more(way), self.folds.fitted, begin, without.kappa)

    def _vetoes(self, best: Candidate, candidates: Sequence[Candidate]) -> list[str]:
        vetoes = []
        if best.size > LARGEST:
            vetoes.append("its size would be implausible")
        rivals = _rivals(candidates)
        if rivals:
            vetoes.append(f"held-out tests are predicted better with {' or '.join(rivals)}")
        return vetoes


def _rivals(candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """Physics that predicts held-out tests clearly better than the most probable does."""
    best, least = candidates[0].predicted, candidates[0].log_evidence - _NEAR
    if best is None:
        return ()
    near = [one for one in candidates[1:] if one.physics and one.log_evidence > least]
    return tuple(one.kind for one in near if one.predicted and one.predicted.rmse < _RIVAL * best.rmse)


def _label_set(candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """The fewest kinds that are probable enough together, and what predicts better than the first of them."""
    total = np.cumsum([one.probability for one in candidates])
    # the smaller probabilities of all may not reach it
    count = int(np.searchsorted(total, min(TOGETHER, float(total[-1])))) + 1
    possible = [
        one.kind
        for k, one in enumerate(candidates)
        if (k < count and one.at_most > _LEAST) or one.at_most > 1.0 - TOGETHER
    ]
    return tuple(dict.fromkeys([*possible, *_rivals(candidates)]))
