"""Draws of the posterior where Laplace's approximation fails: a Markov chain with delayed acceptance.

A proposal must first pass with the state that derivatives at the estimate predict, which costs no equilibrium; only
then is its equilibrium solved, and what the prediction got wrong decides (Christen and Fox 2005, J. Comput. Graph.
Stat. 14, 795). Proposals are steps in turn with draws of the mixture around all estimates, which cross from one mode of
Ogden's exponents to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.estimation.proposal import Proposal
from warpbrain.estimation.target import Target

#: Steps a solve at most, that a chain may end which finds nothing.
_STEPS_A_SOLVE = 50
#: Part of the chain that is forgotten.
_BURN_IN = 0.2


@dataclass(frozen=True, eq=False)
class Chain:
    """Draws of the posterior.

    Attributes
    ----------
    theta : (n, p) array
        After the beginning, which is forgotten.
    solves : int
        Equilibria in all.
    accepted : float
        Part of the solved proposals that were taken.
    effective : (p,) array
        Independent draws that would tell as much of each parameter.
    """

    theta: Floats
    solves: int
    accepted: float
    effective: Floats


def run_chain(
    target: Target,
    proposal: Proposal,
    start: Floats,
    solves: int,
    rng: np.random.Generator,
    on_solve: Callable[[int], None] | None = None,
) -> Chain:
    """Draw from a posterior.

    Parameters
    ----------
    target : Target
    proposal : Proposal
    start : (p,) array
        Where the posterior is not zero.
    solves : int
        Equilibria that may be solved.
    rng : Generator
    on_solve : callable, optional
        Called with the number of each.

    Raises
    ------
    SolveError
        If the start has no equilibrium.
    """
    here, cheap = target.log_density(start), target.linearised(start)
    if not np.isfinite(here):
        raise SolveError(f"a chain cannot start from theta = {start.tolist()}: there is no equilibrium")
    theta, path = start, [start]
    done, accepted = 1, 0
    while done < solves and len(path) < _STEPS_A_SOLVE * solves:
        trial, balance = _propose(target, proposal, theta, rng)
        cheap_there = target.linearised(trial)
        if np.log(rng.uniform()) < cheap_there - cheap + balance:
            there = target.log_density(trial)
            done += 1
            if on_solve is not None:
                on_solve(done)
            # the share that the first stage has decided already is taken off
            if np.log(rng.uniform()) < (there - here) - (cheap_there - cheap):
                theta, here, cheap = trial, there, cheap_there
                accepted += 1
        path.append(theta)
    kept = np.array(path[int(_BURN_IN * len(path)) :])
    return Chain(kept, done, accepted / max(done - 1, 1), np.array([effective_size(column) for column in kept.T]))


def _propose(target: Target, proposal: Proposal, theta: Floats, rng: np.random.Generator) -> tuple[Floats, float]:
    """A point, and the log ratio of coming back to going there."""
    if rng.uniform() < 0.5:
        trial = proposal.draw(rng, 1)[0]
        back, there = proposal.log_density(np.array([theta, trial]))
        return trial, float(back - there)
    # one size of step wherever it starts, or there would be no way back
    factor = proposal.modes[0].laplace.posterior.factor
    return theta + 1.7 / np.sqrt(len(theta)) * factor @ rng.normal(size=len(theta)), 0.0


def effective_size(values: Floats) -> float:
    """Independent draws that would tell as much of the mean as a chain (n,): Geyer's initial positive sequence (1992).

    Examples
    --------
    >>> round(effective_size(np.tile([0.0, 1.0], 50)))
    100
    """
    n = len(values)
    away = values - values.mean()
    variance = float(away @ away) / n
    if variance == 0.0:
        return 1.0
    padded = np.fft.rfft(away, 2 * n)
    autocorrelation = np.fft.irfft(np.abs(padded) ** 2)[:n] / (n * variance)
    pairs = autocorrelation[: 2 * (n // 2)].reshape(-1, 2).sum(axis=1)
    first_negative = int(np.argmax(pairs < 0.0)) if (pairs < 0.0).any() else len(pairs)
    time = max(2.0 * float(pairs[:first_negative].sum()) - 1.0, 1.0)
    return n / time
