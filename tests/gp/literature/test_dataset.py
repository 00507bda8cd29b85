"""The points of the training set, as the paper counts them."""

import numpy as np
import pytest

from warpbrain.gp.literature.studies import read_studies
from warpbrain.gp.literature.study import ANATOMIES, GROUPS, METHODS, STRETCHES, dataset


def test_points_and_curves_of_what_the_paper_trained_on():
    groups, stretches, log_energies = dataset(read_studies("as_published"))
    assert len(groups) == len(stretches) == len(log_energies) == 7300
    assert np.bincount(groups).tolist() == [100 * n for n in (5, 5, 1, 1, 1, 1, 16, 7, 10, 10, 15, 1)]


def test_corrected_leaves_no_elastography_of_abnormalities():
    groups, _, _ = dataset(read_studies())
    assert len(groups) == 7200
    assert np.bincount(groups).tolist() == [100 * n for n in (5, 5, 1, 0, 1, 1, 16, 7, 10, 10, 15, 1)]


def test_tasks_are_numbered_as_in_the_paper():
    assert [GROUPS.index(f"{method}/{anatomy}") for method in METHODS for anatomy in ANATOMIES] == list(range(12))
    assert GROUPS[0] == "MRE/grey matter" and GROUPS[7] == "linear/abnormal" and GROUPS[10] == "hyperelastic/brain"
    assert set(STRETCHES) == set(GROUPS)


def test_points_are_logarithms_of_the_studies_energies():
    studies = read_studies()
    groups, stretches, log_energies = (values.reshape(72, 100) for values in dataset(studies))
    for index in (0, 39, 71):
        np.testing.assert_array_equal(stretches[index], studies[index].grid())
        np.testing.assert_allclose(
            np.exp(log_energies[index]) - 1e-4, studies[index].energy(studies[index].grid()), atol=1e-9
        )
        assert (groups[index] == studies[index].task).all()


def test_rest_comes_in_from_split_studies_only():
    studies = read_studies("as_published")
    _, stretches, log_energies = dataset(studies)
    rest = stretches == 1.0
    assert rest.sum() == 40
    assert log_energies[rest] == pytest.approx(np.log(1e-4))
    assert {studies[index // 100].number for index in np.flatnonzero(rest)} == set(range(53, 73))


def test_other_numbers_of_points():
    studies = read_studies()
    assert [len(values) for values in dataset(studies, 11)] == [11 * 72] * 3
    assert [len(values) for values in dataset(())] == [0] * 3
