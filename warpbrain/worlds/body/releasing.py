"""Held nodes that let go, to first order: of a held surface every patch costs a dense solution of its own size.

What is free is eliminated once: with `h` the nodes of a held surface and `f` what is free,

    S = K_hh - K_hf K_ff^-1 K_fh

answers to any patch of it. A patch that lets go moves by `-S^-1 R` along the wall, `R` its reactions; what can lift off
also leaves the wall where it would be pulled, found by an active set (Wriggers, Computational Contact Mechanics, 2nd
ed., section 5.3.1).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import SolveError
from warpbrain.mesh import tangents
from warpbrain.worlds.body.factors import Factors

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Changes of what is lifted off at most.
_CHANGES = 20
#: Part of the size of the body farther than which nothing goes to first order: then little holds it any more.
_FARTHEST = 0.2


class HeldSurface:
    """A set of held nodes at a state.

    Parameters
    ----------
    stiffness : SciPy CSR (3 N, 3 N)
        `K` [N/m].
    free : (3 N,) bool array
        Components that nothing holds.
    factors : Factors
        Of the free part of `K`.
    members : (N,) bool array
        Nodes, all of whose components are held.
    normals, reactions : (N, 3) array
        Outward, and what the nodes are held with [N].
    size : float
        Of the body [m].
    """

    def __init__(
        self,
        stiffness: Any,
        free: Bools,
        factors: Factors,
        members: Bools,
        normals: Floats,
        reactions: Floats,
        size: float,
    ) -> None:
        self.members = np.flatnonzero(members)
        self._farthest = _FARTHEST * size
        count = len(self.members)
        own = np.repeat(members, 3)
        towards = stiffness[free][:, own].tocsc()
        whole = np.asarray(stiffness[own][:, own].todense())
        whole -= factors.between(stiffness[own][:, free], towards)
        self._towards = towards
        # two tangents and the normal
        along = tangents(normals[self.members])
        self._frames = np.concatenate([along, normals[self.members][:, None]], axis=1)
        turned = np.einsum("aki,aibj,blj->akbl", self._frames, whole.reshape(count, 3, count, 3), self._frames)
        self._S = turned.reshape(3 * count, 3 * count)
        self._R = np.einsum("aki,ai->ak", self._frames, reactions[self.members])
        self._known: dict[tuple[bytes, bool], Floats] = {}

    def answers(
        self, stiffness: Any, free: Bools, compliance: Floats, by_displacement: Any, by_reactions: Any
    ) -> Floats:
        """What sensors (n,) record where each component of `moved` is 1 m: (n, 3 m).

        Parameters
        ----------
        stiffness, free :
            Those that it was made of.
        compliance : (n, 3 N) array
            Of the sensors, see `Linearisation.compliance`.
        by_displacement, by_reactions : SciPy CSR (n, 3 N)
        """
        own = (3 * self.members[:, None] + np.arange(3)).ravel()
        held = by_reactions[:, ~free] @ stiffness[~free][:, own]
        direct = np.asarray((by_displacement[:, own] + held).todense()) - (self._towards.T @ compliance[:, free].T).T
        return np.asarray(np.einsum("naj,akj->nak", direct.reshape(len(direct), -1, 3), self._frames)).reshape(
            direct.shape
        )

    def moved(self, patch: Bools, lifts: bool) -> Floats:
        """Displacement (3 m,) [m] of its nodes, along two tangents and the normal of each, where a patch lets go.

        Parameters
        ----------
        patch : (N,) bool array
        lifts : bool

        Raises
        ------
        SolveError
            If too little holds the body without the patch.
        """
        own = patch[self.members]
        key = own.tobytes(), lifts
        if key not in self._known:
            self._known[key] = self._let_go(own, lifts)
        return self._known[key]

    def _let_go(self, own: Bools, lifts: bool) -> Floats:
        pull = self._R[:, 2]
        off = own & (pull > 0.0) & lifts
        for _ in range(_CHANGES):
            moved = self._solved(np.column_stack([own, own, off]))
            if not lifts:
                break
            pull = self._R[:, 2] + (self._S[2::3] @ moved)
            changed = own & np.where(off, moved[2::3] < 0.0, pull > 0.0)
            if np.array_equal(changed, off):
                break
            off = changed
        return moved

    def _solved(self, loose: Bools) -> Floats:
        from scipy.linalg import cho_factor, cho_solve

        at = np.flatnonzero(loose.ravel())
        found = np.zeros(loose.size)
        try:
            factor = cho_factor(self._S[np.ix_(at, at)], check_finite=False)
            found[at] = cho_solve(factor, -self._R.ravel()[at], check_finite=False)
        except np.linalg.LinAlgError:
            found[at] = np.inf
        if not np.abs(found).max() < self._farthest:
            raise SolveError(f"letting go of {int(loose[:, 0].sum())} nodes: no equilibrium is near")
        return found
