import numpy as np
import pytest
from shapes import box

from warpbrain.mesh.quality import extent, principal_axes


def test_it_is_the_same_however_a_body_lies():
    points = box((2, 3, 4), (0.3, 0.4, 1.2)).points
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    assert extent(points) == pytest.approx(1.3)
    assert extent(points @ rotation.T + 5.0) == pytest.approx(1.3)


def test_axes_turn_with_the_body():
    points = box((2, 3, 4), (0.3, 0.4, 1.2)).points
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    np.testing.assert_allclose(np.abs(principal_axes(points)), np.eye(3), atol=1e-12)
    turned = principal_axes(points @ rotation.T + 5.0)
    np.testing.assert_allclose(np.abs(turned @ rotation), np.eye(3), atol=1e-9)
