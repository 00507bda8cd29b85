"""`state.vtu`, what images are warped by after a diagnosis."""

import numpy as np

from warpbrain.mesh.vtu import read_vtu
from warpbrain.report.diagnosis.files import write_diagnosed_state
from warpbrain.report.files import LEFT, SEEN, UNSEEN, read_state
from warpbrain.worlds.body.uncertainty import displacement_deviation


def test_the_last_state_is_that_of_what_is_named(small_diagnosis, tmp_path):
    write_diagnosed_state(tmp_path / "state.vtu", small_diagnosis)
    found = read_state(tmp_path)
    state = small_diagnosis.best.refit.state
    assert small_diagnosis.named
    np.testing.assert_allclose(found.u, state.u, atol=1e-12)
    np.testing.assert_array_equal(found.mesh.tetrahedra, state.system.model.mesh.tetrahedra)
    deviation = displacement_deviation(small_diagnosis.best, small_diagnosis.base)
    np.testing.assert_allclose(found.deviation, np.linalg.norm(deviation, axis=1), atol=1e-12)
    assert np.linalg.norm(found.u - small_diagnosis.base.at.u, axis=1).max() > 1e-5


def test_trust_is_what_the_map_says(small_diagnosis, diagnosed, tmp_path):
    write_diagnosed_state(tmp_path / "state.vtu", small_diagnosis)
    trust = read_state(tmp_path / "state.vtu").trust
    fields = read_vtu(diagnosed / "map.vtu").point_data
    expected = np.where(fields["significant"] > 0, LEFT, np.where(fields["blind"] > 0, UNSEEN, SEEN))
    np.testing.assert_array_equal(trust, expected)
    assert (trust == LEFT).any()
