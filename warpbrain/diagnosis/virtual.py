"""What these recordings could tell: cases of the linear model, drawn with each cause in turn and put to the rule.

Coefficients are drawn from the prior of a cause, its place from its scan. With noise and nuisances whitened away,

    y = S^-1/2 (mean + columns z) + e,    e, z ~ N(0, I),    S = U U^T + kappa^2 L L^T

so a case costs no draw of nuisances, and all cases of a cause go through screening at once. The factor on the noise is
taken for known. The rule is the one of real cases (`verdict.py`), where what needs refits and held-out points is taken
for passed. It is the linear model's word of itself: it is only nearly right about the world, so fewer real cases are
named than virtual ones.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.calibration import weighed
from warpbrain.diagnosis.result import GROUP, NAMED, NOTHING, WITH_IT, WITHOUT_IT, Confusion, Ranked
from warpbrain.diagnosis.screening import UNKNOWN, Screen, Screening
from warpbrain.diagnosis.verdict import LARGEST, TENFOLD, Evidence, decide

Floats = NDArray[np.float64]

#: Virtual cases of each cause as it is expected to be, and of each mechanism with each detectability.
CASES, CASES_OF_SIZE = 200, 40
#: Those in which nothing is missing that say from where on there is an alarm.
NULL = 500
#: Those detectabilities.
SIZES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 11.0, 15.0)
#: Fewer of a detectability than these that are plausible say nothing.
FEWEST = 10


class VirtualCases:
    """Virtual cases with the anatomy, sensors and noise of a real one.

    Parameters
    ----------
    screening : Screening
        Of the real case.
    kappa : float
        Factor on the noise.
    alpha : float
        Probability of an alarm where nothing is missing.
    rng : numpy.random.Generator
    """

    def __init__(self, screening: Screening, kappa: float, alpha: float, rng: np.random.Generator) -> None:
        self.screening = screening.standardised(kappa)
        self.candidates = screening.candidates
        self._alpha, self._rng = alpha, rng
        null = self.screening.run(rng.normal(size=(self.screening.explanation.size, NULL)))
        self._null = np.sort(null.alarm)
        self._mechanisms = [kind for kind in self.candidates.kinds if kind not in self.candidates.alternatives]

    def confusion(self, cases: int = CASES, cases_of_size: int = CASES_OF_SIZE) -> Confusion:
        """What is said of cases of each cause, and of each mechanism by how visible it is."""
        rows = {NOTHING: _shares(self._said(NOTHING, np.zeros((self.screening.explanation.size, cases))))}
        for cause in self.screening.run(np.zeros((self.screening.explanation.size, 1))).kinds:
            rows[cause] = _shares(self._said(cause, self.drawn(cause, cases)))
        alarm, named = {}, {}
        for kind in self._mechanisms:
            changes, first = self._of_sizes(kind, cases_of_size)
            said = self._said(kind, changes)
            shares = [_shares(said[low:high]) if high - low >= FEWEST else None for low, high in pairwise(first)]
            alarm[kind] = tuple(None if one is None else 1.0 - one.get(NOTHING, 0.0) for one in shares)
            named[kind] = tuple(None if one is None else one.get(kind, 0.0) for one in shares)
        return Confusion(cases, rows, SIZES, alarm, named)

    def drawn(self, cause: str, count: int) -> Floats:
        """What a cause changes of what is recorded (n, count), standardised, as it is expected beforehand."""
        if cause == UNKNOWN:
            each = [self._nameless() for _ in range(count)]
            return np.column_stack([columns @ self._rng.normal(size=columns.shape[1]) for columns in each])
        return np.column_stack([self._one(number)[0] for number in self._members(cause, count)])

    def _nameless(self) -> Floats:
        """Columns (n, k) of something without a name, each kind of it as often."""
        forces, pairs = self.screening.forces, self.screening.pairs
        if pairs is not None and self._rng.random() < 0.5:
            return pairs.drawn(self._rng)
        return forces.of(int(self._rng.integers(len(forces))))[:, 1:]

    def _members(self, kind: str, count: int) -> list[int]:
        return self._rng.choice(self.candidates.of_kind[kind], count).tolist()

    def _one(self, number: int) -> tuple[Floats, float, float]:
        """What an effect (n,) changes, and how many times that, at least and at most, would still be plausible."""
        effect, own = self.candidates.effects[number], self.screening.stack.of(number)
        z = self._rng.normal(size=own.shape[1] - 1)
        mean = np.zeros(len(z))
        if effect.proposal is not None and effect.mean.any():
            mean = (effect.proposal.mean - effect.proposal.without) / effect.proposal.sd
        ends = np.sort((mean + LARGEST * np.array([[-1.0], [1.0]])) / (mean + z), axis=0)
        # times of relaxation of what does not relax are no matter
        matter = own[:, 1:].any(axis=0)
        if not matter.any():
            # no size makes visible what no sensor sees
            return own[:, 0], math.inf, -math.inf
        return own[:, 0] + own[:, 1:] @ z, float(ends[0, matter].max()), float(ends[1, matter].min())

    def _of_sizes(self, kind: str, count: int) -> tuple[Floats, list[int]]:
        """Changes (n, b) scaled to each detectability in turn where that is plausible, and where each begins."""
        found, first = [np.zeros((self.screening.explanation.size, 0))], [0]
        for size in SIZES:
            drawn = [self._one(number) for number in self._members(kind, count)]
            for change, least, most in drawn:
                times = size / max(float(np.linalg.norm(change)), 1e-12)
                if least <= times <= most:
                    found.append(times * change[:, None])
            first.append(sum(one.shape[1] for one in found))
        return np.concatenate(found, axis=1), first

    def _said(self, cause: str, changes: Floats) -> list[str]:
        """What is said of cases with these changes (n, b)."""
        screen = self.screening.run(changes + self._rng.normal(size=changes.shape))
        above = len(self._null) - np.searchsorted(self._null, screen.alarm)
        p_values = (1 + above) / (1 + len(self._null))
        chances = weighed(screen.kinds, screen.log_factors, self.candidates.alternatives)
        return [self._verdict(cause, screen, chances[:, k], p) for k, p in enumerate(p_values.tolist())]

    def _verdict(self, cause: str, screen: Screen, chances: Floats, p_value: float) -> str:
        ranking = [self._ranked(screen.kinds[k], float(chances[k])) for k in np.argsort(-chances).tolist()]
        # held-out points are better predicted, but not so plainly that a weak alarm would do
        passed = Evidence(self._alpha, p_value, p_value, ranking, np.inf, TENFOLD, 0.0, 1.0, 1.0, 0.0, np.inf, 0.0, 0)
        verdict = decide(passed)
        if verdict.verdict == NAMED:
            return verdict.kinds[0]
        if verdict.verdict == GROUP:
            return WITH_IT if cause in verdict.kinds else WITHOUT_IT
        return verdict.verdict

    def _ranked(self, kind: str, chance: float) -> Ranked:
        return Ranked(kind, kind in self._mechanisms, 0.0, chance, 0.0, None, (), None, None, "")


def _shares(said: list[str]) -> dict[str, float]:
    """How often each thing is said, of what is said at all."""
    return {one: count / len(said) for one, count in Counter(said).items()}
