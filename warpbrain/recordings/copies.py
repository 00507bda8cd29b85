"""Rows that stand in a recording of points more than once: one row, with the weights of all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.recordings.recording import PointsRecording


def distinct_rows(recording: PointsRecording, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rows without copies of others, and their weights.

    A copy is of the same place and the same time, went as far, and has the same noise, to the last bit. Taken for rows
    of their own, two of half a weight would not be one: a gross error would have to strike each by itself, and what
    neighbours share grows with the noise of each.

    Parameters
    ----------
    recording : PointsRecording
    rows : (k,) int array
        Those to look at.

    Returns
    -------
    rows : (m,) int64 array
        The first of each, in the order in which they were given.
    weights : (m,) array
        Sums of the weights of each and its copies; rows without a weight have that of one.
    """
    weights = np.ones(len(rows)) if recording.weights is None else recording.weights[rows]
    told = [recording.points, recording.displacement, recording.time, recording.sigmas]
    columns = np.column_stack([values[rows] for values in told if values is not None])
    _, first, of = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    total = np.bincount(of.ravel(), weights, minlength=len(first))
    order = np.argsort(first)
    return rows[first[order]], np.asarray(total[order], dtype=np.float64)
