"""Tissue under a held load that gives way with time: a Prony series on the isochoric stress, in quasi-static steps.

Each branch follows the isochoric second Piola-Kirchhoff stress ``S`` of the law (Simo and Hughes, Computational
Inelasticity, section 10.3)

    q_i(t + h) = exp(-h/tau_i) q_i(t) + beta_i exp(-h/(2 tau_i)) (S(t + h) - S(t))

so that a step is an equilibrium of a law whose isochoric part is stiffer by ``sum_i beta_i exp(-h/(2 tau_i))`` under a
stress that is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from referee.equilibrium import Balance, balance
from referee.multigrid import Linear
from referee.problem import Problem

Floats = NDArray[np.float64]


def creep(
    problem: Problem,
    branches: Sequence[tuple[float, float]],
    times: Sequence[float],
    start: Floats | None = None,
    near: Linear | None = None,
    until: float = np.inf,
) -> list[Balance]:
    """Equilibria at times [s] after a load was put on at once.

    Parameters
    ----------
    problem : Problem
        With what is left of the stiffness in the end.
    branches : sequence of (beta, tau)
        Modulus relative to the law's, and relaxation time [s].
    times : sequence of float
        Increasing, above zero; each is reached in one step from the one before.
    start : (n, 3) array, optional
        Where to begin [m].
    near : Linear, optional
    until : float
        See `referee.equilibrium.balance`.
    """
    stress = np.zeros((*problem.body.region[1].shape, 3))
    balances = [balance(replace(problem, factor=1.0 + sum(beta for beta, _ in branches)), start, near, until)]
    elastic = _second(problem, balances[0].u)
    stresses = [beta * elastic for beta, _ in branches]
    before = 0.0
    for time in times:
        step = time - before
        whole = [np.exp(-step / tau) for _, tau in branches]
        half = [beta * np.exp(-0.5 * step / tau) for beta, tau in branches]
        kept = [w * q - h * elastic for w, h, q in zip(whole, half, stresses, strict=True)]
        given = sum(kept, stress if problem.stress is None else problem.stress)
        now = replace(problem, factor=1.0 + sum(half), stress=given)
        balances.append(balance(now, balances[-1].u, balances[-1].linear, until))
        elastic = _second(problem, balances[-1].u)
        stresses = [k + h * elastic for k, h in zip(kept, half, strict=True)]
        before = time
    return balances[1:]


def _second(problem: Problem, u: Floats) -> Floats:
    return problem.response(problem.gradient(u)).second()
