"""Cases of opened truths: of those that ship it is known what was published."""

import numpy as np
import pytest

from concealed.places import CASES, truth_file
from concealed.publish import read_recording
from concealed.restore import opened, restore
from warpbrain.cases.reading import read_case

WALLS = ("ventricles", "cavity")


@pytest.mark.parametrize("name", ["0529", "0684"])
def test_a_case_that_ships_is_restored(name, tmp_path):
    case = restore(truth_file(name), tmp_path)
    assert (case / "case.toml").read_text(encoding="utf-8") == (CASES / name / "case.toml").read_text(encoding="utf-8")
    assert (case / "truth.sha256").read_bytes() == (CASES / name / "truth.sha256").read_bytes()
    both = [[read_recording(of / "recordings" / f"{wall}.csv") for wall in WALLS] for of in (case, CASES / name)]
    (points, restored), (published_points, published) = (map(np.vstack, zip(*of, strict=True)) for of in both)
    np.testing.assert_allclose(points, published_points, atol=2e-7)
    # the same noise: the middle that the head was turned about is that of another mesh
    difference = restored - published
    assert np.linalg.norm(difference.mean(axis=0)) < 1e-4
    assert np.abs(difference - difference.mean(axis=0)).max() < 1e-6


def test_every_opened_truth_is_a_case(tmp_path):
    truths = opened()
    assert len(truths) == len(set(truths.values())) > 80
    name = sorted(truths)[-1]
    case = read_case(restore(truths[name], tmp_path / name))
    assert [recording.name for recording in case.recordings] == list(WALLS)
