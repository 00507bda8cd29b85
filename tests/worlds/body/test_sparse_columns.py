"""Columns that are zero almost everywhere."""

import numpy as np

from warpbrain.worlds.body.effects import sparse_columns


def test_it_is_the_matrix_of_all_columns_that_are_not_zero() -> None:
    dense = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, -3.0]])
    numbers, matrix = sparse_columns(3, enumerate(dense))
    assert numbers == [0, 2]
    assert np.array_equal(matrix.toarray(), dense[[0, 2]].T)


def test_of_nothing_there_is_none() -> None:
    numbers, matrix = sparse_columns(3, [(7, np.zeros(3))])
    assert numbers == [] and matrix.shape == (3, 0)
