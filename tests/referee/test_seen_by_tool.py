import csv
import json

import numpy as np
import pytest

from referee.errors import InputError
from referee.runs import read_seen
from referee.seen_by_tool import stands_out, write_seen

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
    rows += [("ventricle wall", np.array([0.0, 0.6, 0.8]))] + [("force", np.zeros(3))] * 3
    out = tmp_path / "a"
    out.mkdir()
    with (out / "points.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["recording"])
        table.writerows([name] for name, _ in rows)
    _write(out, np.diag([1.0] * 7 + [0.01] * 3), np.stack([direction for _, direction in rows]))
    return out


def _write(out, covariance, directions):
    np.savez(out / "covariance.npz", covariance=covariance.astype(np.float32), direction=directions)


def test_everything_that_was_recorded_counts_in_its_unit(folder):
    # 1 and 2 mm, 5 mm along the normal, 1 and 2 standard deviations of a force
    [d] = stands_out(LABEL, folder)
    assert d == pytest.approx(np.sqrt(1.0 + 4.0 + 25.0 + 1.0 + 4.0), rel=1e-5)


def test_what_explains_it_hides_it(folder):
    shift = np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 5.0, 0.1, 0.2, 0.0])
    [before] = stands_out(LABEL, folder)
    known = np.load(folder / "covariance.npz")
    _write(folder, known["covariance"] + 100.0 * np.outer(shift, shift), known["direction"])
    assert stands_out(LABEL, folder)[0] < 0.2 * before


def test_another_recording_than_was_made_is_an_error(folder):
    with pytest.raises(InputError, match=r"points\.csv: 6 numbers of 'points', 3 were made"):
        stands_out({**LABEL, "clean_effect_m": [[[1e-3, 0.0, 0.0]]]}, folder)


def test_it_is_kept_beside_the_runs_of_cases_that_have_effects(folder):
    assert not read_seen(folder.parent)
    labels = {"a": LABEL, "b": LABEL, "none": {**LABEL, "effects": []}}
    found = write_seen(labels, folder.parent)
    assert set(found) == {"a"} and read_seen(folder.parent) == found
    (folder / "covariance.npz").unlink()
    assert write_seen(labels, folder.parent) == found
    assert json.loads((folder.parent / "detectability.json").read_text()) == found


def test_of_two_that_look_nearly_alike_neither_stands_out_alone(folder):
    still = {"clean_effect_on_wall_m": [[0.0] * 3], "clean_effect_n": [0.0] * 3}
    one = {"clean_effect_m": [[[3e-3, 4e-3, 0.0], [0.0, 0.0, 0.0]]], **still}
    other = {"clean_effect_m": [[[0.0, 4e-3, 0.0], [0.0, 0.0, 0.0]]], **still}
    whole, first, second = stands_out({**LABEL, "effects": [one, other]}, folder)
    # of 3 and 4 mm along two axes the second effect may be all that is along one of them
    assert first == pytest.approx(3.0, rel=1e-3)
    assert second == pytest.approx(4.0 * 3.0 / 5.0, rel=1e-3)
    assert whole == pytest.approx(np.sqrt(35.0), rel=1e-5)


def test_what_earlier_runs_wrote_is_read(folder):
    (folder.parent / "detectability.json").write_text(json.dumps({"a": 3.5}))
    assert read_seen(folder.parent) == {"a": [3.5]}
