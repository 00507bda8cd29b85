"""Which kind of mechanism explains residuals best, to first order: evidence of every proposal, averaged over a kind.

Averaging over places, levels and sets is the correction for having looked in many of them. Beside named kinds stands
the unknown: any smooth force, or two places that draw each other. What changes in time is credited only with what
changes: it is compared with what it is at first, if that were for ever (`Effect.lasting`).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import KAPPAS, Explanation, Stack, log_mean
from warpbrain.diagnosis.pairs import PairEvidence
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.threads import in_threads
from warpbrain.worlds.body.dictionary import Candidates

Floats = NDArray[np.float64]

UNKNOWN = "unknown"
#: Residuals that one thread compares with everything.
_AT_ONCE = 32


@dataclass(frozen=True, eq=False)
class Screen:
    """Evidence of b residuals, logarithms, against nothing missing.

    Attributes
    ----------
    kinds : tuple of str
        Those of the candidates, then ``"unknown"``.
    none : (b,) array
        Log density with nothing missing.
    log_factors : (kinds, b) array
        Log Bayes factor of each kind.
    places : (v, b) array
        Of each effect.
    """

    kinds: tuple[str, ...]
    none: Floats
    log_factors: Floats
    places: Floats

    @property
    def alarm(self) -> Floats:
        """Log Bayes factor (b,) of anything missing: the mean over kinds."""
        return log_mean(self.log_factors)

    def best_effect(self, candidates: Candidates, kind: str, number: int = 0) -> int:
        """Number of the most probable effect of a kind."""
        own = candidates.of_kind[kind]
        return int(own[np.argmax(self.places[own, number])])


class Screening:
    """Compares residuals with candidates.

    Parameters
    ----------
    explanation : Explanation
        Noise and nuisances.
    candidates : Candidates
    flexible : sequence of (n, k) arrays
        Columns of any smooth force, each with a length and a size.
    kappas : (k,) array
        Factors on the noise that are averaged over.
    pairs : PairEvidence, optional
        Of two places that draw each other, beside the explanation; without it the unknown is a smooth force.
    """

    def __init__(
        self,
        explanation: Explanation,
        candidates: Candidates,
        flexible: list[Floats],
        kappas: Floats = KAPPAS,
        pairs: PairEvidence | None = None,
    ) -> None:
        self.explanation = explanation
        self.candidates = candidates
        lasting = {kind: candidates.effects[own[0]].lasting for kind, own in candidates.of_kind.items()}
        beside = {kind: explanation.with_more(own) for kind, own in lasting.items() if own is not None}
        self._ask(explanation.stack(candidates.effects), explanation.stack_of_forces(flexible), beside)
        self._kappas = kappas
        self.pairs = pairs

    def _ask(self, stack: Stack, forces: Stack, lasting: dict[str, Explanation]) -> None:
        """Take effects and smooth forces, whitened, and beside what kinds that change in time are compared."""
        self.of_effects = StackEvidence(self.explanation, stack)
        self._of_forces = StackEvidence(self.explanation, forces)
        own = {kind: stack.some(self.candidates.of_kind[kind]) for kind in lasting}
        self._lasting = {kind: StackEvidence(beside, own[kind]) for kind, beside in lasting.items()}

    @property
    def stack(self) -> Stack:
        """Effects, whitened."""
        return self.of_effects.stack

    @property
    def forces(self) -> Stack:
        """Smooth forces, whitened."""
        return self._of_forces.stack

    def standardised(self, kappa: float) -> Screening:
        """The same for residuals `S^-1/2 r`, in which noise and nuisances are of variance one: the factor is known."""
        found, known = copy.copy(self), self.explanation
        found.explanation = Explanation(np.eye(known.size), np.zeros((known.size, 0)))
        stack = Stack(known.standardised(self.stack.columns, kappa), self.stack.first)
        forces = Stack(known.standardised(self.forces.columns, kappa), self.forces.first)
        lasting = {kind: self.candidates.effects[self.candidates.of_kind[kind][0]].lasting for kind in self._lasting}
        beside = {
            kind: found.explanation.with_more(known.standardised(known.whitened(own), kappa))
            for kind, own in lasting.items()
        }
        found._ask(stack, forces, beside)
        found._kappas = np.ones(1)
        if self.pairs is not None:
            seen = self.pairs.pairs.seen(lambda rows: known.standardised(known.whitened(rows), kappa))
            found.pairs = PairEvidence(found.explanation, seen, self.pairs.noise)
        return found

    def with_noise(self, rows: NDArray[np.bool_], times: float) -> Screening:
        """The same with the noise of some rows (n,) so many times as large; see `Explanation.with_noise`."""
        found, known = copy.copy(self), self.explanation
        found.explanation = known.with_noise(rows, times)
        stack = Stack(known.whitened_anew(self.stack.columns, rows, times), self.stack.first)
        forces = Stack(known.whitened_anew(self.forces.columns, rows, times), self.forces.first)
        found._ask(
            stack, forces, {kind: own.explanation.with_noise(rows, times) for kind, own in self._lasting.items()}
        )
        if self.pairs is not None:
            found.pairs = PairEvidence(found.explanation, self.pairs.pairs, self.pairs.noise)
        return found

    def run(self, residuals: Floats) -> Screen:
        """Evidence for whitened residuals (n, b): of many some at a time, in threads."""
        for one in (self.of_effects, self._of_forces, *self._lasting.values()):
            one.prepare(self._kappas)
        if self.pairs is not None:
            self.pairs.prepare(self._kappas)
        each = [residuals[:, low : low + _AT_ONCE] for low in range(0, max(residuals.shape[1], 1), _AT_ONCE)]
        nones, all_places, unknowns = zip(*in_threads(self._some, each), strict=True)
        none, places = np.concatenate(nones), np.concatenate(all_places, axis=1)
        log_factors = np.vstack([self._by_kind(places), np.concatenate(unknowns)])
        return Screen((*self.candidates.kinds, UNKNOWN), none, log_factors, places)

    def _some(self, residuals: Floats) -> tuple[Floats, Floats, Floats]:
        """Log density (b,) with nothing missing, and log Bayes factors (v, b) of effects and (b,) of the unknown."""
        none = self.explanation.log_marginal(residuals, self._kappas)
        places = self.of_effects.log_places(residuals, self._kappas) - none
        for kind, lasting in self._lasting.items():
            alike = lasting.explanation.log_marginal(residuals, self._kappas)
            places[self.candidates.of_kind[kind]] = lasting.log_places(residuals, self._kappas) - alike
        return none, places, self._log_unknown(residuals) - none

    def _log_unknown(self, residuals: Floats) -> Floats:
        """With what has no name: a smooth force, or as likely two places that draw each other."""
        smooth = log_mean(self._of_forces.log_places(residuals, self._kappas))
        if self.pairs is None:
            return smooth
        return log_mean(np.array([smooth, self.pairs.log_marginal(residuals, self._kappas)]))

    def _by_kind(self, places: Floats) -> Floats:
        rows = [log_mean(places[own]) for own in self.candidates.of_kind.values()]
        return np.array(rows).reshape(len(rows), places.shape[1])


def log_unknown(flexible: Sequence[Explanation], residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
    """Log density (b,) of whitened residuals with a force of any of some lengths and sizes, all alike likely."""
    return log_mean(np.array([explanation.log_marginal(residuals, kappas) for explanation in flexible]))
