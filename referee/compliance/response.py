"""What is recorded of any small force on the declared body: the adjoint of its recordings, one solve for each row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from referee.compliance.neo_hookean import NeoHookeanBody
from referee.compliance.observed import observed
from referee.faces import Floats


class DeclaredResponse:
    """Rows of forces and of motions of what is held, about the declared state.

    With ``u = K^-1 f`` of what is free, and rows ``s = S u``, the fields are ``K^-1 S^T``. The force of a boundary is
    that of the tissue's internal forces less what else acts on its nodes.

    Parameters
    ----------
    body : NeoHookeanBody
    """

    def __init__(self, body: NeoHookeanBody) -> None:
        self.body = body
        #: Deformation gradients (m, 3, 3) and internal forces (3 n,) [N] of the declared state.
        self.F = body.gradient(body.declared)
        self.inner = body.nodal(body.stress(self.F))
        self._tangent = body.tangent(self.F)
        self.rows_of = observed(body, self._tangent)
        solve, reading = body.solver(self._tangent), self.rows_of.reading
        # of points at several times the rows are the same
        distinct, again = _distinct(reading)
        self._again = again
        self._distinct = reading[distinct]
        self._fields = solve(self._distinct.T.toarray())
        self._read_force = np.kron(self.rows_of.force_nodes[:, None], np.eye(3))

    @property
    def predicted(self) -> Floats:
        """Rows of the declared state [m] or [N]."""
        rows: Floats = self.rows_of.reading @ self.body.declared
        of_force = self.rows_of.kind == "force"
        if of_force.any():
            rows[of_force] = (self.inner - self.body.load) @ self._read_force
        return rows

    def forces(self, forces: Floats) -> Floats:
        """Rows (rows, k) of forces (3 n, k) [N]."""
        rows = (self._fields.T @ forces)[self._again]
        of_force = self.rows_of.kind == "force"
        if of_force.any():
            rows[of_force] -= self._read_force.T @ forces
        return rows

    def motions(self, moves: Floats) -> Floats:
        """Rows (rows, k) of motions (3 n, k) [m] of what the case holds; zero elsewhere."""
        pulled = self._tangent @ moves
        # fields are zero where the body is held
        return (self._distinct @ moves - self._fields.T @ pulled)[self._again]


def _distinct(matrix: csr_matrix) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First rows of a sparse matrix among equal ones, and for each row which of these it is."""
    seen: dict[tuple[bytes, bytes], int] = {}
    first, again = [], []
    for k in range(matrix.shape[0]):
        ends = slice(matrix.indptr[k], matrix.indptr[k + 1])
        key = (matrix.indices[ends].tobytes(), matrix.data[ends].tobytes())
        if key not in seen:
            seen[key] = len(first)
            first.append(k)
        again.append(seen[key])
    return np.array(first), np.array(again)
