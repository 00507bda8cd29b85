"""Fits causes to tests without linearising, and says how probable they then are: Laplace's approximation.

Damped least squares (`scipy.optimize.least_squares`) of rows and coefficients to the most probable coefficients. About
them the rows are a `GaussianModel`, whose log density is the evidence; the scale of the noise is the most probable one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError
from warpbrain.inference.decide import UNKNOWN
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.noise import scales
from warpbrain.worlds.specimen.forward import Component, Forward
from warpbrain.worlds.specimen.material import NoStateError

#: Steps at most, and the relative gain that ends them; how often a fit is repeated with the scale of the noise, and
#: with the glued ends of the law, that it arrived at.
_STEPS, _DONE, _SETTLING = 30, 1e-4, 3
#: What causes raise whose coefficients cannot be.
CANNOT_BE = (InputError, NoStateError, OverflowError, np.linalg.LinAlgError, ValueError)
#: Relative change of the factor of glued ends that is none.
_SAME = 0.01


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes at their most probable coefficients.

    Attributes
    ----------
    forward : Forward
    assumed : tuple of Component
    unknown : (n, q) array
        Columns of smooth changes without a name, one standard deviation each; q is 0 without them.
    rows : (n,) bool array
        That were fitted.
    noise : (n, n) array
        Factor of the noise.
    z : (k,) array
        In standard deviations.
    stress : (n,) array
        At all rows of the protocol, fitted or not [Pa].
    columns : (n, k) array
        Change with each coefficient.
    scale : float
        Of the noise.
    log_density : float
        Of the fitted rows at this scale, with the scale's log probability.
    """

    forward: Forward
    assumed: tuple[Component, ...]
    unknown: Floats
    rows: Bools
    noise: Floats
    z: Floats
    stress: Floats
    columns: Floats
    scale: float
    log_density: float

    @property
    def names(self) -> frozenset[str]:
        """Of its causes, what has no name among them."""
        names = frozenset(one.effect.name for one in self.assumed)
        return names | {UNKNOWN} if self.unknown.shape[1] else names

    @cached_property
    def residual(self) -> Floats:
        """Observed less computed (n,) with all coefficients at zero, to first order [Pa]."""
        return self.forward.protocol.observed - self.stress + self.columns @ self.z

    @cached_property
    def model(self) -> GaussianModel:
        """Of the residual at the fitted rows."""
        return _model(self.noise, self.rows, self.unknown, self.columns, self.scale)

    @cached_property
    def covariance(self) -> Floats:
        """Of the coefficients (k, k)."""
        return self.model.coefficients(self.residual[self.rows])[1][self.unknown.shape[1] :, self.unknown.shape[1] :]

    def refitted_to(self, rows: Bools) -> Fit:
        """The same causes fitted to other rows (n,), with its noise and glued ends; itself where no fit stands."""
        fitting = Fitting(self.noise, rows)
        try:
            return fitting.once(self.forward, self.assumed, self.unknown, self.z, self.scale)
        except CANNOT_BE:
            return self

    def part(self, number: int) -> slice:
        """Coefficients of one of the causes."""
        first = len(self.forward.nuisances) + sum(map(len, self.assumed[:number]))
        return slice(first, first + len(self.assumed[number]))


class Fitting:
    """Fits causes to some rows of tests.

    Parameters
    ----------
    noise : (n, n) array
        Factor of the noise, see `noise_factor`.
    rows : (n,) bool array
        That are fitted.
    """

    def __init__(self, noise: Floats, rows: Bools) -> None:
        self.noise, self.rows = noise, rows

    def fit(
        self, forward: Forward, assumed: tuple[Component, ...], unknown: Floats, z: Floats, scale: float
    ) -> Fit | None:
        """A fit whose noise and glued ends are those that it was made with; None if none stands.

        Parameters
        ----------
        forward : Forward
        assumed : tuple of Component
        unknown : (n, q) array
        z : (k,) array
            Where it begins.
        scale : float
            Of the noise to begin with.
        """
        found = None
        for _ in range(_SETTLING):
            try:
                again = self.once(forward, assumed, unknown, z, scale)
                law = forward.material(assumed, again.z)
            except CANNOT_BE:
                return found
            moved = forward.of(law=law) if forward.glued else forward
            ends = float(np.abs(moved.declared.glued - forward.declared.glued).max())
            settled = again.scale == scale and ends <= _SAME
            found = again
            if settled:
                break
            z, scale = again.z, again.scale
            forward = moved if ends > _SAME else forward
        return found

    def once(self, forward: Forward, assumed: tuple[Component, ...], unknown: Floats, z: Floats, scale: float) -> Fit:
        """A fit with one scale of the noise and the glued ends of one law; raises one of `CANNOT_BE` if none stands."""
        from scipy.optimize import least_squares

        rows, observed = self.rows, forward.protocol.observed
        white = GaussianModel(self.noise[np.ix_(rows, rows)], unknown[rows], scale).standardised

        def residuals(at: Floats) -> Floats:
            try:
                with np.errstate(all="ignore"):
                    return np.concatenate([white((observed - forward.stress(assumed, at))[rows]), at])
            except CANNOT_BE:
                # the step is shortened
                return np.full(np.count_nonzero(rows) + len(at), np.nan)

        def slopes(at: Floats) -> Floats:
            with np.errstate(all="ignore"):
                tangent = forward.tangent(assumed, at, forward.stress(assumed, at))
            return np.concatenate([-white(tangent[rows]), np.eye(len(at))])

        z = least_squares(residuals, z, slopes, ftol=_DONE, xtol=_DONE, gtol=None, max_nfev=_STEPS).x
        stress = forward.stress(assumed, z)
        columns = forward.tangent(assumed, z, stress)
        residual = (observed - stress + columns @ z)[rows]
        each = []
        for kappa, log_prior in zip(*(values.tolist() for values in scales()), strict=True):
            model = _model(self.noise, rows, unknown, columns, kappa)
            each.append(log_prior + float(model.log_density(residual)) - _beyond(model, residual, z, unknown.shape[1]))
        best = int(np.argmax(each))
        kappa = float(scales()[0][best])
        return Fit(forward, assumed, unknown, rows, self.noise, z, stress, columns, kappa, each[best])


def _model(noise: Floats, rows: Bools, unknown: Floats, columns: Floats, scale: float) -> GaussianModel:
    return GaussianModel(noise[np.ix_(rows, rows)], np.column_stack([unknown, columns])[rows], scale)


def _beyond(model: GaussianModel, residual: Floats, z: Floats, first: int) -> float:
    """What the linear model promises beyond `z` [nats]: at a limit of a parameter there is no such better point."""
    mean, covariance = model.coefficients(residual)
    away = z - mean[first:]
    precision = np.linalg.inv(covariance[first:, first:])
    return float(0.5 * away @ precision @ away)
