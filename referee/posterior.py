"""The optimal analyst's posterior over sets of causes: nothing, every mechanism, every pair, the unknown, three traps.

Under each any point may be mistaken. Which ones most probably are depends on the causes: points that a cause moves far
look mistaken under nothing. So all are weighed with no mistakes, with those of nothing, and with those of whatever is
probable so far, of which the best counts; what other mistakes add is that of each point by itself (`Mixture`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import softmax
from scipy.stats import chi2

from referee.diagnoses import NOT_PHYSICS, UNKNOWN
from referee.draw import MECHANISMS
from referee.evidence import Evidence, pair, single
from referee.library import Draws
from referee.lost import Lost
from referee.mistakes import Bools, Mixture
from referee.plan import BOTH, SHARES

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Causes = tuple[str, ...]

#: Sets of mistakes that are tried at most, and by how much [nats] less probable causes are no longer weighed.
_TRIED, _NEGLIGIBLE = 8, 25.0


@dataclass(frozen=True, eq=False)
class _Weighed:
    """A set of causes, weighed with some mistakes."""

    summed: float  # log density of the rows, summed over which points are mistaken, and log prior
    mistakes: Bools  # (g,), the most probable ones beside these causes


class Analyst:
    """Weighs whitened rows.

    Parameters
    ----------
    lower : (rows, rows) array
        Factor of the covariance of all that is not known but mistakes.
    points : (g, 3) array of int
        Rows of each point that may be mistaken.
    share : float
        Of points that are.
    named : dict of str to Draws
    nameless : Draws
    traps : list of (rows, rows) array
        Covariance, in units of all that is not known, of each thing that is no physics.
    """

    def __init__(
        self, lower: Floats, points: Ints, share: float, named: dict[str, Draws], nameless: Draws, traps: list[Floats]
    ) -> None:
        self._lower, self._share = lower, share
        self._whiten: Floats = solve_triangular(lower, np.eye(len(lower)), lower=True)
        self._mixture = Mixture(self._whiten.T @ self._whiten, points, share)
        self._traps = []
        for trap in traps:
            inverse = np.linalg.inv(trap)
            mixture = Mixture(self._whiten.T @ inverse @ self._whiten, points, share)
            self._traps.append((mixture, 0.5 * float(np.linalg.slogdet(inverse)[1])))
        prior = SHARES["scored"]
        rest = 1.0 - sum(prior.values())
        couples = list(itertools.combinations(MECHANISMS, 2))
        above = {name: draws.above(BOTH) for name, draws in named.items()}
        self._causes: dict[Causes, tuple[float, Callable[[Floats, Lost], Evidence], tuple[Draws, ...]]] = {}
        for name, draws in named.items():
            self._add((name,), rest / len(MECHANISMS), draws)
        for one, other in couples:
            if one in named and other in named:
                self._add((one, other), prior["two"] / len(couples), above[one], above[other])
        self._add((UNKNOWN,), prior["outside"], nameless)
        self._none, self._trap = prior["none"], prior["trap"] / max(len(traps), 1)

    def _add(self, causes: Causes, prior: float, *draws: Draws) -> None:
        def weigh(w: Floats, lost: Lost) -> Evidence:
            return single(w, draws[0], lost) if len(draws) == 1 else pair(w, draws[0], draws[1], lost)

        self._causes[causes] = float(np.log(prior)), weigh, draws

    def posterior(self, w: Floats) -> tuple[dict[Causes, float], float]:
        """Probabilities of sets of causes of rows (rows,), and the p-value of nothing."""
        rows = self._lower @ w
        log, wrong = self._mixture.log_density(rows)
        logs: dict[Causes, float] = {(): log + float(np.log(self._none))}
        logs |= {causes: weighed.summed for causes, weighed in self._weighed(w, wrong).items()}
        for k, (mixture, volume) in enumerate(self._traps):
            logs[NOT_PHYSICS, str(k)] = mixture.log_density(rows, wrong)[0] + volume + float(np.log(self._trap))
        p = dict(zip(logs, softmax(list(logs.values())).tolist(), strict=True))
        left = self._lost(wrong).left(w[None])[0]
        return p, float(chi2.sf(left @ left, len(w) - 3 * int(wrong.sum())))

    def _weighed(self, w: Floats, wrong: Bools) -> dict[Causes, _Weighed]:
        """Every set of causes with the best of the mistakes that were tried."""
        best: dict[Causes, _Weighed] = {}
        waiting, tried = [wrong, np.zeros_like(wrong)], set[bytes]()
        while waiting and len(tried) < _TRIED:
            mistakes = waiting.pop(0)
            if mistakes.tobytes() in tried:
                continue
            tried.add(mistakes.tobytes())
            least = max((each.summed for each in best.values()), default=-np.inf) - _NEGLIGIBLE
            for causes in self._causes:
                # all of them with the first two
                if len(tried) < 3 or best[causes].summed > least:
                    weighed = self._try(w, causes, mistakes)
                    if causes not in best or weighed.summed > best[causes].summed:
                        best[causes] = weighed
            if not waiting:
                likely = sorted(best.values(), key=lambda each: -each.summed)
                waiting = [each.mistakes for each in likely if each.mistakes.tobytes() not in tried]
        return best

    def _try(self, w: Floats, causes: Causes, wrong: Bools) -> _Weighed:
        """Weigh a set of causes with some mistakes."""
        log_prior, weigh, draws = self._causes[causes]
        lost, rows = self._lost(wrong), self._lower @ w
        evidence = weigh(w, lost)
        if not evidence.members:
            return _Weighed(-np.inf, wrong)
        # with no cause, but for where it leaves the mistaken points
        log = self._mixture.log_joint(rows, wrong) - float(lost.log_density(lost.at(w[None]))[0])
        log += evidence.log + log_prior
        change = np.zeros_like(w)
        for each, (k, size) in zip(draws, evidence.members, strict=True):
            change += size * each.directions[k]
        left = rows - self._lower @ change
        summed, mistakes = self._mixture.log_density(left, wrong)
        return _Weighed(log + summed - self._mixture.log_joint(left, wrong), mistakes)

    def _lost(self, wrong: Bools) -> Lost:
        return Lost(self._whiten[:, self._mixture.points[wrong].ravel()])
