"""Linear systems of quadratic tetrahedra: conjugate gradients, with the linear ones below them solved exactly."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import rslab
import warp as wp
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
#: Vectors that a matrix is multiplied with together.
_WIDE = 16
_Row = wp.types.vector(_WIDE, wp.float32)


@wp.kernel(enable_backward=False)
def _symmetric_times(
    count: int,
    starts: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.mat33f),
    x: wp.array(dtype=wp.vec3f),
    y: wp.array(dtype=wp.vec3f),
):
    """A symmetric matrix times a vector, of its blocks on and above the diagonal.

    Half of the numbers go through memory, and one index for each nine of them: three times faster than SciPy's product
    of rows of numbers.
    """
    for i in range(count):
        xi = x[i]
        s = y[i]
        for k in range(starts[i], starts[i + 1]):
            j = columns[k]
            block = blocks[k]
            s += block * x[j]
            if j != i:
                y[j] = y[j] + wp.transpose(block) * xi
        y[i] = s


@wp.kernel(enable_backward=False)
def _times_several(
    count: int,
    starts: wp.array(dtype=wp.int32),
    columns: wp.array(dtype=wp.int32),
    blocks: wp.array(dtype=wp.mat33f),
    x: wp.array2d(dtype=_Row),
    y: wp.array2d(dtype=_Row),
):
    """A matrix times rows of several vectors: most of the time goes to these, so that all of its blocks are read."""
    for i in range(count):
        for c in range(x.shape[1]):
            first = _Row()
            second = _Row()
            third = _Row()
            for k in range(starts[i], starts[i + 1]):
                j = 3 * columns[k]
                block = blocks[k]
                first += block[0, 0] * x[j, c] + block[0, 1] * x[j + 1, c] + block[0, 2] * x[j + 2, c]
                second += block[1, 0] * x[j, c] + block[1, 1] * x[j + 1, c] + block[1, 2] * x[j + 2, c]
                third += block[2, 0] * x[j, c] + block[2, 1] * x[j + 1, c] + block[2, 2] * x[j + 2, c]
            y[3 * i, c] = first
            y[3 * i + 1, c] = second
            y[3 * i + 2, c] = third


@wp.kernel(enable_backward=False)
def _diagonal_times(blocks: wp.array(dtype=wp.mat33f), x: wp.array(dtype=wp.vec3f), y: wp.array(dtype=wp.vec3f)):
    i = wp.tid()
    y[i] = blocks[i] * x[i]


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
        rows = np.repeat(np.arange(count + k), np.diff(matrix.indptr))
        #: Which blocks of a matrix like this one are on, and which on or above the diagonal, and where these are.
        self.diagonal, self.upper = matrix.indices == rows, matrix.indices >= rows
        ends = np.cumsum(np.bincount(rows[self.upper], minlength=count + k))
        self.starts = wp.array(np.concatenate([[0], ends]), dtype=wp.int32, device="cpu")
        self.columns = wp.array(matrix.indices[self.upper], dtype=wp.int32, device="cpu")

    def __call__(self, r: Singles) -> Singles:
        return self._up @ self._factors.solve_many(np.asfortranarray(self._down @ r))


class Linear:
    """A matrix with what is held left out, ready to be solved with.

    Parameters
    ----------
    matrix : (3 n, 3 n) block matrix
        Symmetric.
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
        self._single, self.held, self.coarse = matrix.astype(np.float32, copy=False), held, coarse
        free = (~held).astype(np.float32)
        self._free = free.reshape(-1, 1)
        self._upper = wp.array(self._single.data[coarse.upper], dtype=wp.mat33f, device="cpu")
        blocks = self._single.data[coarse.diagonal]
        blocks *= free[:, :, None] * free[:, None, :]
        blocks += (1.0 - free)[:, :, None] * np.eye(3, dtype=np.float32)
        self._inverse = np.linalg.inv(blocks)
        self._inverse_blocks = wp.array(self._inverse, dtype=wp.mat33f, device="cpu")
        self._largest = self._power()

    @cached_property
    def whole(self) -> csr_matrix:
        """Rows of numbers, not of blocks: SciPy multiplies them with several vectors four times faster."""
        return self._single.tocsr()

    @cached_property
    def _blocks(self) -> list[wp.array]:
        matrix = self._single
        starts, columns = (
            wp.array(indices, dtype=wp.int32, device="cpu") for indices in (matrix.indptr, matrix.indices)
        )
        return [starts, columns, wp.array(matrix.data, dtype=wp.mat33f, device="cpu", copy=False)]

    def _times(self, x: Singles) -> Singles:
        y = np.zeros_like(x)
        if x.shape[1] > 1:
            rows = (wp.array(v.reshape(len(v), -1, _WIDE), dtype=_Row, device="cpu", copy=False) for v in (x, y))
            wp.launch(_times_several, dim=1, inputs=[len(self.held), *self._blocks, *rows], device="cpu")
        else:
            inputs = [len(self.held), self.coarse.starts, self.coarse.columns, self._upper, _vectors(x), _vectors(y)]
            wp.launch(_symmetric_times, dim=1, inputs=inputs, device="cpu")
        y *= self._free
        return y

    def _left(self, r: Singles, x: Singles) -> Singles:
        """What a solution leaves of a right side."""
        times = self._times(x)
        return np.subtract(r, times, out=times)

    def _jacobi(self, r: Singles) -> Singles:
        if r.shape[1] > 1:
            return self._free * (self._inverse @ r.reshape(len(self.held), 3, -1)).reshape(r.shape)
        y = np.empty_like(r)
        inputs = [self._inverse_blocks, _vectors(r), _vectors(y)]
        wp.launch(_diagonal_times, dim=len(self.held), inputs=inputs, device="cpu")
        y *= self._free
        return y

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
            step *= fresh * rho
            correction = self._jacobi(self._left(r, x))
            correction *= 2.0 * fresh / half
            step += correction
            x += step
            rho = fresh
        return x

    def _precondition(self, r: Singles) -> Singles:
        x = self._smooth(r)
        x += self.coarse(self._left(r, x))
        x += self._smooth(self._left(r, x))
        return x

    def solve(self, right: Floats, close: float) -> Floats:
        """Solution to a relative residual, of one right side (3 n,) or of several (3 n, k) that share the work.

        `NotSolved` if none is reached or the matrix is not positive.
        """
        sides = self._free * right.reshape(len(self._free), -1)
        count = sides.shape[1]
        if count > 1:
            sides = np.pad(sides, ((0, 0), (0, -count % _WIDE)))
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
            q *= length
            r -= q
            if np.linalg.norm(r, axis=0).max() <= close:
                return (x.astype(np.float64) * scale)[:, :count].reshape(right.shape)
            z = self._precondition(r)
            rz, old = _dots(r, z), rz
            p = z + (rz / np.where(old > 0.0, old, 1.0)).astype(np.float32) * p
        raise NotSolved(f"no convergence in {_MOST} steps")


def _vectors(x: Singles) -> wp.array:
    """Those of nodes, in the same memory."""
    return wp.array(x.reshape(-1, 3), dtype=wp.vec3f, device="cpu", copy=False)


def _dots(a: Singles, b: Singles) -> Floats:
    return np.asarray(np.einsum("nk,nk->k", a, b, dtype=np.float64))
