"""A displacement outside the body that was computed: smooth, and the less the farther away.

Nothing is computed outside the mesh, but an image does not end there. The displacement is continued by the screened
Laplace equation, `laplacian(u) = u / length^2`, with what was computed given inside and zero beyond the image: in
front of a plane it is `exp(-distance / length)` of what is there, in a narrow gap it is interpolated between the walls.
"""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Bools, Floats, Singles

#: Over which the continued displacement falls to 1/e [mm]. A choice and no measurement: shorter than the largest
#: displacements that there are, about 10 to 20 mm, the map would fold where tissue moves outwards.
LENGTH = 20.0
#: Iterations of conjugate gradients on the finest grid; each coarser one, from whose solution they start, has twice as
#: many, up to `_MOST` (cascadic: Bornemann and Deuflhard 1996, Numerische Mathematik 75, 135). The equation is then
#: solved to about 3 % of the largest displacement.
_ITERATIONS, _MOST = 8, 200
#: Edge [voxels] of the grid from which on none coarser is made.
_COARSEST = 12


def continued(values: Singles, known: Bools, voxel: Floats, length: float = LENGTH) -> Singles:
    """Continue values (i, j, k, c) beyond where they are known (i, j, k), on voxels with edges (3,) [mm]; what is known
    stays as it is."""
    start = np.where(known[..., None], values, np.float32(0.0)).astype(np.float32)
    return _solved(start, known, np.asarray(voxel, dtype=np.float64), length, _ITERATIONS)


def _solved(values: Singles, known: Bools, voxel: Floats, length: float, iterations: int) -> Singles:
    """Conjugate gradients from the solution on a grid of twice the edges."""
    start = np.zeros_like(values)
    if min(known.shape) > _COARSEST:
        more = min(2 * iterations, _MOST)
        start = _finer(_solved(*_coarser(values, known), 2.0 * voxel, length, more), known.shape)
    else:
        iterations = _MOST
    start[known] = values[known]
    weights = 1.0 / voxel**2
    factors = (weights / (2.0 * weights.sum() + 1.0 / length**2)).astype(np.float32)
    left = _neighbours(start, factors) - start
    left[known] = 0.0
    direction, square = left.copy(), _dots(left, left)
    for _ in range(iterations):
        product = direction - _neighbours(direction, factors)
        product[known] = 0.0
        step = (square / np.maximum(_dots(direction, product), 1e-30)).astype(np.float32)
        start += step * direction
        left -= step * product
        before, square = square, _dots(left, left)
        direction *= (square / np.maximum(before, 1e-30)).astype(np.float32)
        direction += left
    return start


def _neighbours(values: Singles, factors: Singles) -> Singles:
    """Sum of the six voxels around each, weighted by a factor for each axis; there is zero beyond the grid."""
    total = np.zeros_like(values)
    for axis, factor in enumerate(factors):
        ahead, behind = [slice(None)] * 3, [slice(None)] * 3
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        scaled = factor * values
        total[tuple(behind)] += scaled[tuple(ahead)]
        total[tuple(ahead)] += scaled[tuple(behind)]
    return total


def _dots(a: Singles, b: Singles) -> Floats:
    """Inner products (c,) of two fields of c components."""
    return np.einsum("nc,nc->c", a.reshape(-1, a.shape[3]), b.reshape(-1, b.shape[3]), dtype=np.float64)


def _coarser(values: Singles, known: Bools) -> tuple[Singles, Bools]:
    """Means of what is known in blocks of two voxels along each axis."""
    edges = [(0, n % 2) for n in known.shape]
    i, j, k = ((n + 1) // 2 for n in known.shape)
    blocks = (i, 2, j, 2, k, 2)
    counts = np.pad(known, edges).reshape(blocks).sum(axis=(1, 3, 5), dtype=np.float32)
    sums = np.pad(values, [*edges, (0, 0)]).reshape(*blocks, values.shape[3]).sum(axis=(1, 3, 5))
    return sums / np.maximum(counts, 1.0)[..., None], counts > 0


def _finer(coarse: Singles, shape: tuple[int, ...]) -> Singles:
    """Linear interpolation to a grid of half the voxels' edges, zero beyond the coarse one."""
    for axis, n in enumerate(shape):
        edges = [(1, 1) if a == axis else (0, 0) for a in range(coarse.ndim)]
        wide = np.moveaxis(np.pad(coarse, edges), axis, 0)
        here = np.float32(0.75) * wide[1:-1]
        fine = np.empty((2 * len(here), *here.shape[1:]), dtype=np.float32)
        fine[0::2] = here + np.float32(0.25) * wide[:-2]
        fine[1::2] = here + np.float32(0.25) * wide[2:]
        coarse = np.moveaxis(fine[:n], 0, axis)
    return np.ascontiguousarray(coarse)
