"""Least squares of a meta-model against a curve of log energy (supplement 2.3).

    minimise 1/2 sum_i r_i^2,    r_i = ln(Psi(l_i) + d) - y_i,    dr_i/dtheta = dPsi/dtheta / (Psi + d)

with `d` = 1e-3 Pa, over the boxes of the meta-model. The search goes in the logarithms of the parameters: they are
positive or negative throughout a box, and of any order of magnitude. That changes the way, not the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.errors import InputError
from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.metamodels.box import SEARCHES, Box
from warpbrain.gp.metamodels.meta_model import MetaModel

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law

#: Relative change of cost and of parameters at which a search ends.
_TOLERANCE = 1e-12
#: Cosine between the residual and a direction, below which the cost is stationary in it (as MINPACK's `gtol`).
_STATIONARY = 1e-4
#: Residual [log units] that counts as none.
_EXACT = 1e-9
_EVALUATIONS = 500
#: Stretches that a curve can have, and the largest modulus [Pa] that is tried: energies stay finite.
_STRETCHES = (1e-3, 1e3)
_LARGEST = 1e30


@dataclass(frozen=True)
class Fit:
    """A meta-model that was fitted to a curve.

    Attributes
    ----------
    model : MetaModel
    values : tuple of float
        Its parameters.
    cost : float
        Half the sum of the squared residuals.
    points : int
        Number of residuals.
    converged : bool
        Whether the search ended where the cost is stationary in all directions that the bounds leave open.
    message : str
        Why it ended.
    evaluations : int
        Of the energies, in all boxes together.
    at_bound : tuple of str
        Names of the parameters that lie at a bound.
    """

    model: MetaModel
    values: tuple[float, ...]
    cost: float
    points: int
    converged: bool
    message: str
    evaluations: int
    at_bound: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in log units."""
        return float(np.sqrt(2.0 * self.cost / self.points))

    @property
    def shear_modulus(self) -> float:
        """Shear modulus at rest `mu0` [Pa]."""
        return self.model.shear_modulus(self.values)

    def law(self) -> Law:
        """The law that a simulation takes."""
        return self.model.law(self.values)


def fit(
    model: MetaModel, stretches: ArrayLike, log_energy: ArrayLike, search: str = "high", offset: float = 1e-3
) -> Fit:
    """Fit a meta-model to a curve: the best optimum in all its boxes.

    Parameters
    ----------
    model : MetaModel
        One of `METAMODELS`.
    stretches : (n,) array
        `l` > 0, in any order.
    log_energy : (n,) array
        `y`, the logarithm of energies in Pa.
    search : str
        One of `SEARCHES`: how far exponents are searched.
    offset : float
        `d` [Pa], positive.

    Returns
    -------
    Fit
        With `converged` False if the curve is one that no parameters come near to.

    Raises
    ------
    InputError
        If the arrays are not finite, of different lengths or shorter than the parameters, a stretch is not between
        1e-3 and 1e3, the offset is not positive, or the search is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from warpbrain.gp.metamodels.models import METAMODELS
    >>> l = np.linspace(0.9, 1.1, 101)
    >>> y = np.log(300.0 * (l**2 + 2.0 / l - 3.0) + 1e-3)
    >>> round(fit(METAMODELS["neo-hookean"], l, y).shear_modulus, 6)
    600.0
    """
    l, y = _curve(model, stretches, log_energy)
    if search not in SEARCHES:
        raise InputError(f"search = {search!r}: expected one of {', '.join(SEARCHES)}")
    if not (np.isfinite(offset) and offset > 0.0):
        raise InputError(f"offset = {offset:g} Pa: expected a positive number")
    with np.errstate(over="ignore", invalid="ignore"):
        found = [_search(model, box, l, y, offset) for box in model.boxes(search)]
    best = min(found, key=lambda one: one.cost)
    return replace(best, evaluations=sum(one.evaluations for one in found))


def _curve(model: MetaModel, stretches: ArrayLike, log_energy: ArrayLike) -> tuple[Floats, Floats]:
    l, y = np.asarray(stretches, dtype=np.float64), np.asarray(log_energy, dtype=np.float64)
    if l.ndim != 1 or l.shape != y.shape:
        raise InputError(f"expected as many stretches as log energies, in a row: found shapes {l.shape} and {y.shape}")
    if len(l) < len(model.parameter_names):
        raise InputError(f"{len(l)} points: {model.name} needs at least {len(model.parameter_names)}")
    low, high = _STRETCHES
    for name, values, good, expected in (
        ("stretch", l, (low <= l) & (l <= high), f"a number from {low:g} to {high:g}"),
        ("log energy", y, np.isfinite(y), "a finite number"),
    ):
        if not good.all():
            at = int(np.argmin(good))
            raise InputError(f"{name} {at} is {values[at]:g}: expected {expected}")
    return l, y


def _search(model: MetaModel, box: Box, l: Floats, y: Floats, offset: float) -> Fit:
    """Search one box from its start."""
    from scipy.optimize import least_squares

    signs = np.sign(box.start)
    nearest, farthest = np.sort(np.abs([box.lower, box.upper]), axis=0)
    bounded = np.isfinite(farthest)

    def residual(logs: Floats) -> Floats:
        return np.log(model.energy(l, signs * np.exp(logs)) + offset) - y

    def jacobian(logs: Floats) -> Floats:
        values = signs * np.exp(logs)
        return model.jacobian(l, values) * values / (model.energy(l, values) + offset)[:, None]

    start = np.log(np.abs(box.start))
    if not np.isfinite(np.sum(residual(start) ** 2)):
        return Fit(model, box.start, np.inf, len(y), False, "the residuals are too large for a sum of squares", 1)
    # the variant for which a bound can be reached in a step, so that parameters lie at it and not near it
    result = least_squares(
        residual,
        start,
        jacobian,
        bounds=(np.log(nearest), np.log(np.where(bounded, farthest, _LARGEST))),
        method="dogbox",
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=None,
        max_nfev=_EVALUATIONS,
    )
    held = (result.active_mask < 0) | (result.active_mask > 0) & bounded
    sizes = np.where(held, np.where(result.active_mask > 0, farthest, nearest), np.exp(result.x))
    stationary = _is_stationary(result.jac, result.fun, held)
    return Fit(
        model,
        tuple(float(value) for value in signs * sizes),
        float(result.cost),
        len(y),
        bool(result.success) and stationary,
        result.message if stationary or not result.success else "ended where the cost still falls",
        int(result.nfev),
        tuple(name for name, at in zip(model.parameter_names, held, strict=True) if at),
    )


def _is_stationary(jacobian: Floats, residual: Floats, held: NDArray[np.bool_]) -> bool:
    """Whether the residual stands upright on every direction that is not held at a bound."""
    size = max(_STATIONARY * float(np.linalg.norm(residual)), _EXACT * np.sqrt(len(residual)))
    return bool(np.all((np.abs(residual @ jacobian) <= size * np.linalg.norm(jacobian, axis=0)) | held))
