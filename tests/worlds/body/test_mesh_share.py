"""The part of the mesh's error that belongs to mechanisms."""

import numpy as np

from warpbrain.worlds.body.weighted_set import MeshShare


def test_a_share_does_not_change_with_mechanisms_beside():
    share = MeshShare(np.array([1.0, -2.0, 0.5]), np.array([0.3, -0.1]), 0.7)
    z = np.array([1.2, -0.4])
    beside = share.extended(5)
    for others in (np.zeros(3), np.array([3.0, -1.0, 2.0])):
        np.testing.assert_allclose(beside.at(np.append(z, others)), share.at(z), rtol=1e-14)
    np.testing.assert_allclose(share.at(z), share.answer * (0.7 + 0.3 * 1.2 + 0.1 * 0.4), rtol=1e-14)


def test_a_mechanism_that_is_left_out_keeps_its_part():
    share = MeshShare(np.array([1.0, -2.0, 0.5]), np.array([0.3, -0.1, 0.8]), 0.7)
    z = np.array([1.2, -0.4, 2.0])
    without = share.with_fixed(slice(1, 2), z[1:2])
    np.testing.assert_allclose(without.at(z[[0, 2]]), share.at(z), rtol=1e-14)
