"""Landmarks of patients in the template brain: as measured, in tissue, and said to be in no patient's anatomy."""

from functools import cache

import numpy as np
import pytest
from drawn_for_commit import one_for_this_commit
from scipy.spatial.transform import Rotation

from warpbrain.cases.shipped import RESECT, files_of, find_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.inference.decide import CANNOT_SAY, NOT_PHYSICS, NOTHING
from warpbrain.recordings.location import locate

#: Mean distance of the landmarks of a pair [mm], from the database's files.
DISTANCES = dict(
    zip(
        RESECT,
        [1.82, 5.68, 2.99, 12.02, 1.82, 2.63, 4.57, 3.03, 3.39, 6.39, 3.28, 4.55, 1.10, 10.06, 2.83],
        strict=True,
    )
)


#: Read once for all tests.
case_of = cache(find_case)


@pytest.mark.parametrize("name", RESECT)
def test_landmarks_are_as_they_were_measured(name):
    case = case_of(name)
    [recording] = case.recordings
    assert len(recording.points) in (15, 16)
    assert np.linalg.norm(recording.displacement, axis=1).mean() == pytest.approx(1e-3 * DISTANCES[name], abs=6e-6)
    # a rigid motion explains all but about a millimetre
    x, y = recording.points, recording.points + recording.displacement
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    left = y - Rotation.align_vectors(y, x)[0].apply(x)
    assert 8e-4 < np.sqrt(np.mean(np.sum(left**2, axis=1))) < 1.6e-3
    for file in files_of(name):
        assert f'file = "{recording.file}"' in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", RESECT)
def test_they_lie_in_the_template_or_its_ventricles(name):
    case = case_of(name)
    points = case.recordings[0].points
    location = locate(case.mesh.points, case.mesh.tetrahedra, points)
    outside = location.distance > 0.0
    nodes = location.nodes[outside][location.weights[outside] > 1e-9]
    assert case.mesh.node_sets["ventricle"][nodes].all()


@pytest.mark.parametrize("name", RESECT)
def test_it_is_said_whose_they_are_and_that_the_mesh_is_not(name):
    case = case_of(name)
    assert "no patient's mesh" in case.title and case.origin == "measured"
    assert case.registration is not None and case.registration.shift == pytest.approx(0.002)
    for file in files_of(name):
        text = file.read_text(encoding="utf-8")
        assert "CC BY 4.0" in text and "NOT this patient's anatomy" in text
        notice = (file.parent / "RESECT.md").read_text(encoding="utf-8")
        assert "10.1002/mp.12268" in notice and "10.11582/2017.00004" in notice and "What was changed" in notice


@pytest.mark.slow(65)
# all 15: bench/real/resect.py; any of them: tests/subsets
@pytest.mark.parametrize("name", one_for_this_commit(["resect-01", "resect-14"]))
def test_a_wrong_registration_is_no_missing_physics(name):
    found = Diagnosing(find_case(name), device="cpu").run()
    assert found.verdict in (NOTHING, NOT_PHYSICS, CANNOT_SAY)
    assert not found.named and not set(found.group) - {"registration"}
    # what would have been seen is said
    assert found.smallest["gravity"].size > 0.0
