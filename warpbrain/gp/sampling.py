"""Laws that the literature makes likely: curves of a generative model, the laws fitted to them, and their moduli.

A curve is a logarithm of energy. Least squares against it of a meta-model, a law of few parameters on the
incompressible uniaxial path (supplement 2.2 and 2.3),

    minimise 1/2 sum_i r_i^2,    r_i = ln(Psi(l_i) + d) - y_i,    dr_i/dtheta = dPsi/dtheta / (Psi + d)

with `d` = 1e-3 Pa go over the boxes of the meta-model, in the logarithms of the parameters: they are positive or
negative throughout a box, and of any order of magnitude. That changes the way, not the optimum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.literature import forms
from warpbrain.gp.literature.study import OFFSET, STRETCHES, invariant
from warpbrain.gp.process import Process

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law

#: Largest `|alpha|` that is searched. The paper has two settings: 5, and boxes to 5, 10, 20 and 50.
FARTHEST = 50.0
#: Smallest `|alpha|` that is positive or negative: between them laws are unstable (-2 to 1, the paper allows 0.1).
_POSITIVE, _NEGATIVE = 0.1, 2.1
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

Values = Sequence[float] | Floats


@dataclass(frozen=True)
class Box:
    """Bounds of the parameters, each of one sign and infinite where there is none, and where a search starts."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    start: tuple[float, ...]


@dataclass(frozen=True)
class MetaModel:
    """A law of few parameters on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)` (supplement eq. (2)).

    By itself one that is linear in its parameters, `Psi = sum_i values_i basis_i(l)`, all of them positive moduli.
    """

    name: str  # of its law, as in `warpbrain.physics.laws.LAWS`
    parameter_names: tuple[str, ...]
    units: tuple[str, ...]  # of the parameters: "Pa", or "" for a number without unit
    basis: tuple[Callable[[Floats], Floats], ...] = ()
    least: float = 0.1  # [Pa], of the parameters of a fit

    def energy(self, stretches: Floats, values: Values) -> Floats:
        """Strain energy `Psi` [Pa] at stretches `l` > 0 of shape (n,), good to all digits near `l = 1`; (n,)."""
        return np.asarray(sum(value * psi(stretches) for value, psi in zip(values, self.basis, strict=True)))

    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        """Its derivatives by the parameters, (n, p): the numerators of supplement eq. (3)."""
        return np.stack([psi(stretches) for psi in self.basis], axis=1)

    def boxes(self, limit: float = FARTHEST) -> tuple[Box, ...]:
        """Boxes whose best optimum is the fit, with exponents up to a limit."""
        size = len(self.basis)
        return (Box((self.least,) * size, (math.inf,) * size, (1000.0,) * size),)

    def law(self, values: Values) -> Law:
        """The law that a simulation takes; `InputError` if there is none, as with a modulus that is not positive."""
        from warpbrain.physics.laws import LAWS

        kind: Any = LAWS[self.name]
        return kind(*map(float, values))


class _Ogden(MetaModel):
    """One term `Psi = mu/alpha (l^alpha + 2 l^(-alpha/2) - 3)`, `mu` and `alpha` of the same sign."""

    def energy(self, stretches: Floats, values: Values) -> Floats:
        mu, alpha = values
        return mu / alpha * self._bracket(alpha * np.log(stretches))

    def jacobian(self, stretches: Floats, values: Values) -> Floats:
        mu, alpha = values
        power = alpha * np.log(stretches)
        bracket = self._bracket(power)
        # d(l^alpha + 2 l^(-alpha/2))/dalpha = ln l (l^alpha - l^(-alpha/2))
        by_alpha = mu / alpha**2 * (power * (np.expm1(power) - np.expm1(-0.5 * power)) - bracket)
        return np.stack([bracket / alpha, by_alpha], axis=1)

    @staticmethod
    def _bracket(power: Floats) -> Floats:
        """`e^x + 2 e^(-x/2) - 3`: with `q = e^(x/2)` it is `(q - 1)^2 (1 + 2/q)`, which has all its digits near 0."""
        return np.expm1(0.5 * power) ** 2 * (1.0 + 2.0 * np.exp(-0.5 * power))

    def boxes(self, limit: float = FARTHEST) -> tuple[Box, ...]:
        """Exponents of either sign, each searched from its smallest and from its largest.

        All boxes of the paper have the start of the smallest exponent, and the last of them holds the others. A curve
        can have two optima in positive exponents (Schiavone 2009: 0.1 and 12.2), and then all searches of the paper may
        end in the worse one: in one of 300 curves, of which searches from both ends missed none.
        """
        return (
            *(Box((0.1, _POSITIVE), (math.inf, limit), (1000.0, alpha)) for alpha in (_POSITIVE, limit)),
            *(Box((-math.inf, -limit), (-0.1, -_NEGATIVE), (-1000.0, -alpha)) for alpha in (_NEGATIVE, limit)),
        )

    def law(self, values: Values) -> Law:
        from warpbrain.physics.laws import Ogden

        mu, alpha = values
        return Ogden((float(mu),), (float(alpha),))


#: Meta-models by the name of their law.
METAMODELS: dict[str, MetaModel] = {
    model.name: model
    for model in (
        MetaModel("neo-hookean", ("mu",), ("Pa",), (invariant,), least=1e-3),
        MetaModel("mooney-rivlin", ("C1", "C2"), ("Pa", "Pa"), (forms.first, forms.second)),
        _Ogden("ogden", ("mu", "alpha"), ("Pa", "")),
    )
}


@dataclass(frozen=True)
class Fit:
    """A meta-model that was fitted to a curve."""

    model: MetaModel
    values: tuple[float, ...]
    cost: float  # half the sum of the squared residuals
    points: int
    converged: bool  # the search ended where the cost is stationary in all directions that the bounds leave open
    message: str  # why it ended
    at_bound: tuple[str, ...] = ()  # names of the parameters that lie at a bound

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in log units."""
        return float(np.sqrt(2.0 * self.cost / self.points))

    @property
    def shear_modulus(self) -> float:
        """Shear modulus at rest `mu0` [Pa]."""
        return self.law().shear_modulus

    def law(self) -> Law:
        return self.model.law(self.values)


def fit(
    model: MetaModel, stretches: ArrayLike, log_energy: ArrayLike, limit: float = FARTHEST, offset: float = 1e-3
) -> Fit:
    """Fit a meta-model to a curve of stretches `l` (n,), in any order, and log energies `y` (n,): the best optimum in
    all its boxes, `converged` False if no parameters come near to it.

    `limit` is the largest size of an exponent, `offset` is `d` [Pa]. `InputError` if the arrays are not finite, of
    different lengths or shorter than the parameters, a stretch is not between 1e-3 and 1e3, or the offset is not
    positive.
    """
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
    if not (np.isfinite(offset) and offset > 0.0):
        raise InputError(f"offset = {offset:g} Pa: expected a positive number")
    with np.errstate(over="ignore", invalid="ignore"):
        return min((_search(model, box, l, y, offset) for box in model.boxes(limit)), key=attrgetter("cost"))


def _search(model: MetaModel, box: Box, l: Floats, y: Floats, offset: float) -> Fit:
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
        return Fit(model, box.start, np.inf, len(y), False, "the residuals are too large for a sum of squares")
    bounds = np.log(nearest), np.log(np.where(bounded, farthest, _LARGEST))
    # the variant for which a bound can be reached in a step, so that parameters lie at it and not near it
    tolerances = {"ftol": _TOLERANCE, "xtol": _TOLERANCE, "gtol": None, "max_nfev": _EVALUATIONS}
    result = least_squares(residual, start, jacobian, bounds=bounds, method="dogbox", **tolerances)
    held = (result.active_mask < 0) | (result.active_mask > 0) & bounded
    sizes = np.where(held, np.where(result.active_mask > 0, farthest, nearest), np.exp(result.x))
    # the residual stands upright on every direction that is not held at a bound
    least = max(_STATIONARY * float(np.linalg.norm(result.fun)), _EXACT * np.sqrt(len(y)))
    upright = np.abs(result.fun @ result.jac) <= least * np.linalg.norm(result.jac, axis=0)
    stationary = bool(np.all(upright | held))
    return Fit(
        model,
        tuple((signs * sizes).tolist()),
        float(result.cost),
        len(y),
        bool(result.success) and stationary,
        result.message if stationary or not result.success else "ended where the cost still falls",
        tuple(name for name, at in zip(model.parameter_names, held, strict=True) if at),
    )


def unstable(fit: Fit, poisson: float = 0.45, formulation: str = "coupled") -> str:
    """Why a fit cannot be computed with, by the supplement's Table 2: the message of `require_stable`, or of the law if
    it is none; empty if it can.

    `InputError` if the Poisson ratio at rest is outside (-1, 0.5) or the formulation is unknown.
    """
    from warpbrain.physics.laws.stability import UnstableLawError, require_stable

    try:
        law = fit.law()
    except InputError as error:
        return str(error)
    try:
        require_stable(law, poisson, formulation)
    except UnstableLawError as error:
        return str(error)
    return ""


#: Stretches of a curve that is fitted, as in the paper.
POINTS = 101
#: Added to the energy of a law before its logarithm is compared with a curve [Pa], as in the paper.
FIT_OFFSET = 1e-3
#: Attempts at one draw, the first included: where this many are unstable the law and the literature do not go together.
ATTEMPTS = 200
#: Curves whose laws are told: this many standard deviations from the mean.
CURVES = (-2.0, 0.0, 2.0)
#: Standard deviations from the mean curve that the paper's sweep takes, for each tissue.
SWEEP = tuple(np.linspace(-2.0, 2.0, 17).tolist())


@dataclass(frozen=True)
class DrawnLaws:
    """Draw `number` of a seed of the laws of several tissues."""

    number: int
    seed: int
    groups: tuple[str, ...]  # one for each tissue; tissues of one group are of one curve
    stretches: tuple[Floats, ...]  # (n,) of each tissue
    curves: tuple[Floats, ...]  # what was drawn there, `y = ln(Psi + 1e-4)`
    fits: tuple[Fit, ...]  # the law nearest to each curve
    rejected: tuple[str, ...]  # why each attempt before this one was redrawn

    @property
    def laws(self) -> tuple[Law, ...]:
        """One for each tissue."""
        return tuple(fitted.law() for fitted in self.fits)

    @property
    def shear_moduli(self) -> Floats:
        """At rest [Pa], one for each tissue."""
        return np.array([fitted.shear_modulus for fitted in self.fits])


def usual_stretches(group: str) -> Floats:
    """Stretches (101,) on which the paper samples a group."""
    return np.linspace(*STRETCHES[group], POINTS)


def law_of_curve(model: Process, group: str, k: float = 0.0, law: str = "neo-hookean") -> Fit:
    """The law of the curve `k` standard deviations from the mean, as the paper samples.

    It may be `unstable`. `InputError` if the model has seen no study of the group, or there is no such law.
    """
    _require_seen(model, [group])
    stretches = usual_stretches(group)
    return _fit(model, _metamodel(law), stretches, model.curve(group, stretches, k))


@cache
def middle_law(group: str, law: str = "neo-hookean") -> Law:
    """The law of the middle curve of a group by the default model, see `law_of_curve`."""
    from warpbrain.gp.trained import trained

    return law_of_curve(trained(), group, law=law).law()


def draw_laws(
    model: Process,
    groups: Sequence[str],
    law: str | Sequence[str],
    number: int,
    seed: int = 0,
    poisson: float = 0.45,
    formulation: str | Sequence[str] = "coupled",
) -> DrawnLaws:
    """Draw `number` of the laws of tissues, joint over them; a draw of which one law is unstable is drawn again, whole.

    Parameters
    ----------
    model : Process
    groups : sequence of str
        One for each tissue. Tissues of one group get one curve: they are one tissue, in several parts.
    law : str or sequence of str
        Names of laws, one for all tissues or one for each.
    number, seed : int
        Whatever else is drawn, these give the same draw.
    poisson, formulation : float, str or sequence of str
        With which the laws are to be stable.

    Raises
    ------
    InputError
        If the model has seen no study of a group, there is no such law, or number or seed is negative.
    SolveError
        If `ATTEMPTS` attempts are all unstable.
    """
    _require_seen(model, groups)
    for name, value in (("number", number), ("seed", seed)):
        if value < 0:
            raise InputError(f"{name} {value}: expected a whole number of at least 0")
    laws, formulations = (
        [value] * len(groups) if isinstance(value, str) else list(value) for value in (law, formulation)
    )
    metamodels = [_metamodel(name) for name in laws]
    distinct = tuple(dict.fromkeys(groups))
    ranges = {group: usual_stretches(group) for group in distinct}
    # a draw is a function: groups of other ranges are the same draw where their ranges meet
    at = np.unique(np.concatenate(list(ranges.values())))
    places = {group: np.searchsorted(at, ranges[group]) for group in distinct}
    rejected: list[str] = []
    for attempt in range(ATTEMPTS):
        drawn = model.draw(distinct, at, (number, attempt) if attempt else number, seed)
        curves = {group: drawn[i, places[group]] for i, group in enumerate(distinct)}
        fits: list[Fit] = []
        for group, metamodel, shape in zip(groups, metamodels, formulations, strict=True):
            fits.append(_fit(model, metamodel, ranges[group], curves[group]))
            if reason := unstable(fits[-1], poisson, shape):
                rejected.append(f"{group}: {reason}")
                break
        else:
            drawn_at, drawn_curves = (tuple(of[group] for group in groups) for of in (ranges, curves))
            return DrawnLaws(number, seed, tuple(groups), drawn_at, drawn_curves, tuple(fits), tuple(rejected))
    raise SolveError(
        f"draw {number} of seed {seed}: all of {ATTEMPTS} attempts are unstable at the Poisson ratio {poisson:g}, "
        f"the last one: {rejected[-1]}"
    )


def rejection_rate(draws: Sequence[DrawnLaws]) -> float:
    """Part of all attempts at some draws that were unstable."""
    rejected = sum(len(draw.rejected) for draw in draws)
    return rejected / (rejected + len(draws)) if draws else 0.0


@dataclass(frozen=True)
class Moduli:
    """What a model says of the shear modulus [Pa] at rest of a group, through one law."""

    group: str
    law: str
    fits: tuple[Fit, ...]  # of the curves that lie `CURVES` standard deviations from the mean
    unstable: tuple[str, ...]  # why each of these is; empty if it is not
    median: float  # of stable draws
    low: float  # 2.5 % of them lie below
    high: float  # 97.5 %
    median_error: float  # relative standard error: the number of draws is finite
    draws: int
    rejection_rate: float  # part of the attempts that gave an unstable law


def moduli(model: Process, group: str, law: str, draws: int = 1000, seed: int = 0, poisson: float = 0.45) -> Moduli:
    """Fit a law to the curves of a group, and to stable draws of it; errors are those of `draw_laws`."""
    fits = tuple(law_of_curve(model, group, k, law) for k in CURVES)
    drawn = [draw_laws(model, [group], law, number, seed, poisson) for number in range(draws)]
    values = np.array([draw.shear_moduli[0] for draw in drawn])
    low, median, high = np.quantile(values, [0.025, 0.5, 0.975]).tolist()
    # of a normal distribution's median, in logarithms
    error = float(np.sqrt(0.5 * np.pi / draws) * np.log(values).std())
    reasons = tuple(unstable(fitted, poisson) for fitted in fits)
    return Moduli(group, law, fits, reasons, median, low, high, error, draws, rejection_rate(drawn))


def _fit(model: Process, metamodel: MetaModel, stretches: Floats, curve: Floats) -> Fit:
    """The law nearest to a curve `y = ln(Psi + 1e-4)`, in the least squares of `ln(Psi + 1e-3)`.

    The paper takes 1e-4 where it trains and 1e-3 where it fits, and compares the two. Its process is fitted so here
    too: its curves are smooth near rest, where `y` has a cusp, and there need not be an energy of which they are the
    logarithm. Curves of other models are energies, and are compared as such: both sides with 1e-3.
    """
    if model.name != "coregionalised":
        curve = np.log(np.maximum(np.exp(curve) - OFFSET, 0.0) + FIT_OFFSET)
    return fit(metamodel, stretches, curve, offset=FIT_OFFSET)


def _require_seen(model: Process, groups: Sequence[str]) -> None:
    for group in groups:
        if group not in model.groups:
            raise InputError(
                f"group '{group}': the generative model '{model.name}' ({model.variant}) has seen no study of it; "
                f"it has {', '.join(model.groups)}"
            )


def _metamodel(law: str) -> MetaModel:
    if law not in METAMODELS:
        raise InputError(f"law '{law}': expected one of {', '.join(METAMODELS)}")
    return METAMODELS[law]
