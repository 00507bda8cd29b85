"""What is recorded of any small force: the adjoint of the recordings, by one linear solve for each number of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from referee.equilibrium import Balance
from referee.sight import Sight

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

#: Relative residual of the solves, that of the cap's force, a small difference, and how many are made together.
_CLOSE, _CLOSE_FORCE, _TOGETHER = 0.03, 0.003, 64


class LinearResponse:
    """Rows of forces, from the fields with which each recorded number weighs forces on nodes.

    With ``u = -K^-1 f`` and a number ``l . u`` its field is ``-K^-1 l``; the force of a cap that is moved is
    ``c . (f + K u)``, of the field ``c - K^-1 K c``.

    Parameters
    ----------
    sight : Sight
    base : Balance
        Of the body without effects.
    cap : (n,) bool array
        Nodes of the superior cap.
    """

    def __init__(self, sight: Sight, base: Balance, cap: NDArray[np.bool_]) -> None:
        self._sight = sight
        selected = sight.selection
        blocks: list[Floats] = []
        for start in range(0, selected.shape[0], _TOGETHER):
            right = selected[start : start + _TOGETHER].T.toarray()
            blocks.append(-base.linear.solve(right, _CLOSE).astype(np.float32))
        if sight.has_force:
            whole = np.kron(cap[:, None], np.eye(3))
            blocks.append(whole - base.linear.solve(base.linear.whole @ whole, _CLOSE_FORCE))
        self._fields: Singles = np.concatenate(blocks, axis=1).astype(np.float32)

    def rows(self, forces: Floats, courses: Floats | None = None) -> Floats:
        """Rows (k, rows) as of `Sight.rows` of inner forces (k, n, 3) [N] that come up.

        Parameters
        ----------
        forces : (k, n, 3) array
        courses : (k, times) array, optional
            Which part of each is seen at each time; all of it if not given.
        """
        flat = forces.reshape(len(forces), -1).astype(np.float32)
        found = (flat @ self._fields).astype(np.float64)
        count = self._sight.count // self._sight.often
        if courses is None:
            courses = np.ones((len(forces), self._sight.often))
        points = np.einsum("kt,kp->ktp", courses, found[:, :count]).reshape(len(forces), -1)
        return np.concatenate([points, found[:, count:]], axis=1)
