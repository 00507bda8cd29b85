"""Fits causes to tests without linearising, and says how probable they then are: Laplace's approximation.

Damped least squares (`scipy.optimize.least_squares`) of rows and coefficients to the most probable coefficients. About
them the rows are a `GaussianModel`, whose log density is the evidence; the scale of the noise is the most probable one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.noise import scales
from warpbrain.worlds.specimen.effects import Effect
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
    """Causes at their most probable coefficients `z` (k,), in standard deviations, after some of the `rows` (n,).

    `stress` (n,) [Pa] and its change `columns` (n, k) with each coefficient are of all rows of the protocol, fitted or
    not; `log_density` is of the fitted ones at this `scale` of the noise, with the scale's log probability.
    """

    forward: Forward
    assumed: tuple[Component, ...]
    rows: Bools
    z: Floats
    stress: Floats
    columns: Floats
    scale: float
    log_density: float

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(component.effect.name for component in self.assumed)

    @cached_property
    def residual(self) -> Floats:
        """Observed less computed (n,) with all coefficients at zero, to first order [Pa]."""
        return self.forward.protocol.observed - self.stress + self.columns @ self.z

    @cached_property
    def model(self) -> GaussianModel:
        """Of the residual at the fitted rows."""
        return GaussianModel(self.forward.noise[np.ix_(self.rows, self.rows)], self.columns[self.rows], self.scale)

    @cached_property
    def covariance(self) -> Floats:
        """Of the coefficients (k, k)."""
        return self.model.coefficients(self.residual[self.rows])[1]

    def refitted_to(self, rows: Bools) -> Fit:
        """The same causes fitted to other rows (n,), with its noise and glued ends; itself where no fit stands."""
        try:
            return _fit(self.forward, self.assumed, self.z, self.scale, rows)
        except CANNOT_BE:
            return self

    def part(self, number: int) -> slice:
        """Coefficients of one of the causes."""
        first = len(self.forward) + sum(map(len, self.assumed[:number]))
        return slice(first, first + len(self.assumed[number]))

    def only(self, kept: Callable[[Effect], bool]) -> tuple[tuple[Component, ...], Floats]:
        """Some of its causes, and their coefficients (k,)."""
        numbers = [k for k, component in enumerate(self.assumed) if kept(component.effect)]
        z = np.concatenate([np.zeros(0), *(self.z[self.part(k)] for k in numbers)])
        return tuple(self.assumed[k] for k in numbers), z


def fit(forward: Forward, assumed: tuple[Component, ...], z: Floats, scale: float = 1.0) -> Fit | None:
    """Fit causes to all rows that may be fitted, from coefficients (k,) and a scale of the noise; None if none stands.

    The noise and the glued ends are those of what is arrived at.
    """
    settled = None
    for _ in range(_SETTLING):
        try:
            again = _fit(forward, assumed, z, scale, forward.protocol.fitted)
            law = forward.material(assumed, again.z)
        except CANNOT_BE:
            return settled
        moved = forward.of(law=law) if forward.glued else forward
        same_ends = float(np.abs(moved.factor - forward.factor).max()) <= _SAME
        settled = again
        if again.scale == scale and same_ends:
            break
        z, scale = again.z, again.scale
        forward = forward if same_ends else moved
    return settled


def _fit(forward: Forward, assumed: tuple[Component, ...], z: Floats, scale: float, rows: Bools) -> Fit:
    """A fit with one scale of the noise and the glued ends of one law; raises one of `CANNOT_BE` if none stands."""
    from scipy.optimize import least_squares

    observed = forward.protocol.observed
    # what only adds stress is linear: it is integrated out while all else is searched for
    adds, added = forward.adding(assumed)
    noise = GaussianModel(forward.noise[np.ix_(rows, rows)], added[rows], scale)

    def whole(at: Floats) -> Floats:
        z = np.zeros(len(adds))
        z[~adds] = at
        return z

    def residuals(at: Floats) -> Floats:
        try:
            with np.errstate(all="ignore"):
                left = observed - forward.stress(assumed, whole(at))
                return np.concatenate([noise.standardised(left[rows]), at])
        except CANNOT_BE:
            # the step is shortened
            return np.full(np.count_nonzero(rows) + len(at), np.nan)

    def slopes(at: Floats) -> Floats:
        with np.errstate(all="ignore"):
            tangent = forward.tangent(assumed, whole(at), forward.stress(assumed, whole(at)))
        return np.concatenate([-noise.standardised(tangent[rows][:, ~adds]), np.eye(len(at))])

    at = least_squares(residuals, z[~adds], slopes, ftol=_DONE, xtol=_DONE, gtol=None, max_nfev=_STEPS).x
    z = whole(at)
    z[adds] = noise.coefficients((observed - forward.stress(assumed, z))[rows])[0]
    stress = forward.stress(assumed, z)
    columns = forward.tangent(assumed, z, stress)
    residual = (observed - stress + columns @ z)[rows]
    model = noise.of_noise(columns[rows])
    values, logs = scales()
    each = []
    for kappa, log_prior in zip(values.tolist(), logs.tolist(), strict=True):
        at_scale = model.with_scale(kappa)
        each.append(log_prior + float(at_scale.log_density(residual)) - _beyond(at_scale, residual, z))
    best = int(np.argmax(each))
    return Fit(forward, assumed, rows, z, stress, columns, float(values[best]), each[best])


def _beyond(model: GaussianModel, residual: Floats, z: Floats) -> float:
    """What the linear model promises beyond `z` [nats]: at a limit of a parameter there is no such better point."""
    mean, covariance = model.coefficients(residual)
    return float(0.5 * (z - mean) @ np.linalg.solve(covariance, z - mean))
