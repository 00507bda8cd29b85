"""Linear systems of quadratic tetrahedra: conjugate gradients, with the linear ones below them solved exactly."""

from __future__ import annotations

import numpy as np
import rslab
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix, diags, eye, kron, tril

from referee.body import Body

Floats = NDArray[np.float64]
#: Single precision is enough for a preconditioner, and for a tangent that only leads to where forces balance.
Singles = NDArray[np.float32]
Bools = NDArray[np.bool_]

#: Steps of the smoother, a Chebyshev polynomial, and the part of the spectrum that it is for.
_STEPS, _PART = 3, 8.0
_MOST = 200


class NotSolved(Exception):
    """Conjugate gradients did not converge."""


class Coarse:
    """The factorised matrix of the corners, which stays good enough while a body deforms."""

    def __init__(self, body: Body, matrix: bsr_matrix, held: Bools) -> None:
        count, k = len(body.mesh.points), len(body.edges)
        rows = np.concatenate([np.arange(count), np.repeat(count + np.arange(k), 2)])
        columns = np.concatenate([np.arange(count), body.edges.ravel()])
        weights = np.concatenate([np.ones(count), np.full(2 * k, 0.5)])
        nodes = csr_matrix((weights, (rows, columns)), shape=(count + k, count))
        free = ~held.ravel()
        up = diags(free.astype(float)) @ kron(nodes, eye(3), format="csr")
        self._up = up[:, np.flatnonzero(free[: 3 * count])].tocsr()
        self._down = self._up.T.tocsr()
        below = (self._down @ (matrix.tocsr() @ self._up)).tocsc().astype(np.float32)
        self._up, self._down = self._up.astype(np.float32), self._down.astype(np.float32)
        self._factors = rslab.ldlt(tril(below, format="csc"), threads=1)

    def __call__(self, r: Singles) -> Singles:
        return self._up @ self._factors.solve_many(np.asfortranarray(self._down @ r))


class Linear:
    """A matrix with what is held left out, ready to be solved with.

    Parameters
    ----------
    matrix : (3 n, 3 n) block matrix
    held : (n, 3) bool array
    coarse : Coarse

    Attributes
    ----------
    whole : (3 n, 3 n) matrix
        With what is held, in single precision.
    held : (n, 3) bool array
    coarse : Coarse
    """

    def __init__(self, matrix: bsr_matrix, held: Bools, coarse: Coarse) -> None:
        single = matrix.astype(np.float32)
        # rows of numbers, not of blocks: SciPy multiplies them with several vectors four times faster
        self.whole, self.held, self.coarse = single.tocsr(), held, coarse
        free = (~held).astype(np.float32)
        self._free = free.reshape(-1, 1)
        n = len(held)
        rows = np.repeat(np.arange(n), np.diff(matrix.indptr))
        blocks = single.data[matrix.indices == rows]
        blocks *= free[:, :, None] * free[:, None, :]
        blocks += (1.0 - free)[:, :, None] * np.eye(3, dtype=np.float32)
        self._inverse = np.linalg.inv(blocks)
        self._largest = self._power()

    def _times(self, x: Singles) -> Singles:
        return self._free * (self.whole @ x)

    def _jacobi(self, r: Singles) -> Singles:
        return self._free * (self._inverse @ r.reshape(len(self.held), 3, -1)).reshape(r.shape)

    def _power(self) -> float:
        x = np.random.default_rng(0).normal(size=self._free.shape).astype(np.float32) * self._free
        size = 1.0
        for _ in range(8):
            x = self._jacobi(self._times(x / np.linalg.norm(x)))
            size = float(np.linalg.norm(x))
        return 1.1 * size

    def _smooth(self, r: Singles) -> Singles:
        """Chebyshev's polynomial of the matrix, applied to a residual (Saad, Iterative Methods, algorithm 12.1)."""
        high, low = self._largest, self._largest / _PART
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio = middle / half
        rho = 1.0 / ratio
        step = self._jacobi(r) / middle
        x = step.copy()
        for _ in range(_STEPS - 1):
            fresh = 1.0 / (2.0 * ratio - rho)
            step = fresh * rho * step + 2.0 * fresh / half * self._jacobi(r - self._times(x))
            x += step
            rho = fresh
        return x

    def _precondition(self, r: Singles) -> Singles:
        x = self._smooth(r)
        x = x + self.coarse(r - self._times(x))
        return x + self._smooth(r - self._times(x))

    def solve(self, right: Floats, close: float) -> Floats:
        """Solution to a relative residual, of one right side (3 n,) or of several (3 n, k) that share the work.

        `NotSolved` if none is reached or the matrix is not positive.
        """
        sides = self._free * right.reshape(len(self._free), -1)
        sizes = np.linalg.norm(sides, axis=0)
        scale = np.where(sizes > 0.0, sizes, 1.0)
        r = (sides / scale).astype(np.float32)
        x = np.zeros_like(r)
        if not sizes.any():
            return np.zeros_like(right)
        z = self._precondition(r)
        p, rz = z, _dots(r, z)
        for _ in range(_MOST):
            q = self._times(p)
            curvature = _dots(p, q)
            if (curvature < 0.0).any():
                raise NotSolved("the tangent is not positive definite")
            length = (rz / np.where(curvature > 0.0, curvature, 1.0)).astype(np.float32)
            x += length * p
            r = r - length * q
            if np.linalg.norm(r, axis=0).max() <= close:
                return (x.astype(np.float64) * scale).reshape(right.shape)
            z = self._precondition(r)
            rz, old = _dots(r, z), rz
            p = z + (rz / np.where(old > 0.0, old, 1.0)).astype(np.float32) * p
        raise NotSolved(f"no convergence in {_MOST} steps")


def _dots(a: Singles, b: Singles) -> Floats:
    found: Floats = np.einsum("nk,nk->k", a, b, dtype=np.float64)
    return found
