"""What a hypothesis predicts of tests that it was not fitted to: each in turn, its rows in blocks for intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.held_out import Predicted
from warpbrain.diagnosis.specimen.fitting import Fitting, SpecimenFit
from warpbrain.diagnosis.specimen.protocol import Protocol

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Blocks of a test; and the error of a hypothesis that cannot be fitted without a test, of its largest stress.
_BLOCKS, _NOTHING = 4, 10.0


@dataclass(frozen=True, eq=False)
class Folds:
    """Which rows are held out one after the other.

    Attributes
    ----------
    fitted : (n,) bool array
        Rows of all tests that may be fitted.
    held : tuple of (n,) bool arrays
    blocks : (n,) int array
        For intervals.
    scale : (n,) array
        Largest stress of each row's test [Pa]: errors are compared relative to it.
    by_test : bool
        Whether whole tests are held out; parts of the only one otherwise.
    """

    fitted: Bools
    held: tuple[Bools, ...]
    blocks: NDArray[np.int64]
    scale: Floats
    by_test: bool


def folds_of(protocol: Protocol) -> Folds:
    """Each test that may be fitted, or each of the blocks of the only one."""
    fitted = protocol.mask(protocol.to_fit)
    blocks, scale = np.zeros(len(protocol), dtype=np.int64), np.ones(len(protocol))
    for number, (test, rows) in enumerate(zip(protocol.tests, protocol.rows, strict=True)):
        share = test.path / max(float(test.path[-1]), 1e-12)
        blocks[rows] = _BLOCKS * number + np.minimum((_BLOCKS * share).astype(np.int64), _BLOCKS - 1)
        scale[rows] = test.peak
    if len(protocol.to_fit) > 1:
        held = tuple(protocol.mask([number]) for number in protocol.to_fit)
    else:
        held = tuple(fitted & (blocks == block) for block in np.unique(blocks[fitted]))
    return Folds(fitted, held, blocks, scale, len(protocol.to_fit) > 1)


def held_out(fitting: Fitting, fit: SpecimenFit, folds: Folds) -> tuple[Predicted, Floats]:
    """Errors of a hypothesis at the rows of each fold when it is fitted to the others.

    Returns
    -------
    Predicted
        Relative to the largest stress of each test, without what only a test itself can tell.
    (n,) array
        Predicted stress [Pa]; NaN where nothing was held out.
    """
    forward = fitting.forward
    forward.use_shape_of(forward.material(fit.hypothesis, fit.z))
    predicted = np.full(len(forward.protocol), np.nan)
    errors = np.zeros(len(forward.protocol))
    for own in folds.held:
        found = fitting.fit(fit.hypothesis, folds.fitted & ~own, [fit.z], fit.kappa, refresh=False)
        if found is None:
            predicted[own] = _NOTHING * folds.scale[own]
            errors[own] = predicted[own]
            continue
        predicted[own] = found.stress[own]
        errors[own] = _without_its_own(fitting, found, own, (forward.protocol.observed - found.stress)[own])
    rows = folds.fitted
    return Predicted(errors[rows] / folds.scale[rows], folds.blocks[rows], np.flatnonzero(rows)), predicted


def _without_its_own(fitting: Fitting, fit: SpecimenFit, own: Bools, errors: Floats) -> Floats:
    """Errors (m,) of rows less what only their own test can tell: the zero of its gauge, its drift, its specimen.

    No fit to other tests knows these; they are taken out as far as their priors allow.
    """
    count = len(fitting.forward.nuisances(fit.hypothesis))
    private = np.array([k for k in range(count) if not fit.columns[~own, k].any() and fit.columns[own, k].any()])
    if not len(private):
        return errors
    # as errors are compared: row by row alike
    sigma = fit.kappa * np.sqrt(np.sum(fitting.factor[own] ** 2, axis=1))
    W = fit.columns[own][:, private] / sigma[:, None]
    z = np.linalg.solve(np.eye(len(private)) + W.T @ W, W.T @ (errors / sigma))
    return errors - fit.columns[own][:, private] @ z


def placebos(fitting: Fitting, fit: SpecimenFit, folds: Folds, freedom: int, rng: np.random.Generator) -> Floats:
    """Held-out errors of a fit with smooth patterns that mean nothing in the place of a mechanism.

    A pattern is a random smooth function of stretch, shear, the way along a test and the logarithm of its time, the
    same in all tests, so that it can carry over to those that are held out as a mechanism does. Each competes to first
    order.
    """
    protocol = fitting.forward.protocol
    where = _coordinates(protocol)
    observed = protocol.observed - fit.stress + fit.columns @ fit.z
    sigma = np.sqrt(np.sum(fitting.factor**2, axis=1)) * fit.kappa
    found = np.zeros(_PLACEBOS)
    for number in range(_PLACEBOS):
        waves = rng.normal(size=(where.shape[1], _WAVES, freedom)) / _LENGTH
        phases = rng.uniform(0.0, 2.0 * np.pi, size=(_WAVES, freedom))
        weights = rng.normal(size=(_WAVES, freedom)) * np.sqrt(2.0 / _WAVES)
        pattern = np.sum(weights * np.cos(np.einsum("nd,dwf->nwf", where, waves) + phases), axis=1)
        columns = np.column_stack([fit.columns, _SIZE * folds.scale[:, None] * pattern])
        W, w = columns / sigma[:, None], observed / sigma
        errors = np.zeros(len(protocol))
        for own in folds.held:
            others = folds.fitted & ~own
            gram = np.eye(W.shape[1]) + W[others].T @ W[others]
            left = (observed - columns @ np.linalg.solve(gram, W[others].T @ w[others]))[own]
            errors[own] = _without_its_own(fitting, fit, own, left)
        relative = errors[folds.fitted] / folds.scale[folds.fitted]
        found[number] = float(np.sqrt(np.mean(relative**2)))
    return found


_PLACEBOS, _WAVES, _LENGTH, _SIZE = 100, 40, 0.6, 0.2


def _coordinates(protocol: Protocol) -> Floats:
    """Stretch and shear over their largest, way along the test and logarithm of its time (n, 4)."""
    rows = []
    for test in protocol.tests:
        strain = test.strain - test.rest
        reach = max(float(np.abs(strain).max()), 1e-12)
        zero = np.zeros(len(strain))
        stretch, shear = (strain / reach, zero) if test.mode == "axial" else (zero, strain / reach)
        since = zero if test.time is None else np.log1p(test.time - test.time[0]) / 5.0
        rows.append(np.column_stack([stretch, shear, test.path / max(float(test.path[-1]), 1e-12), since]))
    return np.concatenate(rows)
