"""Slope and curvature of an energy along lines of principal stretches."""

import numpy as np
import pytest

from warpbrain.physics.laws.stability import Path, derivatives


@pytest.mark.parametrize("exponents", [(1.0, -0.5, -0.5), (1.0, 0.0, 0.0), (1.0, 1.0, 1.0)])
def test_stretches_of_a_path(exponents: tuple[float, float, float]) -> None:
    path = Path(exponents, reach=2.0, steps=60)
    l = np.exp(path.logs)
    assert path.logs[60] == 0.0
    assert l[[0, -1]] == pytest.approx([0.5, 2.0])
    inner = path.stretches[3:-3]
    np.testing.assert_allclose(inner, l[:, None] ** np.array(exponents), rtol=1e-14)
    assert path.stretches.shape == (127, 3)


@pytest.mark.parametrize("power", [-4.7, -1.0, 0.5, 1.0, 2.0, 8.0])
def test_derivatives_of_powers(power: float) -> None:
    path = Path((1.0, 0.0, 0.0), reach=2.0, steps=60)
    l = np.exp(path.logs)
    slope, curvature = derivatives(path.stretches[:, 0] ** power, path.logs, path.step)
    np.testing.assert_allclose(slope, power * l ** (power - 1.0), rtol=1e-7)
    np.testing.assert_allclose(curvature, power * (power - 1.0) * l ** (power - 2.0), rtol=1e-7, atol=1e-9)


def test_several_energies_at_once() -> None:
    logs = np.array([[0.0], [1.0]])
    l = np.exp(logs + 0.01 * np.arange(-3, 4))
    slope, curvature = derivatives(l**3, logs, 0.01)
    np.testing.assert_allclose(slope, 3.0 * np.exp(2.0 * logs), rtol=1e-9)
    np.testing.assert_allclose(curvature, 6.0 * np.exp(logs), rtol=1e-8)
