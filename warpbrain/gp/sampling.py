"""Laws that the literature makes likely: curves of a generative model, the laws fitted to them, and their moduli."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.literature.study import OFFSET, STRETCHES
from warpbrain.gp.metamodels import METAMODELS, Fit, MetaModel, fit, unstable
from warpbrain.gp.process import Process

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law

#: Stretches of a curve that is fitted, as in the paper.
POINTS = 101
#: Added to the energy of a law before its logarithm is compared with a curve [Pa], as in the paper.
FIT_OFFSET = 1e-3
#: Attempts at one draw, the first included: where this many are unstable the law and the literature do not go together.
ATTEMPTS = 200
#: Curves whose laws are told: this many standard deviations from the mean.
CURVES = (-2.0, 0.0, 2.0)


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

    Nothing is redrawn here: `warpbrain.gp.metamodels.unstable` says what the law is worth. `InputError` if the model
    has seen no study of the group, or there is no such law.

    Examples
    --------
    >>> from warpbrain.gp.trained import trained
    >>> law_of_curve(trained(), "hyperelastic/brain").shear_modulus > 400.0
    True
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
    metamodels = [_metamodel(name) for name in _one_each(law, groups)]
    formulations = _one_each(formulation, groups)
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
        reason = ""
        for group, metamodel, shape in zip(groups, metamodels, formulations, strict=True):
            fits.append(_fit(model, metamodel, ranges[group], curves[group]))
            reason = unstable(fits[-1], poisson, shape)
            if reason:
                rejected.append(f"{group}: {reason}")
                break
        if not reason:
            drawn_at, drawn_curves = (tuple(of[group] for group in groups) for of in (ranges, curves))
            return DrawnLaws(number, seed, tuple(groups), drawn_at, drawn_curves, tuple(fits), tuple(rejected))
    raise SolveError(
        f"draw {number} of seed {seed}: all of {ATTEMPTS} attempts are unstable at the Poisson ratio {poisson:g}, "
        f"the last one: {rejected[-1]}"
    )


def draw_many(
    model: Process,
    groups: Sequence[str],
    law: str | Sequence[str],
    count: int,
    seed: int = 0,
    poisson: float = 0.45,
    formulation: str | Sequence[str] = "coupled",
) -> Iterator[DrawnLaws]:
    """Draws 0 to `count` - 1, see `draw_laws`."""
    for number in range(count):
        yield draw_laws(model, groups, law, number, seed, poisson, formulation)


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
    """Fit a law to the curves of a group, and to stable draws of it; errors are those of `draw_laws`.

    Examples
    --------
    >>> from warpbrain.gp.trained import trained
    >>> brain = moduli(trained(), "hyperelastic/brain", "neo-hookean", draws=40)
    >>> brain.low < brain.median < brain.high
    True
    """
    fits = tuple(law_of_curve(model, group, k, law) for k in CURVES)
    drawn = list(draw_many(model, [group], law, draws, seed, poisson))
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


def _one_each(value: str | Sequence[str], groups: Sequence[str]) -> list[str]:
    return [value] * len(groups) if isinstance(value, str) else list(value)
