"""Kernels in principal axes, against NumPy and against the sums that they stand for."""

import numpy as np
import pytest

from referee.principal import derivatives, stretches_of


# a body at rest, tissue that hardly moves, stretches that are nearly the same, and large ones
@pytest.mark.parametrize("spread", [0.0, 1e-12, 1e-5, 0.05, 0.3])
def test_stretches_are_singular_values(spread):
    random = np.random.default_rng(0)
    F = np.eye(3) + spread * random.normal(size=(500, 4, 3, 3))
    F = F[np.linalg.det(F).min(axis=1) > 0.1]
    u, v, stretch = stretches_of(F)
    np.testing.assert_allclose(np.sort(stretch)[..., ::-1], np.linalg.svd(F, compute_uv=False), rtol=1e-12)
    np.testing.assert_allclose((u * stretch[..., None, :]) @ np.swapaxes(v, -1, -2), F, atol=1e-14)
    for axes in (u, v):
        np.testing.assert_allclose(np.swapaxes(axes, -1, -2) @ axes, np.broadcast_to(np.eye(3), F.shape), atol=1e-10)


def test_equal_stretches_have_axes_at_right_angles():
    F = np.stack([np.diag([1.2, 1.2, 0.7]), np.diag([0.9, 1.1, 0.9]), np.eye(3)[[1, 2, 0]]])
    _, v, stretch = stretches_of(F)
    np.testing.assert_allclose(np.swapaxes(v, -1, -2) @ v, np.broadcast_to(np.eye(3), F.shape), atol=1e-15)
    np.testing.assert_allclose(np.sort(stretch), [[0.7, 1.2, 1.2], [0.9, 0.9, 1.1], [1.0, 1.0, 1.0]], rtol=1e-15)


def test_derivatives_are_turned_from_principal_axes():
    random = np.random.default_rng(1)
    u, v, both, same, other = random.normal(size=(5, 7, 3, 3))
    # a stress has an energy: its derivative is symmetric
    both, same, other = (0.5 * (x + np.swapaxes(x, -1, -2)) for x in (both, same, other))
    apart = 1.0 - np.eye(3)
    same, other = same * apart, other * apart
    sums = np.einsum("nab,nia,nJa,nkb,nLb->nJLik", both, u, v, u, v)
    sums += np.einsum("nab,nia,nJb,nka,nLb->nJLik", same, u, v, u, v)
    sums += np.einsum("nab,nia,nJb,nkb,nLa->nJLik", other, u, v, u, v)
    np.testing.assert_allclose(derivatives(u, v, both, same, other), sums, atol=1e-12 * np.abs(sums).max())
