"""What the noise of tests is taken to be: independent readings, and a smooth part that a stretch of a curve shares.

Errors of a curve are alike from row to row: of a mean over specimens, of a gauge, of a shape that is not quite what was
measured. Taking them for independent makes any difference significant. Its scale is unknown and is summed over.

How alike two rows are is Matern's function of order 5/2: such errors have a slope and a curvature, but not every
derivative, as a Gaussian function would have it (Stein 1999, Interpolation of Spatial Data, section 1.7). With a
Gaussian one a misfit of a fifth of a curve is no surprise as long as it is smooth, and one of a twentieth with a bend
is.
"""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.worlds.specimen.protocol import Protocol, Test

#: Patterns of a test at most, the smoothest.
_PATTERNS = 8


def noise_factor(protocol: Protocol) -> Floats:
    """Lower triangular factor (n, n) of the covariance [Pa^2]."""
    covariance = np.zeros((len(protocol), len(protocol)))
    for test, rows in zip(protocol.tests, protocol.rows, strict=True):
        reading = max(test.sigma, belief("specimen.reading") * test.peak)
        shared = (belief("specimen.shared") * test.peak) ** 2 * _alike(test, belief("specimen.reach"))
        covariance[rows, rows] = reading**2 * np.eye(len(test.strain)) + shared
    return np.asarray(np.linalg.cholesky(covariance))


def smooth_patterns(protocol: Protocol, reach: float) -> Floats:
    """Columns (n, 8 per test at most) of any smooth change of a test, as large as its largest stress."""
    columns = []
    for test, rows in zip(protocol.tests, protocol.rows, strict=True):
        values, vectors = np.linalg.eigh(_alike(test, reach))
        of_test = np.zeros((len(protocol), min(_PATTERNS, len(values))))
        of_test[rows] = test.peak * vectors[:, -_PATTERNS:] * np.sqrt(np.maximum(values[-_PATTERNS:], 0.0))
        columns.append(of_test)
    return np.concatenate(columns, axis=1)


def _alike(test: Test, reach: float) -> Floats:
    away = np.sqrt(5.0) * np.abs(test.path[:, None] - test.path[None]) / reach
    return np.asarray((1.0 + away + away**2 / 3.0) * np.exp(-away))
