"""The displacement outside the body: decay, gaps, and the equation itself."""

import numpy as np

from warpbrain.images.continuation import continued


def test_in_front_of_a_plane_it_decays_exponentially(verify):
    shape, length = (120, 40, 40), 12.0
    known = np.zeros(shape, dtype=bool)
    known[:10] = True
    # what is given grows across, so that borders, where there is zero, do not matter in the middle
    values = np.ones((*shape, 1), dtype=np.float32)
    known[:, :2] = known[:, -2:] = known[:, :, :2] = known[:, :, -2:] = True
    distance = np.maximum(np.arange(shape[0]) - 9, 0)
    values *= np.exp(-distance / length)[:, None, None, None].astype(np.float32)
    found = continued(values, known, np.ones(3), length)[:60, 20, 20, 0]
    verify(
        "the displacement outside the mesh falls as exp(-distance / length) in front of a plane",
        "solution of the screened Laplace equation",
        np.abs(found - np.exp(-distance[:60] / length)).max(),
        0.02,
    )


def test_it_solves_the_screened_laplace_equation(verify):
    from scipy.sparse import diags_array, eye_array, kron
    from scipy.sparse.linalg import spsolve

    shape, voxel, length = (22, 19, 17), np.array([1.0, 1.5, 2.0]), 8.0
    rng = np.random.default_rng(1)
    known = np.zeros(shape, dtype=bool)
    known[6:12, 5:9, 4:7] = known[6:12, 11:14, 8:12] = True
    at = np.indices(shape) / 20.0
    values = np.stack([np.sin(3 * at[0]) + at[1], at[2] - at[0]], axis=-1) + 0.1 * rng.normal(size=2)
    found = continued(values, known, voxel, length)

    def second(n, h):
        return diags_array([1.0, -2.0, 1.0], offsets=[-1, 0, 1], shape=(n, n)) / h**2

    one = [eye_array(n) for n in shape]
    lines = [second(n, h) for n, h in zip(shape, voxel, strict=True)]
    operator = (
        kron(kron(lines[0], one[1]), one[2])
        + kron(kron(one[0], lines[1]), one[2])
        + kron(kron(one[0], one[1]), lines[2])
        - eye_array(known.size) / length**2
    ).tocsr()
    given = known.ravel()
    expected = np.where(given[:, None], values.reshape(-1, 2), 0.0)
    right = -(operator[~given][:, given] @ expected[given])
    expected[~given] = spsolve(operator[~given][:, ~given].tocsc(), right)
    np.testing.assert_allclose(found[known], values[known], rtol=1e-6)
    verify(
        "the displacement outside the mesh, of the largest inside",
        "SciPy's sparse factorisation of the same equation",
        np.abs(found.reshape(-1, 2) - expected).max() / np.abs(expected).max(),
        # a few iterations on each grid; where nothing is computed no more would be truer
        0.05,
    )
