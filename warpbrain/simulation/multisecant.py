"""What Newton's steps have shown of a tangent, where the linear solver knows only a part of it.

Forces without a potential, such as a pressure on a surface whose rim moves, have a tangent that is not symmetric. The
linear solvers are for symmetric ones: Newton's method with the symmetric part `K` alone converges linearly, by about a
half an iteration where 1.5 kPa act on the wall of a cavity. Steps that were taken say what is missing: with the steps
`dU` (as columns) and by how much `dR` they have brought the out-of-balance force `r` down,

    d = dU g + K^-1 (r - dR g),   g = argmin |r - dR g|

which is Anderson's acceleration (1965, J. ACM 12, 547) with the tangent as preconditioner, or the multisecant update of
Broyden's second kind (Fang and Saad 2009, Numer. Linear Algebra Appl. 16, 197). `dU` and `dR` are exact however roughly
`K^-1` is.

So does the chord method go with the factors of a state that is near in the place of `K`: an iteration costs internal
forces and one solve, a fifth of one of Newton's. What it comes to is a start for Newton's method, which checks it.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.simulation.system import System

#: Steps that are kept, and singular values of `dR` below this part of the largest that are left out.
_MOST, _LEAST = 12, 1e-6


class Multisecant:
    """Steps of one solve, and what they changed."""

    def __init__(self) -> None:
        self._at: tuple[Floats, Floats] | None = None
        self._steps: list[Floats] = []
        self._changes: list[Floats] = []

    def split(self, u: Floats, r: Floats) -> tuple[Floats, Floats]:
        """What of a step is known, and the force that is left for a linear solve.

        Of the displacement (n, 3) [m] after the last step, and the out-of-balance force (n, 3) [N] there.
        """
        if self._at is not None:
            self._steps.append((u - self._at[0]).ravel())
            self._changes.append((self._at[1] - r).ravel())
            del self._steps[:-_MOST], self._changes[:-_MOST]
        self._at = u, r
        if not self._steps:
            return np.zeros_like(u), r
        # each change as one: the last ones are many times smaller than the first
        sizes = [float(np.linalg.norm(change)) or 1.0 for change in self._changes]
        dR = np.column_stack([change / size for change, size in zip(self._changes, sizes, strict=True)])
        dU = np.column_stack([step / size for step, size in zip(self._steps, sizes, strict=True)])
        g = np.linalg.lstsq(dR, r.ravel(), rcond=_LEAST)[0]
        return (dU @ g).reshape(u.shape), r - (dR @ g).reshape(r.shape)


#: Iterations at most, and what a residual must have fallen to after two of them.
_ITERATIONS, _FALLS = 12, 0.5


def toward_equilibrium(
    system: System, external: Floats, start: Floats, inverse: Callable[[Floats], Floats], tolerance: float
) -> Floats:
    """The displacement (n, 3) [m] with the smallest residual on the way from a start, of a state nearby.

    Under nodal forces (n, 3) [N], until what is out of balance is `tolerance` times all of them. `inverse` goes from
    nodal forces (n, 3) [N] to the displacement (n, 3) [m] that they cause in that state; zero where nodes are held.
    """
    model = system.model
    u, free = np.where(model.constrained, model.prescribed, start), ~model.constrained
    system.set_time_step(math.inf)
    system.forget()
    system.set_load()
    secants = Multisecant()
    best, norms = u, [np.inf, np.inf]
    for _ in range(_ITERATIONS):
        system.u.assign(u)
        internal = system.internal_forces()
        r = free * (external - internal)
        # a step may have led far from any equilibrium: infinity, which ends this
        with np.errstate(over="ignore"):
            norm = float(np.linalg.norm(r))
        if not norm < _FALLS * norms[-2]:
            break
        if norm < min(norms):
            best = u
        norms.append(norm)
        if norm <= tolerance * float(np.linalg.norm(internal) + np.linalg.norm(external)):
            break
        predicted, remaining = secants.split(u, r)
        u = u + predicted + inverse(remaining)
    return best


#: What a part of a difference between states costs beside what it does not explain: none is stretched far.
_STRETCH = 0.01


def extrapolated(values: Sequence[tuple[Floats, Floats]], at: Floats) -> Floats:
    """What is expected of a function of numbers (k,) at some of them, from its values (...) at one or more others.

    Of the nearest value, and as much of the differences of others to it as makes up for the distance. It is only where
    to begin: nothing that is found depends on it.
    """
    distances = [float(np.linalg.norm(at - numbers)) for numbers, _ in values]
    order = np.argsort(distances, kind="stable").tolist()
    nearest, value = values[order[0]]
    away = at - nearest
    size = float(np.linalg.norm(away))
    others = [values[number] for number in order[1:]]
    if size == 0.0 or not others:
        return value
    between = np.column_stack([numbers - nearest for numbers, _ in others]) / size
    # by least squares: normal equations are singular where some states are many times as far away as the nearest one
    stretch = np.sqrt(_STRETCH) * np.eye(len(others))
    target = np.append(away / size, np.zeros(len(others)))
    shares = np.linalg.lstsq(np.vstack([between, stretch]), target)[0]
    expected = value.copy()
    for share, (_, other) in zip(shares.tolist(), others, strict=True):
        expected += share * (other - value)
    return expected
