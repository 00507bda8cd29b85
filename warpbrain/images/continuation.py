"""A displacement outside the body that was computed: smooth, and the less the farther away.

Nothing is computed outside the mesh, but an image does not end there. The displacement is continued by the screened
Laplace equation, `laplacian(u) = u / length^2`, with what was computed given inside and zero beyond the image: in
front of a plane it is `exp(-distance / length)` of what is there, in a narrow gap it is interpolated between the walls.
"""

import numpy as np

from warpbrain.arrays import Bools, Floats, Singles

#: Over which the continued displacement falls to 1/e [mm]. A choice and no measurement: shorter than the largest
#: displacements that there are, about 10 to 20 mm, the map would fold where tissue moves outwards.
LENGTH = 20.0
#: Iterations of conjugate gradients on the finest grid; each coarser one, from whose solution they start, has twice as
#: many, up to `_MOST` (cascadic: Bornemann and Deuflhard 1996, Numerische Mathematik 75, 135). The equation is then
#: solved to about 3 % of the largest displacement.
_ITERATIONS, _MOST = 8, 200
#: Of what is left at first, what is small enough; iterations end sooner there.
_EXACT = 1e-6
#: Edge [voxels] of the grid from which on none coarser is made.
_COARSEST = 12


def continued(values: Singles, known: Bools, voxel: Floats, length: float = LENGTH) -> Singles:
    """Continue values (i, j, k, c) beyond where they are known (i, j, k), on voxels with edges (3,) [mm]; what is known
    stays as it is."""
    start, edges = np.where(known[..., None], values, np.float32(0.0)), np.asarray(voxel, dtype=np.float64)
    parts = [_solved(part, known, edges, length, _ITERATIONS) for part in np.moveaxis(start, -1, 0)]
    return np.stack(parts, axis=-1)


def _solved(values: Singles, known: Bools, voxel: Floats, length: float, iterations: int) -> Singles:
    """Conjugate gradients from the solution on a grid of twice the edges."""
    from scipy.ndimage import zoom
    from scipy.sparse.linalg import LinearOperator, cg

    start = np.zeros_like(values)
    if min(known.shape) > _COARSEST:
        coarse = _solved(*_coarser(values, known), 2.0 * voxel, length, min(2 * iterations, _MOST))
        # linear between the centres of voxels, zero beyond the grid
        start = zoom(coarse, 2, order=1, mode="grid-constant", grid_mode=True)[tuple(map(slice, known.shape))]
    else:
        iterations = _MOST
    start[known] = values[known]
    weights = 1.0 / voxel**2
    factors = (weights / (2.0 * weights.sum() + 1.0 / length**2)).astype(np.float32)

    def left(field: Singles) -> Singles:
        """What the equation leaves of a field where it is to be solved."""
        rest = _neighbours(field, factors) - field
        rest[known] = 0.0
        return rest

    size = (known.size, known.size)
    operator = LinearOperator(size, matvec=lambda x: -left(x.reshape(known.shape)).ravel(), dtype=np.float32)
    change, _ = cg(operator, left(start).ravel(), rtol=_EXACT, maxiter=iterations)
    return np.asarray(start + change.reshape(known.shape))


def _neighbours(values: Singles, factors: Singles) -> Singles:
    """Sum of the six voxels around each, weighted by a factor for each axis; there is zero beyond the grid."""
    x, y, z = factors
    v, s = np.pad(values, 1), slice(1, -1)
    return x * v[2:, s, s] + x * v[:-2, s, s] + y * v[s, 2:, s] + y * v[s, :-2, s] + z * v[s, s, 2:] + z * v[s, s, :-2]


def _coarser(values: Singles, known: Bools) -> tuple[Singles, Bools]:
    """Means of what is known in blocks of two voxels along each axis."""
    edges = [(0, n % 2) for n in known.shape]
    i, j, k = ((n + 1) // 2 for n in known.shape)
    counts, sums = (
        np.pad(field, edges).reshape(i, 2, j, 2, k, 2).sum(axis=(1, 3, 5), dtype=np.float32)
        for field in (known, values)
    )
    return sums / np.maximum(counts, 1.0), counts > 0
