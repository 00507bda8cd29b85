"""Fluid that flows out of tissue until a state is reached, linear about that state, at all times and paces at once.

Unknowns `p` of a term's own (`warpbrain.physics.term.Coupling`) and the displacement obey, about a state with the
tangent stiffness `K` in which `p` is zero,

    K du = B^T p,        d/dt (b + B du + N p) = -H p,

`b` what the state has taken up since rest, `B = db/du`, `H` the flow and `N` the storage. Loads that come at once leave
no time for flow: `b + B du + N p = 0` at first. Without `du`, with `C = B K^-1 B^T + N` and `M = H^-1 C`,

    p(t) = -g_t(M) H^-1 b,        g_t(x) = exp(-t / x) / x.

`M` is symmetric in the product with `H`, so few steps of Lanczos' method stand for it at all times (Druskin and
Knizhnerman, SIAM J. Matrix Anal. Appl. 19, 1998), each at the price of one equilibrium.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.physics.mechanism import Following
from warpbrain.physics.term import Coupling, Term
from warpbrain.simulation.factors import SparseFactors
from warpbrain.simulation.system import System
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import Sensors

#: Steps of Lanczos' method at most, and the part of the first vector below which there is no further one.
_STEPS, _LAST = 40, 1e-10


@dataclass(frozen=True, eq=False)
class Course:
    """What is recorded on the way to a final state, less what is recorded there, at any pace."""

    sensors: Sensors
    answers: Floats  # (n, m), of the sensors to each vector of a basis of the unknowns
    times: Floats  # (m,), relaxation times [s] of the eigenvectors
    first: Floats  # (m, m), initial amplitudes of the eigenvectors in the basis, times their relaxation times

    def at(self, pace: float) -> Floats:
        """Difference (n,) from the final state at the recorded times if all goes so many times faster."""
        remaining = np.zeros(len(self.sensors))
        for time in np.unique(self.sensors.times[np.isfinite(self.sensors.times)]):
            rows = self.sensors.times == time
            remaining[rows] = self.answers[rows] @ (self.first @ (np.exp(-pace * time / self.times) / self.times))
        return remaining


def bound_term(system: System, mechanism: Following) -> Term:
    """A mechanism's term that a system does not have, with arrays of its own, at its final scale."""
    import warp as wp

    term = mechanism.bind(system)
    count, nodes = term.stencils.shape
    p, device = system.precision, system.device
    blocks = wp.zeros((count, nodes * (nodes + 1) // 2), dtype=p.mat33, device=device)
    term.place(wp.zeros((count, nodes), dtype=p.vec3, device=device), blocks)
    term.set_scale(term.factor(np.inf))
    return term


def consolidation(at: Linearisation, mechanism: Following) -> Course:
    """What is recorded while the unknowns of a mechanism's term relax to zero after all loads are applied at once.

    `at`: about the final state, in which it does not act.
    """
    from scipy.linalg import eigh_tridiagonal

    b, B, N, H = _matrices(at, bound_term(at.system, mechanism))
    if not b.any():
        # of a body at rest, whose fluid carries nothing
        return Course(at.sensors, np.zeros((len(at.sensors), 1)), np.ones(1), np.zeros((1, 1)))
    flow = SparseFactors(H)
    v = flow.solve(-b)
    length = float(np.sqrt(max(v @ (H @ v), np.finfo(np.float64).tiny)))
    basis, answers, diagonal, off_diagonal = [v / length], [], [], []
    while True:
        v = basis[-1]
        forces = (B.T @ v)[:, None]
        answers.append(at.answers(forces.reshape(-1, 3)))
        w = B @ at.displacements(forces)[:, 0] + N @ v
        diagonal.append(float(v @ w))
        w = flow.solve(w)
        # orthogonalised twice against all earlier ones, because of rounding
        V = np.column_stack(basis)
        for _ in range(2):
            w -= V @ (V.T @ (H @ w))
        size = float(np.sqrt(max(w @ (H @ w), 0.0)))
        if len(basis) == _STEPS or size < _LAST * diagonal[0]:
            break
        off_diagonal.append(size)
        basis.append(w / size)
    times, vectors = eigh_tridiagonal(diagonal, off_diagonal)
    first = length * vectors * vectors[0]
    return Course(at.sensors, np.column_stack(answers), np.maximum(times, np.finfo(np.float64).tiny), first)


def _matrices(at: Linearisation, term: Term) -> tuple[Floats, Any, Any, Any]:
    """`b` (m,), `B` (m, 3 N), `N` and `H` (m, m) at the state, of nodes whose unknown is free."""

    def coupling() -> Coupling:
        assert term.coupling is not None
        return term.coupling

    at.system.u.assign(at.u)
    # takes the deformed geometry, in which fluid flows, and the content
    term.advance(at.system.u)
    content = coupling().content
    # the flow is in proportion to the time step
    steps = []
    for h in (1.0, 2.0):
        term.set_time_step(h)
        steps.append(coupling().compliance)
    H = steps[1] - steps[0]
    open_rows = np.flatnonzero(H.diagonal() > 0.0)
    term.evaluate_tangents(at.system.u)
    square = np.ix_(open_rows, open_rows)
    N = (2.0 * steps[0] - steps[1])[square]
    return content[open_rows], coupling().own[open_rows], N, H[square].tocsc()
