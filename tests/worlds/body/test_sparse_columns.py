"""Columns that are zero almost everywhere."""

import numpy as np

from warpbrain.worlds.body.effects import SparseColumns


def test_it_is_the_matrix_of_all_columns_that_are_not_zero() -> None:
    dense = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, -3.0]])
    columns = SparseColumns(3)
    for number, column in enumerate(dense):
        columns.add(number, column)
    assert columns.numbers == [0, 2]
    assert np.array_equal(columns.matrix().toarray(), dense[[0, 2]].T)
