"""What the mesh gets wrong: the state on elements that do not lock, and on smaller ones, less the state.

Linear tetrahedra are too stiff, near nu = 1/2 by several percent of the displacement on the meshes that one can afford.
Recordings know nothing of elements: fitted as it is, such a mesh finds tissue that is too soft by as much, and says so
with a standard deviation that is far smaller than that. So what is recorded is taken to be

    H(u_h + L + (a I + B(x)) M) + noise,    L = u'_h - u_h,    M = u'_(h/2) - u'_h

with the two parts of `warpbrain.simulation.mesh_error`: `u'_h` is the state of averaged gradients, which do not lock,
on the same mesh, `u'_(h/2)` on elements of half the size. Both depend on the tissue as the displacement itself does, so
they are taken to first order in it about the estimate.

If the error of averaged elements falls with the power p of the size, then `a = 2^p / (2^p - 1)` (Richardson's
extrapolation): 4/3 for p = 2, as on smooth solutions, and 2 for p = 1, as at the edges of what is held. On coarse
meshes it may be 1 and less, where what locked a little still does: `a ~ N(4/3, 0.4^2)`. And what is missing is not
quite of the shape of M, nor of one amount everywhere: `B` is a matrix field, affine in the position, whose
coefficients (of the unit matrices, and of positions in units of the body's root mean square radius) are independent,
`N(0, 0.2^2)`. All are estimated along with the tissue and integrated out of what is said of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import ROUGH, Forward, State
from warpbrain.estimation.parameters import Parameters
from warpbrain.physics.force import NodalForce
from warpbrain.simulation.finer import FinerCase, restricted
from warpbrain.simulation.mesh_error import unlocked
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.sensitivity import Sensitivities

Floats = NDArray[np.float64]

#: Names of the numbers: the amount `a`, and `B_ij` by what it is multiplied with, all without a unit.
NAMES = (
    "amount of the mesh's error",
    *(
        f"shape of the mesh's error {i}{j} {by}"
        for by in ("even", "by x", "by y", "by z")
        for i in "xyz"
        for j in "xyz"
    ),
)


@dataclass(frozen=True)
class Discretisation:
    """What is believed of the amount and the shape of what smaller elements change: normal.

    Attributes
    ----------
    mean, deviation : float
        Of the amount `a`.
    shape : float
        Standard deviation of each coefficient of `B`.
    """

    mean: float = 4.0 / 3.0
    deviation: float = 0.4
    shape: float = 0.2

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean):
            raise InputError(f"discretisation: mean = {self.mean}: expected a finite number")
        for name, value in (("deviation", self.deviation), ("shape", self.shape)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"discretisation: {name} = {value}: expected a positive number")

    @property
    def means(self) -> Floats:
        """Of `a` and the coefficients of `B`, shape (37,)."""
        return np.concatenate([[self.mean], np.zeros(len(NAMES) - 1)])

    @property
    def precisions(self) -> Floats:
        """Of `a` and the coefficients of `B`, shape (37,)."""
        return np.concatenate([[self.deviation**-2], np.full(len(NAMES) - 1, self.shape**-2)])


@dataclass(frozen=True, eq=False)
class Change:
    """A change of a state, to first order in the parameters.

    Attributes
    ----------
    theta : (p,) array
        Where it was computed.
    u, reactions : (n, 3) array
        At the nodes of the mesh [m] and [N].
    du, dR : (p, n, 3) array
        Derivatives by `theta`.
    """

    theta: Floats
    u: Floats
    reactions: Floats
    du: Floats
    dR: Floats

    @classmethod
    def between(cls, theta: Floats, first: Sensitive, second: Sensitive) -> Change:
        """From the first state to the second."""
        return cls(theta, *(after - before for before, after in zip(first, second, strict=True)))

    def at(self, theta: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) with other parameters (p,)."""
        step = theta - self.theta
        return self.u + np.tensordot(step, self.du, axes=1), self.reactions + np.tensordot(step, self.dR, axes=1)

    @property
    def root_mean_square(self) -> float:
        """Over the nodes [m]."""
        return float(np.sqrt(np.mean(np.sum(self.u**2, axis=1))))


#: Displacement, reactions (n, 3) and their derivatives (p, n, 3).
Sensitive = tuple[Floats, Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """The error of a mesh.

    Attributes
    ----------
    locking : Change
        `L`.
    size : Change
        `M`: what elements of half the size change.
    positions : (n, 3) array
        Of the nodes, from the mean of all in units of their root mean square radius.
    """

    locking: Change
    size: Change
    positions: Floats

    @property
    def theta(self) -> Floats:
        """Where it was computed, shape (p,)."""
        return self.locking.theta

    def at(self, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
        """What is to be added to displacement and reactions (n, 3); `values` (37,) in the order of `NAMES`."""
        matrices = self._matrices(values)
        (u, reactions), (size_u, size_reactions) = self.locking.at(theta), self.size.at(theta)
        return (
            u + np.einsum("nij,nj->ni", matrices, size_u),
            reactions + np.einsum("nij,nj->ni", matrices, size_reactions),
        )

    def by_theta(self, values: Floats) -> tuple[Floats, Floats]:
        """Derivatives (p, n, 3) of that."""
        matrices = self._matrices(values)
        return (
            self.locking.du + np.einsum("nij,pnj->pni", matrices, self.size.du),
            self.locking.dR + np.einsum("nij,pnj->pni", matrices, self.size.dR),
        )

    def by_values(self, theta: Floats) -> tuple[Floats, Floats]:
        """Derivatives (37, n, 3) of that by `values`."""
        u, reactions = self.size.at(theta)
        return self._columns(u), self._columns(reactions)

    def _matrices(self, values: Floats) -> Floats:
        """`a I + B` at each node, shape (n, 3, 3)."""
        return values[0] * np.eye(3) + np.einsum("nk,kij->nij", self._basis, values[1:].reshape(-1, 3, 3))

    def _columns(self, size: Floats) -> Floats:
        unit = np.einsum("nk,nj,il->kijnl", self._basis, size, np.eye(3))
        return np.concatenate([size[None], unit.reshape(-1, *size.shape)])

    @property
    def _basis(self) -> Floats:
        """1, x, y and z at each node, shape (n, 4)."""
        return np.concatenate([np.ones((len(self.positions), 1)), self.positions], axis=1)


class OtherElements:
    """A case on elements that do not lock: on the same mesh, and on elements of half the size.

    Parameters
    ----------
    case : Case
    theta : (p,) array
        Parameters to begin with.
    device : str, optional
    """

    def __init__(self, case: Case, theta: Floats, device: str | None = None) -> None:
        finer = FinerCase(case)
        self._prolong = finer.prolongation
        away = case.remaining[0].points - case.remaining[0].points.mean(axis=0)
        self._positions = away / np.sqrt(np.mean(np.sum(away**2, axis=1)))
        added = finer.spread(_shared_forces(Parameters.of(case).applied(case, theta)))
        elements = unlocked("tet4")
        self._same = Forward(case, theta, device, elements=elements)
        self._finer = Forward(finer.case, theta, device, added, elements)
        #: The last changes from state to state, with which the next ones are predicted.
        self._locking: Floats | float = 0.0
        self._size: Floats | float = 0.0

    @property
    def solves(self) -> int:
        """Equilibria on the finer mesh."""
        return self._finer.solves

    def error(self, state: State, derivatives: tuple[Floats, Floats]) -> DiscretisationError:
        """The error of a state.

        Parameters
        ----------
        state : State
        derivatives : pair of (p, n, 3) arrays
            Of its displacement and its reactions by the parameters.

        Raises
        ------
        SolveError
            If there is no stable equilibrium of such elements.
        """
        try:
            same = _solve(self._same, state.theta, state.u + self._locking)
            start = self._prolong @ same.u
            finer = _solve(self._finer, state.theta, start + self._size)
            same_derivatives, finer_derivatives = self._same.differentiate(same), self._finer.differentiate(finer)
        except SolveError as error:
            raise SolveError(
                f"the error of the mesh is not known: on elements that do not lock, or of half the size, {error}; it "
                "can be left out, and then the estimate holds for this mesh only"
            ) from None
        self._locking, self._size = same.u - state.u, finer.u - start
        own = (state.u, state.reactions, *derivatives)
        free = (same.u, same.reactions, same_derivatives.u, same_derivatives.reactions)
        smaller = self._restricted(finer, finer_derivatives)
        locking, size = Change.between(state.theta, own, free), Change.between(state.theta, free, smaller)
        return DiscretisationError(locking, size, self._positions)

    def _restricted(self, finer: State, derivatives: Sensitivities) -> Sensitive:
        """A state of the finer mesh at the nodes of the mesh that there was."""
        pairs = zip(derivatives.u, derivatives.reactions, strict=True)
        both = [restricted(self._prolong, du, dR) for du, dR in pairs]
        du, dR = (np.array([one[k] for one in both]) for k in range(2))
        return *restricted(self._prolong, finer.u, finer.reactions), du, dR


def _solve(forward: Forward, theta: Floats, start: Floats) -> State:
    """From a start that may turn elements inside out, or be of another branch; from rest, if it is."""
    try:
        return forward.solve(theta, start, ROUGH)
    except SolveError:
        return forward.solve(theta, None, ROUGH)


def _shared_forces(case: Case) -> Floats:
    """Nodal forces [N] of the boundaries that share a force among their nodes, long after every ramp."""
    model, _ = model_of(case)
    shared = [load for load in model.loads if isinstance(load, NodalForce)]
    total = np.zeros(model.mesh.points.shape)
    for load in shared:
        total += load.factor(math.inf) * load.nodal_forces(model.mesh)
    return total
