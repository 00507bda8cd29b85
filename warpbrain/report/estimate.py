"""An estimate of tissue: its JSON, and the tables that are printed, which are made from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from warpbrain.estimation.estimate import EstimationOptions
from warpbrain.estimation.laplace import Laplace
from warpbrain.estimation.posterior import Marginal, Posterior
from warpbrain.estimation.prediction import INTERVALS, Prediction
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.fingerprints import fingerprints
from warpbrain.report.summary import machine

#: Units as people read them: of a recording, the factor and the name.
SHOWN = {"m": (MILLIMETRES, "mm"), "N": (1.0, "N")}
#: More than this part of a recording being gross errors is said.
_UNEXPLAINED = 0.3


def describe_estimate(posterior: Posterior, options: EstimationOptions, device: str) -> dict[str, Any]:
    """Everything that is known of an estimate, with units in keys or beside the values; docs/estimation.md."""
    prior, parameters, case = posterior.prior, posterior.parameters, posterior.case
    said = posterior.identifiability
    gauss_newton = posterior.best.estimate
    return {
        "case": {"name": case.name, "title": case.title, "origin": case.origin, "assumptions": list(case.assumptions)},
        "inputs_sha256": fingerprints(case),
        "identifiability": {
            "nothing": said.nothing,
            "sentences": list(said.sentences),
            "informed": list(said.informed),
            "weakly_informed": list(said.weakly_informed),
            "hidden": list(said.hidden),
            "scale_is_hidden": said.scale_is_hidden,
            "directions": _directions(posterior.best.laplace),
        },
        "parameters": [_describe(marginal, posterior) for marginal in posterior.marginals],
        "correlation": {"names": list(parameters.names), "matrix": posterior.correlation},
        "covariance": {"names": list(parameters.names), "matrix": posterior.covariance},
        "method": posterior.method,
        "check_of_laplace": {
            "draws": len(posterior.importance.theta),
            "pareto_k": posterior.importance.smoothed.k,
            "effective_draws": posterior.importance.smoothed.effective,
            "unstable_laws": posterior.importance.unstable,
            "without_equilibrium": posterior.importance.failed,
            "mean": posterior.importance.mean,
            "standard_deviation": posterior.importance.standard_deviations,
            "doubts": list(posterior.doubts),
        },
        "chain": _describe_chain(posterior),
        "modes": [
            {
                "theta": mode.estimate.theta,
                "probability": probability,
                "share_of_prior": mode.estimate.problem.mode.share,
            }
            for mode, probability in zip(posterior.modes, posterior.mode_probabilities, strict=True)
        ],
        "predictions": [_describe_prediction(prediction) for prediction in posterior.predictions],
        "likelihood": {
            "density": "normal" if math.isinf(options.likelihood.nu) else "multivariate Student t, a row at a time",
            "degrees_of_freedom": options.likelihood.nu,
        },
        "discretisation": _describe_discretisation(posterior, options),
        "registration": _describe_registration(posterior, options),
        "prior": {
            "model": prior.model.name,
            "variant": prior.model.variant,
            "groups": list(prior.groups),
            "laws": list(prior.laws_of),
            "poisson": prior.poisson,
            "draws": len(prior.theta),
            "seed": prior.seed,
            "rejection_rate": prior.rejection_rate,
            "distance_from_gaussian": prior.distances,
        },
        "gauss_newton": {
            "converged": gauss_newton.converged,
            "history": [vars(step) for step in gauss_newton.history],
        },
        "remarks": [*posterior.remarks, *_unexplained(posterior.predictions)],
        "equilibria": dict(posterior.solves),
        "seconds": dict(posterior.seconds),
        "seed": options.seed,
        "device": device,
        "versions": machine(),
    }


def _describe(marginal: Marginal, posterior: Posterior) -> dict[str, Any]:
    parameter = marginal.parameter
    tissue = posterior.parameters.tissues.index(parameter.tissue)

    def shown(value: float) -> float:
        return math.exp(value) if parameter.is_modulus else value

    estimate, unit = shown(marginal.estimate), "Pa" if parameter.is_modulus else "1"
    return {
        "tissue": parameter.tissue,
        "labels": list(posterior.parameters.labels[tissue]),
        "group": posterior.parameters.groups[tissue],
        "law": posterior.parameters.laws_of[tissue],
        "name": "shear modulus" if parameter.is_modulus else parameter.coordinate.name,
        "unit": unit,
        "estimate": estimate,
        "standard_deviation": (estimate if parameter.is_modulus else 1.0) * marginal.deviation,
        "interval_95": [shown(value) for value in marginal.interval],
        "shrinkage": marginal.shrinkage,
        "prior": {
            "middle": shown(marginal.prior_mean),
            "interval_95": [shown(value) for value in marginal.prior_interval],
        },
        "coordinate": {
            "name": parameter.coordinate.name,
            "estimate": marginal.estimate,
            "mean": marginal.mean,
            "standard_deviation": marginal.deviation,
            "interval_95": list(marginal.interval),
            "prior_mean": marginal.prior_mean,
            "prior_standard_deviation": marginal.prior_deviation,
        },
    }


def _directions(laplace: Laplace) -> list[dict[str, Any]]:
    return [
        {"gain": gain, "variance_left": 1.0 / (1.0 + gain), "told": told, "undone": undone}
        for gain, told, undone in zip(laplace.gains.tolist(), laplace.told, laplace.undone, strict=True)
    ]


def _describe_chain(posterior: Posterior) -> dict[str, Any] | None:
    if posterior.chain is None:
        return None
    return {
        "draws": len(posterior.chain.theta),
        "equilibria": posterior.chain.solves,
        "accepted": posterior.chain.accepted,
        "effective_draws": posterior.chain.effective,
    }


def _describe_prediction(prediction: Prediction) -> dict[str, Any]:
    factor, unit = SHOWN[prediction.unit]
    sigma = None if prediction.sigma is None else factor * float(np.sqrt(np.mean(prediction.sigma**2)))
    size = prediction.after.shape[1]
    return {
        "name": prediction.name,
        "kind": prediction.kind,
        "role": prediction.role,
        "unit": unit,
        "count": len(prediction.rows),
        "root_mean_square_before": factor * prediction.error_before,
        "root_mean_square_after": factor * prediction.error_after,
        "noise_sigma": sigma,
        "noise_root_mean_square": None if sigma is None else math.sqrt(size) * sigma,
        "prediction_standard_deviation": factor * float(np.sqrt(np.mean(prediction.deviation**2))),
        "gross_errors": prediction.rows[prediction.gross],
        "coverage": None
        if prediction.coverage is None
        else {f"{100 * p:g} %": part for p, part in zip(INTERVALS, prediction.coverage, strict=True)},
    }


def _describe_discretisation(posterior: Posterior, options: EstimationOptions) -> dict[str, Any] | None:
    if not posterior.mesh_errors or options.discretisation is None:
        return None
    _, value, deviation = posterior.nuisances[0]
    error = posterior.mesh_errors[-1]
    (amount, slope), (expected, spread) = error.amount(value), error.amount(options.discretisation.mean)
    return {
        "amount": amount,
        "standard_deviation": slope * deviation,
        "prior_mean": expected,
        "prior_standard_deviation": spread * options.discretisation.deviation,
        "difference_root_mean_square_mm": MILLIMETRES * error.change.size,
        "computed": len(posterior.mesh_errors),
    }


def _describe_registration(posterior: Posterior, options: EstimationOptions) -> dict[str, Any] | None:
    if options.registration is None:
        return None
    found = posterior.nuisances[-6:]
    return {
        "prior_shift_mm": MILLIMETRES * options.registration.shift,
        "prior_turn_degrees": math.degrees(options.registration.turn),
        "shift_mm": [MILLIMETRES * value for _, value, _ in found[:3]],
        "shift_standard_deviation_mm": [MILLIMETRES * deviation for _, _, deviation in found[:3]],
        "turn_degrees": [math.degrees(value) for _, value, _ in found[3:]],
        "turn_standard_deviation_degrees": [math.degrees(deviation) for _, _, deviation in found[3:]],
    }


def _unexplained(predictions: Sequence[Prediction]) -> list[str]:
    """What a user must know of recordings that no parameters explain."""
    return [
        f"{int(one.gross.sum())} of {len(one.rows)} rows of '{one.name}' are gross errors, farther from the prediction "
        "than its noise allows: what moved them is not in this case"
        for one in predictions
        if one.gross.mean() > _UNEXPLAINED
    ]


def estimate_lines(said: Mapping[str, Any]) -> list[str]:
    """The tables, as printed."""
    lines = [*said["identifiability"]["sentences"], ""]
    lines.append(
        "tissue             parameter         estimate       sd   95 % interval         prior 95 %         shrinkage"
    )
    for one in said["parameters"]:
        unit = "" if one["unit"] == "1" else one["unit"]
        ends = (one["interval_95"], one["prior"]["interval_95"])
        interval, prior = (f"{_number(low)} to {_number(high)}" for low, high in ends)
        lines.append(
            f"  {one['tissue']:<16.16} {one['name']:<15} {_number(one['estimate']):>9} "
            f"{_number(one['standard_deviation']):>8}   {interval:<19}   {prior:<16} "
            f"{100 * one['shrinkage']:>7.0f} %  {unit}"
        )
    lines += _check_lines(said)
    lines += ["", "RMSE at recordings      count   before    after    noise   in 50 %   in 95 %   gross errors"]
    for one in said["predictions"]:
        noise = one["noise_root_mean_square"]
        within = ["", ""] if one["coverage"] is None else [f"{100 * part:.0f} %" for part in one["coverage"].values()]
        lines.append(
            f"  {one['name']:<18.18} {one['count']:>8} {one['root_mean_square_before']:>8.3f} "
            f"{one['root_mean_square_after']:>8.3f} {'' if noise is None else f'{noise:.3f}':>8} {within[0]:>9} "
            f"{within[1]:>9} {len(one['gross_errors']):>9}      {one['unit']}"
            + (", check" if one["role"] == "check" else "")
        )
    lines += [f"  remark    {remark}" for remark in said["remarks"]]
    seconds = said["seconds"]
    lines += ["", "time [s]   " + ", ".join(f"{stage} {spent:.1f}" for stage, spent in seconds.items())]
    lines.append("equilibria " + ", ".join(f"{stage} {count}" for stage, count in said["equilibria"].items()))
    return lines


def _check_lines(said: Mapping[str, Any]) -> list[str]:
    check, chain, mesh = said["check_of_laplace"], said["chain"], said["discretisation"]
    names, matrix = said["correlation"]["names"], np.asarray(said["correlation"]["matrix"])
    lines = [
        f"  correlation of {names[i]} and {names[j]}: {matrix[i, j]:.2f}"
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) >= 0.3
    ]
    lines.append(
        f"  {said['method']}: Pareto k {check['pareto_k']:.2f} of {check['draws']} weighted draws "
        f"({check['effective_draws']:.0f} effective; without equilibrium: {check['without_equilibrium']}, "
        f"unstable laws: {check['unstable_laws']})"
    )
    lines += [f"  Laplace fails: {doubt}" for doubt in check["doubts"]]
    if chain is not None:
        lines.append(
            f"  chain of {chain['equilibria']} equilibria, {100 * chain['accepted']:.0f} % accepted, worth "
            f"{min(chain['effective_draws']):.0f} independent draws"
        )
    if mesh is not None:
        lines.append(
            f"  error of the mesh: {mesh['amount']:.2f} +- {mesh['standard_deviation']:.2f} times what elements of "
            f"half the size change, {mesh['difference_root_mean_square_mm']:.3f} mm root mean square"
        )
    if said["registration"] is not None:
        shift = ", ".join(f"{value:.2f}" for value in said["registration"]["shift_mm"])
        turn = ", ".join(f"{value:.2f}" for value in said["registration"]["turn_degrees"])
        lines.append(f"  registration: shifted by ({shift}) mm, turned by ({turn}) degrees")
    return lines


def _number(value: float) -> str:
    """Four digits, as a person writes them."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
