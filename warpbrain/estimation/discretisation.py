"""What the mesh gets wrong: the state on elements of half the size, less the state.

Linear tetrahedra are too stiff, near nu = 1/2 by several percent of the displacement on the meshes that one can afford.
Recordings know nothing of elements: fitted as it is, such a mesh finds tissue that is too soft by as much, and says so
with a standard deviation that is far smaller than that. So what is recorded is taken to be

    H(u_h + (a I + B(x)) d(theta)) + noise,    d = u_(h/2) - u_h

What falls with a power p of the size is the error of the stiffness, since a mesh that is far too stiff shows little of
its error when halved: `1/u_h = (1 + e)/u` and `1/u_(h/2) = (1 + e/2^p)/u` give, with `k` the part of `u_(h/2)` that is
`d`,

    a = b (1 - k)/(1 - b k),    b = 2^p/(2^p - 1)

and Richardson's extrapolation, `a = b`, where `k` is small. `b` is 4/3 for p = 2, as on smooth solutions, and 2 for
p = 1, as at the edges of what is held and where elements lock: `b ~ N(5/3, 0.4^2)` holds both. What is missing is not
quite of the shape of d, nor of one amount everywhere: `B` is a matrix field, affine in the position, whose coefficients
(of the unit matrices, and of positions in units of the body's root mean square radius) are independent, `N(0, 0.2^2)`.
All are estimated along with the tissue and integrated out.

`d` depends on the tissue as the displacement itself does. It is taken to first order in the tissue about the estimate:
held fixed, it would make the displacement change too little with a modulus, by the share that d is of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.finer_mesh import Difference, FinerMesh
from warpbrain.estimation.forward import Forward, State
from warpbrain.inference.beliefs import belief
from warpbrain.recordings.agreement import root_mean_square

#: Of the range of `b` in which the error of the stiffness is finite: beyond, `a` goes on along its tangent.
_WHOLE = 0.8
#: Names of the numbers: `b`, and `B_ij` by what it is multiplied with, all without a unit.
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
        Of `b`.
    shape : float
        Standard deviation of each coefficient of `B`.
    """

    mean: float = field(default_factory=lambda: belief("mesh.amount"))
    deviation: float = field(default_factory=lambda: belief("mesh.amount_width"))
    shape: float = field(default_factory=lambda: belief("mesh.shape"))

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean):
            raise InputError(f"discretisation: mean = {self.mean}: expected a finite number")
        for name, value in (("deviation", self.deviation), ("shape", self.shape)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"discretisation: {name} = {value}: expected a positive number")

    @property
    def means(self) -> Floats:
        """Of `b` and the coefficients of `B`, shape (37,)."""
        return np.concatenate([[self.mean], np.zeros(len(NAMES) - 1)])

    @property
    def deviations(self) -> Floats:
        """Of `b` and the coefficients of `B`, shape (37,)."""
        return np.concatenate([[self.deviation], np.full(len(NAMES) - 1, self.shape)])


@dataclass(frozen=True, eq=False)
class Change(Difference):
    """The error of a mesh to first order in the parameters.

    Attributes
    ----------
    du, dR : (p, n, 3) array
        Derivatives by `theta`.
    """

    du: Floats
    dR: Floats

    def at(self, theta: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) with other parameters (p,)."""
        step = theta - self.theta
        return self.u + np.tensordot(step, self.du, axes=1), self.reactions + np.tensordot(step, self.dR, axes=1)


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """The error of a mesh, of an amount and a shape that are not known.

    Attributes
    ----------
    change : Change
        `d`: what elements of half the size change.
    positions : (s n, 3) array
        Of the nodes in each of s states, from the mean of all in units of their root mean square radius.
    part : float
        `k`: the part of the displacement on elements of half the size that is `d`, its projection.
    """

    change: Change
    positions: Floats
    part: float

    @property
    def theta(self) -> Floats:
        """Where it was computed, shape (p,)."""
        return self.change.theta

    def amount(self, b: float) -> tuple[float, float]:
        """`a`, and its derivative by `b`."""
        k = self.part
        within = min(b, _WHOLE / k) if k > 0.0 else b
        slope = (1.0 - k) / (1.0 - within * k) ** 2
        return within * (1.0 - k) / (1.0 - within * k) + slope * (b - within), slope

    def at(self, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
        """What is to be added to displacement and reactions (n, 3); `values` (37,) in the order of `NAMES`."""
        matrices = self._matrices(values)
        u, reactions = self.change.at(theta)
        return np.einsum("nij,nj->ni", matrices, u), np.einsum("nij,nj->ni", matrices, reactions)

    def by_theta(self, values: Floats) -> tuple[Floats, Floats]:
        """Derivatives (p, n, 3) of that."""
        matrices = self._matrices(values)
        return (
            np.einsum("nij,pnj->pni", matrices, self.change.du),
            np.einsum("nij,pnj->pni", matrices, self.change.dR),
        )

    def by_values(self, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
        """Derivatives (37, n, 3) of that by `values`."""
        u, reactions = self.change.at(theta)
        slope = self.amount(float(values[0]))[1]
        return self._columns(u, slope), self._columns(reactions, slope)

    def _matrices(self, values: Floats) -> Floats:
        """`a I + B` at each node, shape (n, 3, 3)."""
        amount = self.amount(float(values[0]))[0]
        return amount * np.eye(3) + np.einsum("nk,kij->nij", self._basis, values[1:].reshape(-1, 3, 3))

    def _columns(self, change: Floats, slope: float) -> Floats:
        unit = np.einsum("nk,nj,il->kijnl", self._basis, change, np.eye(3))
        return np.concatenate([slope * change[None], unit.reshape(-1, *change.shape)])

    @property
    def _basis(self) -> Floats:
        """1, x, y and z at each node, shape (n, 4)."""
        return np.concatenate([np.ones((len(self.positions), 1)), self.positions], axis=1)


def discretisation_error(
    finer: Sequence[FinerMesh], forward: Forward, state: State, derivatives: tuple[Floats, Floats]
) -> DiscretisationError:
    """The error of states, to first order in the parameters.

    Parameters
    ----------
    finer : sequence of FinerMesh
        For each of the s states one.
    forward : Forward
    state : State
    derivatives : pair of (p, s n, 3) arrays
        Of displacement and reactions by the parameters.

    Raises
    ------
    SolveError
        If there is no stable equilibrium on the finer mesh.
    """
    theta, parameters, count = state.theta, forward.parameters, len(forward.states)
    errors, by_theta = [], []
    try:
        for mesh, one, u, R in zip(
            finer, forward.states, np.split(state.u, count), np.split(state.reactions, count), strict=True
        ):
            errors.append(mesh.difference(parameters.applied(one.case, theta), theta, one.system, u, R))
            by_theta.append(mesh.derivatives(theta, parameters.materials))
    except SolveError as failure:
        raise SolveError(
            f"the error of the mesh is not known: on elements of half the size {failure}; it can be left out, and "
            "then the estimate holds for this mesh only"
        ) from None
    u, reactions = (np.concatenate([getattr(one, name) for one in errors]) for name in ("u", "reactions"))
    du, dR = (np.concatenate(parts, axis=1) for parts in zip(*by_theta, strict=True))
    change = Change(u, reactions, theta, du - derivatives[0], dR - derivatives[1])
    there = state.u + change.u
    part = float(np.vdot(change.u, there)) / max(float(np.vdot(there, there)), 1e-300)
    points = forward.case.remaining[0].points
    away = points - points.mean(axis=0)
    return DiscretisationError(change, np.tile(away / root_mean_square(away), (count, 1)), part)
