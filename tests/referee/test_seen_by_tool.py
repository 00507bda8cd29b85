import csv
import json

import numpy as np
import pytest

from referee.seen_by_tool import read_seen, stands_out, write_seen
from warpbrain.errors import InputError

#: Two points, a place on the wall and a force.
LABEL = {
    "effects": [{"kind": "gravity"}],
    "clean_effect_m": [[[1e-3, 0.0, 0.0], [0.0, 2e-3, 0.0]]],
    "clean_effect_on_wall_m": [[0.0, 3e-3, 4e-3]],
    "clean_effect_n": [0.1, 0.2, 0.0],
}


@pytest.fixture
def folder(tmp_path):
    rows = [("points", axis) for _ in range(2) for axis in np.eye(3)]
    rows += [("ventricle wall", [0.0, 0.6, 0.8])] + [("force", None)] * 3
    out = tmp_path / "a"
    out.mkdir()
    with (out / "points.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["recording", "direction_x", "direction_y", "direction_z"])
        for name, direction in rows:
            table.writerow([name, *(["", "", ""] if direction is None else direction)])
    np.savez(out / "covariance.npz", covariance=np.diag(np.array([1.0] * 7 + [0.01] * 3)).astype(np.float32))
    return out


def test_everything_that_was_recorded_counts_in_its_unit(folder):
    # 1 and 2 mm, 5 mm along the normal, 1 and 2 standard deviations of a force
    assert stands_out(LABEL, folder) == pytest.approx(np.sqrt(1.0 + 4.0 + 25.0 + 1.0 + 4.0), rel=1e-5)


def test_what_explains_it_hides_it(folder):
    shift = np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 5.0, 0.1, 0.2, 0.0])
    before = stands_out(LABEL, folder)
    noise = np.load(folder / "covariance.npz")["covariance"]
    np.savez(folder / "covariance.npz", covariance=noise + 100.0 * np.outer(shift, shift))
    assert stands_out(LABEL, folder) < 0.2 * before


def test_another_recording_than_was_made_is_an_error(folder):
    with pytest.raises(InputError, match=r"points\.csv: 6 numbers of 'points', 3 were made"):
        stands_out({**LABEL, "clean_effect_m": [[[1e-3, 0.0, 0.0]]]}, folder)


def test_it_is_kept_beside_the_runs_of_cases_that_have_effects(folder):
    assert not read_seen(folder.parent)
    labels = {"a": LABEL, "b": LABEL, "none": {**LABEL, "effects": []}}
    found = write_seen(labels, folder.parent)
    assert set(found) == {"a"} and read_seen(folder.parent) == found
    assert json.loads((folder.parent / "detectability.json").read_text()) == found
