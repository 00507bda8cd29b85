"""The tables of an estimate of tissue, as printed."""

from __future__ import annotations

import math

import numpy as np

from warpbrain.estimation.parameters import Parameter
from warpbrain.estimation.posterior import Posterior
from warpbrain.estimation.prediction import Prediction
from warpbrain.inference.probability import percent
from warpbrain.physics.words import tabled
from warpbrain.report.comparison import SHOWN
from warpbrain.report.estimate import describe_discretisation, describe_registration, noise_of, remarks_of
from warpbrain.report.files import MILLIMETRES
from warpbrain.worlds.body.averaged_tissue import AveragedTissue

#: Causes that are less probable are not printed.
_LIKELY = 0.05


def estimate_lines(posterior: Posterior, averaged: AveragedTissue | None = None) -> list[str]:
    """The tables, as printed; with tissue averaged over what may act, if that is known."""
    lines = [*posterior.identifiability.sentences, ""]
    lines.append(
        "tissue             parameter         estimate       sd   95 % interval         prior 95 %         shrinkage"
    )
    for marginal in posterior.marginals:
        parameter = marginal.parameter
        row = _row(parameter, marginal.estimate, marginal.deviation, marginal.interval)
        prior = _interval(parameter, marginal.prior_interval)
        lines.append(f"{row}   {prior:<16} {100 * marginal.shrinkage:>7.0f} %  {'Pa' if parameter.is_modulus else ''}")
    if averaged is not None:
        lines += averaged_lines(averaged)
    lines += _check_lines(posterior)
    lines += ["", "RMSE at recordings      count   before    after    noise   in 50 %   in 95 %   gross errors"]
    lines += [_prediction_line(one) for one in posterior.predictions]
    for one in posterior.overall_errors:
        name = "all that was fitted" if one.role == "fit" else "all to check"
        before, after, of_run = (MILLIMETRES * value for value in (one.before, one.after, one.of_run))
        lines.append(
            f"  {name:<19} {one.count:>7} {tabled(before):>8} {tabled(after):>8}   mm; "
            f"by `warpbrain run` of this tissue {tabled(of_run)}"
        )
    lines += [f"  remark    {remark}" for remark in remarks_of(posterior)]
    lines += ["", "time [s]   " + ", ".join(f"{stage} {spent:.1f}" for stage, spent in posterior.seconds.items())]
    lines.append("equilibria " + ", ".join(f"{stage} {count}" for stage, count in posterior.solves.items()))
    return lines


def _row(parameter: Parameter, estimate: float, deviation: float, interval: tuple[float, float]) -> str:
    """Of a parameter by its coordinate, as people read it."""
    if parameter.is_modulus:
        estimate = math.exp(estimate)
        deviation *= estimate
    return (
        f"  {parameter.tissue:<16.16} {'shear modulus' if parameter.is_modulus else parameter.coordinate.name:<15} "
        f"{_number(estimate):>9} {_number(deviation):>8}   {_interval(parameter, interval):<19}"
    )


def _interval(parameter: Parameter, interval: tuple[float, float]) -> str:
    low, high = (math.exp(end) if parameter.is_modulus else end for end in interval)
    return f"{_number(low)} to {_number(high)}"


def averaged_lines(averaged: AveragedTissue) -> list[str]:
    """How probable it is that nothing else acts; tissue averaged where anything else is more probable than that."""
    likely = [f"{one.name} {percent(one.probability)}" for one in averaged.causes if one.probability >= _LIKELY]
    lines = [f"  probability that nothing acts but what the case says: {percent(averaged.nothing)}"]
    # a probability of nothing has no bar of its own: how many sets it shares one with depends on the case
    if averaged.nothing < averaged.probabilities.max():
        lines += [f"  what may act: {', '.join(likely)}", "  tissue averaged over what may act, to first order:"]
        deviations = np.sqrt(np.diag(averaged.covariance)).tolist()
        each = zip(averaged.parameters, averaged.mean, deviations, averaged.interval(0.95), strict=True)
        for parameter, mean, deviation, (low, high) in each:
            row = _row(parameter, mean, deviation, (low, high))
            lines.append(f"{row} {'':<29}  {'Pa' if parameter.is_modulus else ''}")
    return [line.rstrip() for line in lines]


def _prediction_line(one: Prediction) -> str:
    factor, unit = SHOWN[one.unit]
    noise = noise_of(one)
    within = ["", ""] if one.coverage is None else [f"{100 * part:.0f} %" for part in one.coverage]
    before, after = factor * one.error_before, factor * one.error_after
    return (
        f"  {one.name:<18.18} {one.fitted.count:>8} {tabled(before):>8} {tabled(after):>8} "
        f"{'' if noise is None else tabled(noise):>8} {within[0]:>9} {within[1]:>9} {int(one.gross.sum()):>9}"
        f"      {unit}" + (", check" if one.role == "check" else "")
    )


def _check_lines(posterior: Posterior) -> list[str]:
    names, matrix, importance = posterior.parameters.names, posterior.correlation, posterior.importance
    lines = [
        f"  correlation of {names[i]} and {names[j]}: {matrix[i, j]:.2f}"
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) >= 0.3
    ]
    lines.append(
        f"  {posterior.method}: Pareto k {importance.smoothed.k:.2f} of {len(importance.theta)} weighted draws "
        f"({importance.smoothed.effective:.0f} effective; without equilibrium: {importance.failed}, "
        f"unstable laws: {importance.unstable})"
    )
    lines += [f"  Laplace fails: {doubt}" for doubt in posterior.doubts]
    if posterior.chain is not None:
        chain = posterior.chain
        lines.append(
            f"  chain of {chain.solves} equilibria, {100 * chain.accepted:.0f} % accepted, worth "
            f"{chain.effective.min():.0f} independent draws"
        )
    lines.append(f"  noise: {posterior.best.point.noise.scale:.2f} times as large as declared")
    mesh, registration = describe_discretisation(posterior), describe_registration(posterior)
    if mesh is not None:
        lines.append(
            f"  error of the mesh: {mesh['amount']:.2f} +- {mesh['standard_deviation']:.2f} times what elements of "
            f"half the size change, {tabled(mesh['difference_root_mean_square_mm'])} mm root mean square"
        )
    if registration is not None:
        shift = ", ".join(f"{value:.2f}" for value in registration["shift_mm"])
        turn = ", ".join(f"{value:.2f}" for value in registration["turn_degrees"])
        lines.append(f"  registration: shifted by ({shift}) mm, turned by ({turn}) degrees")
    return lines


def _number(value: float) -> str:
    """Four digits, as a person writes them."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
