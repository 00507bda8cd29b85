"""What the referee draws of a body without telling, and what each of it would change to first order."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from referee.equilibrium import Balance
from referee.law import Law, respond
from referee.principal import Stretches, stretches_of
from referee.problem import Problem
from referee.setting import BOTH_LAWS, EACH, FIELD, LENGTHS, OVERALL, POISSON, mean_square
from referee.sight import Change

Floats = NDArray[np.float64]

#: Modes of the stiffness field that are kept, and how many places they are made of.
MODES, _PIVOTS = 24, 96
#: Relative residual to which what is seen of them is solved.
_CLOSE = 0.03


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Changes by what is not known.

    Attributes
    ----------
    tissues : list of Change
        With the logarithm of each tissue's stiffness.
    others : list of Change
        With the amounts of all else, each of mean 0 and variance 1: modes of the stiffness field, Poisson's ratio, the
        shape of the law.
    """

    tissues: list[Change]
    others: list[Change]

    @property
    def drawn(self) -> list[Change]:
        """With amounts of mean 0 and variance 1, all of them as they are drawn."""
        moves, forces = np.array([c.move for c in self.tissues]), np.array([c.force for c in self.tissues])
        together = Change(OVERALL * moves.sum(axis=0), OVERALL * forces.sum(axis=0))
        return [together, *(c.times(EACH) for c in self.tissues), *self.others]


def unknowns_of(problem: Problem, base: Balance) -> Unknowns:
    """What each unknown changes, by one linear solve; they share their work.

    Parameters
    ----------
    problem : Problem
        Without effects.
    base : Balance
        Of it.
    """
    tissues, others = unknown_forces(problem, base)
    changes = answers(base, problem.body.nodes("superior"), [*tissues, *others], _CLOSE)
    return Unknowns(changes[: len(tissues)], changes[len(tissues) :])


def unknown_forces(problem: Problem, base: Balance) -> tuple[list[Floats], list[Floats]]:
    """Inner forces (n, 3) [N] that come up with the tissues and with the others of `Unknowns`."""
    F = problem.gradient(base.u)
    stretches = stretches_of(F)
    response = problem.response(F, stretches)
    inner = problem.local(response.stress(problem.factor))
    labels = problem.body.mesh.tissue
    tissues = [problem.gathered(inner * (labels == label)[:, None, None]) for label in np.unique(labels)]
    fields = stiffness_modes(problem.body.centroids, np.linalg.norm(inner, axis=(1, 2)))
    others = [problem.gathered(inner * field[:, None, None]) for field in fields.T]
    others += [problem.gathered(problem.local(_poisson(problem, F, stretches))), *_laws(problem, F, stretches)]
    return tissues, others


def answers(base: Balance, cap: NDArray[np.bool_], forces: list[Floats], close: float) -> list[Change]:
    """Changes to first order if inner forces (n, 3) [N] come up, solved to a relative residual."""
    right = np.stack([force.ravel() for force in forces], axis=1)
    moves = -base.linear.solve(right, close)
    after = right + base.linear.whole @ moves
    shape = forces[0].shape
    return [
        Change(move.reshape(1, *shape), left.reshape(shape)[cap].sum(axis=0))
        for move, left in zip(moves.T, after.T, strict=True)
    ]


def stiffness_modes(places: Floats, weight: Floats, count: int = MODES) -> Floats:
    """Fields (m, count) whose sum with standard normal amounts is about the random field of stiffness.

    Both kinds of length are mixed. They are the largest principal modes where elements carry load, found from a
    pivoted Cholesky decomposition (Harbrecht, Peters and Schneider 2012).

    Parameters
    ----------
    places : (m, 3) array
        Of elements [m].
    weight : (m,) array
        Forces that each carries [N].
    count : int
    """
    variance = mean_square(FIELD)
    lengths = [0.5 * (low + high) for low, high in LENGTHS]
    left = variance * weight**2
    columns = np.zeros((len(weight), min(_PIVOTS, len(weight))))
    for j in range(columns.shape[1]):
        k = int(left.argmax())
        square = ((places - places[k]) ** 2).sum(axis=1)
        near = sum(np.exp(-square / (2.0 * length**2)) for length in lengths) / len(lengths)
        column = variance * near * weight * weight[k] - columns[:, :j] @ columns[k, :j]
        columns[:, j] = column / np.sqrt(left[k])
        left = np.maximum(left - columns[:, j] ** 2, 0.0)
    axes = np.linalg.eigh(columns.T @ columns)[1][:, ::-1][:, :count]
    return (columns @ axes) / weight[:, None]


def _poisson(problem: Problem, F: Floats, stretches: Stretches) -> Floats:
    """Stress for one standard deviation of Poisson's ratio."""
    low, high = POISSON
    ratio, sd = 0.5 * (low + high), (high - low) / np.sqrt(12.0)
    slope = 1.0 / (1.0 + ratio) + 2.0 / (1.0 - 2.0 * ratio)
    response = respond(problem.law, F, 0.0 * problem.mu, sd * slope * problem.bulk, problem.growth, stretches)
    return response.stress()


def _laws(problem: Problem, F: Floats, stretches: Stretches) -> list[Floats]:
    """Forces of each law that may be drawn less their mean: as many as there are laws, of the same covariance."""
    laws, shares = zip(*BOTH_LAWS, strict=True)
    forces = np.stack([_shape(problem, F, stretches, law) for law in laws])
    weights = np.array(shares)[:, None, None]
    apart = np.sqrt(weights) * (forces - (weights * forces).sum(axis=0))
    flat = apart.reshape(len(laws), -1)
    sizes, axes = np.linalg.eigh(flat @ flat.T)
    kept = sizes > 1e-4 * sizes[-1]
    return list(np.einsum("lk,lni->kni", axes[:, kept], apart))


def _shape(problem: Problem, F: Floats, stretches: Stretches, law: Law) -> Floats:
    alone = replace(problem, law=law, bulk=0.0 * problem.bulk)
    return alone.gathered(alone.local(alone.response(F, stretches).stress()))
