"""Checks of a fit by the model it was made with: held-out tests, patterns that mean nothing, and what is left.

They never choose between causes. One that fails takes a name back, or says that something is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.blocks import Blocks
from warpbrain.inference.causes import Cause, Place
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.predict import predictive_p
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.linear import Linear
from warpbrain.worlds.specimen.protocol import Protocol

#: Parts of a test that are held out where it is the only one, and blocks of its rows for intervals.
_BLOCKS = 4
#: Patterns that mean nothing, waves of each, and their length in widths of what they are functions of.
_PLACEBOS, _WAVES, _LENGTH = 100, 40, 0.6


@dataclass(frozen=True, eq=False)
class Folds:
    """Which rows are held out one after the other.

    Attributes
    ----------
    held : tuple of (n,) bool arrays
        Each test that may be fitted, or each quarter of the only one.
    by_test : bool
    """

    held: tuple[Bools, ...]
    by_test: bool


def folds_of(protocol: Protocol) -> Folds:
    """Of all tests that may be fitted."""
    if len(protocol.to_fit) > 1:
        return Folds(tuple(protocol.mask([number]) for number in protocol.to_fit), True)
    blocks = blocks_of(protocol)
    fitted = protocol.mask(protocol.to_fit)
    return Folds(tuple(fitted & (blocks == block) for block in np.unique(blocks[fitted])), False)


def blocks_of(protocol: Protocol) -> Ints:
    """Parts of tests by number (n,)."""
    each = [
        _BLOCKS * k + np.minimum((_BLOCKS * test.path / max(float(test.path[-1]), 1e-12)).astype(np.int64), _BLOCKS - 1)
        for k, test in enumerate(protocol.tests)
    ]
    return np.concatenate(each)


def held_out(fit: Fit, folds: Folds) -> tuple[Floats, float]:
    """What a fit says of each fold's rows given the others: its causes fitted to these, and linear about that.

    Returns
    -------
    stress : (n,) array
        Predicted [Pa]; NaN where nothing was held out.
    log_density : float
        Of all folds.
    """
    rows = fit.rows
    predicted, total = np.full(len(rows), np.nan), 0.0
    for held in folds.held:
        again = fit.refitted_to(rows & ~held)
        columns = np.column_stack([fit.unknown, again.columns])[rows]
        model = GaussianModel(fit.model.noise_factor, columns, fit.scale)
        observed = ~held[rows]
        mean, _ = model.conditional(again.residual[rows], observed)
        predicted[held] = (again.stress - again.columns @ again.z)[held] + mean
        total += model.log_density_of_hidden(again.residual[rows], observed)
    return predicted, total


def placebo_p(about: Linear, name: str, folds: Folds, rng: np.random.Generator) -> float:
    """Probability that a pattern that means nothing predicts held-out rows as well as a cause does.

    A pattern is a random smooth function of stretch, shear, the path of a test and the logarithm of its time, the
    same in all tests, so that it can carry over to those that are held out as a cause does. It has as many places and
    columns as the cause, of the same sizes, and both are in the same model: about the fit without the cause.

    Parameters
    ----------
    about : Linear
        About the fit without the cause.
    name : str
    folds : Folds
    rng : Generator
    """
    fit = about.fit
    cause = next(one for one in about.causes if one.name == name)
    length = np.sqrt(np.mean([np.mean(place.columns**2) for place in cause.places]))
    peaks = fit.forward.protocol.peaks[fit.rows]
    where, causes = _coordinates(fit.forward.protocol)[fit.rows], [cause]
    for number in range(_PLACEBOS):
        places = []
        for place in cause.places:
            pattern = peaks[:, None] * _pattern(where, place.columns.shape[1], rng)
            places.append(Place(pattern * length / np.sqrt(np.mean(pattern**2)), None, place.weight))
        causes.append(Cause(str(number), tuple(places), 0.0, cause.sizes))
    total = np.zeros(len(causes))
    whole = _log_densities(fit.model, fit.residual[fit.rows], causes)
    for held in folds.held:
        observed = ~held[fit.rows]
        kept = [
            Cause(one.name, tuple(Place(p.columns[observed], None, p.weight) for p in one.places), 0.0, one.sizes)
            for one in causes
        ]
        total += whole - _log_densities(fit.model.rows(observed), fit.residual[fit.rows][observed], kept)
    return float((1 + np.sum(total[1:] >= total[0])) / (1 + _PLACEBOS))


def _log_densities(model: GaussianModel, residual: Floats, causes: Sequence[Cause]) -> Floats:
    """Of rows under each cause, summed over its places and sizes."""
    blocks = Blocks(model, residual, causes)
    logs = np.logaddexp.reduce(blocks.log_factors() + blocks.log_weights, axis=1)
    found = np.full(len(causes), -np.inf)
    np.logaddexp.at(found, blocks.cause, logs)
    return np.asarray(found + float(model.log_density(residual)))


def _pattern(where: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Random smooth functions (n, count) of coordinates (n, d): sums of waves."""
    waves = rng.normal(size=(where.shape[1], _WAVES * count)) / _LENGTH
    phases = rng.uniform(0.0, 2.0 * np.pi, size=_WAVES * count)
    weights = rng.normal(size=_WAVES * count)
    return (weights * np.cos(where @ waves + phases)).reshape(len(where), _WAVES, count).sum(axis=1)


def _coordinates(protocol: Protocol) -> Floats:
    """Stretch and shear over their largest, path of the test and logarithm of its time (n, 4)."""
    rows = []
    for test in protocol.tests:
        strain, zero = (test.strain - test.rest) / test.reach, np.zeros(len(test.strain))
        stretch, shear = (strain, zero) if test.rest == 1.0 else (zero, strain)
        since = zero if test.time is None else np.log1p(test.time - test.time[0]) / 5.0
        rows.append(np.column_stack([stretch, shear, test.path / max(float(test.path[-1]), 1e-12), since]))
    return np.concatenate(rows)


def p_of_nothing_left(about: Linear, draws: int, rng: np.random.Generator) -> float:
    """Posterior predictive probability of rows that other causes explain as well, if a fit has all that acts.

    Rows are drawn from the fit's own model, so that having looked for many things in many ways is paid for.
    """
    fit, fields = about.fit, [place.columns for cause in about.causes for place in cause.places]
    return predictive_p(fit.model, fields, beliefs("specimen.sizes"), fit.residual[fit.rows], draws, rng)
