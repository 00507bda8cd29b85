"""An estimate of tissue as JSON; what is printed is made of the same `Posterior`, see `estimate_text`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from warpbrain.estimation.fit import Laplace
from warpbrain.estimation.parameters import Parameter, Parameters
from warpbrain.estimation.posterior import Marginal, Posterior
from warpbrain.estimation.prediction import INTERVALS, Prediction
from warpbrain.estimation.registration import registration_of
from warpbrain.estimation.sampling import Chain
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.fingerprints import fingerprints
from warpbrain.report.summary import machine
from warpbrain.worlds.body.averaged_tissue import AveragedTissue

#: More than this part of a recording being gross errors is said.
_UNEXPLAINED = 0.3


def describe_estimate(posterior: Posterior, device: str, averaged: AveragedTissue | None = None) -> dict[str, Any]:
    """Everything that is known of an estimate, with units in keys or beside the values; docs/estimation.md."""
    prior, parameters, case, options = posterior.prior, posterior.parameters, posterior.case, posterior.options
    said, check, chain, best = posterior.identifiability, posterior.importance, posterior.chain, posterior.best
    noise = best.point.noise
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
            "directions": _directions(best.laplace),
        },
        "parameters": [_describe(marginal, posterior) for marginal in posterior.marginals],
        "nothing_else": None if averaged is None else _describe_nothing_else(averaged),
        "correlation": {"names": list(parameters.names), "matrix": posterior.correlation},
        "covariance": {"names": list(parameters.names), "matrix": posterior.covariance},
        "method": posterior.method,
        "check_of_laplace": {
            "draws": len(check.theta),
            "pareto_k": check.smoothed.k,
            "effective_draws": check.smoothed.effective,
            "unstable_laws": check.unstable,
            "without_equilibrium": check.failed,
            "mean": check.mean,
            "standard_deviation": check.standard_deviations,
            "doubts": list(posterior.doubts),
        },
        "chain": None if chain is None else _describe_chain(chain),
        "modes": [
            {"theta": mode.theta, "probability": probability, "share_of_prior": mode.problem.mode.share}
            for mode, probability in zip(posterior.modes, posterior.mode_probabilities, strict=True)
        ],
        "predictions": [_describe_prediction(prediction) for prediction in posterior.predictions],
        "all_recordings": [
            {
                "role": one.role,
                "count": one.count,
                "root_mean_square_before_mm": MILLIMETRES * one.before,
                "root_mean_square_after_mm": MILLIMETRES * one.after,
                "root_mean_square_of_run_mm": MILLIMETRES * one.of_run,
            }
            for one in posterior.overall_errors
        ],
        "likelihood": {
            "density": "normal, shared by neighbours" + ("" if noise.outliers is None else ", with gross errors"),
            "degrees_of_freedom": None,
            "noise_scale": noise.scale,
            "gross_share": 0.0 if noise.outliers is None else noise.outliers.probability,
            "gross_times": [] if noise.outliers is None else noise.outliers.inflations[1:],
        },
        "discretisation": describe_discretisation(posterior),
        "registration": describe_registration(posterior),
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
        "gauss_newton": {"converged": best.converged, "history": [vars(step) for step in best.history]},
        "remarks": remarks_of(posterior),
        "equilibria": dict(posterior.solves),
        "seconds": dict(posterior.seconds),
        "seed": options.seed,
        "device": device,
        "versions": machine(),
    }


def _describe(marginal: Marginal, posterior: Posterior) -> dict[str, Any]:
    parameter = marginal.parameter
    shown = _shown(parameter)
    estimate = shown(marginal.estimate)
    return {
        **_parameter(parameter, posterior.parameters),
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


def _parameter(parameter: Parameter, parameters: Parameters) -> dict[str, Any]:
    """What a parameter is."""
    tissue = parameters.tissues.index(parameter.tissue)
    return {
        "tissue": parameter.tissue,
        "labels": list(parameters.labels[tissue]),
        "group": parameters.groups[tissue],
        "law": parameters.laws_of[tissue],
        "name": "shear modulus" if parameter.is_modulus else parameter.coordinate.name,
        "unit": "Pa" if parameter.is_modulus else "1",
    }


def _shown(parameter: Parameter) -> Callable[[float], float]:
    """From the coordinate of a parameter to what people read."""
    return math.exp if parameter.is_modulus else float


def _describe_nothing_else(averaged: AveragedTissue) -> dict[str, Any]:
    deviations = np.sqrt(np.diag(averaged.covariance)).tolist()
    each = zip(averaged.parameters, averaged.mean.tolist(), deviations, averaged.interval(0.95), strict=True)
    return {
        "probability": averaged.nothing,
        "causes": [
            {"name": one.name, "kind": one.kind.value, "probability": one.probability} for one in averaged.causes
        ],
        "tissue": [
            {
                **_parameter(parameter, averaged.parameters),
                "middle": _shown(parameter)(mean),
                "interval_95": [_shown(parameter)(end) for end in ends],
                "coordinate": {"name": parameter.coordinate.name, "mean": mean, "standard_deviation": deviation},
            }
            for parameter, mean, deviation, ends in each
        ],
        "covariance": {"names": list(averaged.parameters.names), "matrix": averaged.covariance},
    }


def _directions(laplace: Laplace) -> list[dict[str, Any]]:
    return [
        {"gain": gain, "variance_left": 1.0 / (1.0 + gain), "told": told, "undone": undone}
        for gain, told, undone in zip(laplace.gains.tolist(), laplace.combinations, laplace.directions, strict=True)
    ]


def _describe_chain(chain: Chain) -> dict[str, Any]:
    drawn = {"draws": len(chain.theta), "equilibria": chain.solves}
    return {**drawn, "accepted": chain.accepted, "effective_draws": chain.effective}


def _describe_prediction(prediction: Prediction) -> dict[str, Any]:
    factor, unit = SHOWN[prediction.unit]
    sigma = None if prediction.sigma is None else factor * float(np.sqrt(np.mean(prediction.sigma**2)))
    return {
        "name": prediction.name,
        "kind": prediction.kind,
        "role": prediction.role,
        "unit": unit,
        "count": prediction.fitted.count,
        "root_mean_square_before": factor * prediction.error_before,
        "root_mean_square_after": factor * prediction.error_after,
        "root_mean_square_of_run": factor * prediction.run.after.root_mean_square,
        "noise_sigma": sigma,
        "noise_root_mean_square": noise_of(prediction),
        "prediction_standard_deviation": factor * float(np.sqrt(np.mean(prediction.deviation**2))),
        "gross_errors": prediction.rows[prediction.gross],
        "coverage": None
        if prediction.coverage is None
        else {f"{100 * p:g} %": part for p, part in zip(INTERVALS, prediction.coverage, strict=True)},
    }


def noise_of(prediction: Prediction) -> float | None:
    """Root mean square [mm or N] that independent noise alone would leave."""
    if prediction.sigma is None:
        return None
    size = prediction.after.shape[1]
    return SHOWN[prediction.unit][0] * math.sqrt(size * float(np.mean(prediction.sigma**2)))


def describe_discretisation(posterior: Posterior) -> dict[str, Any] | None:
    options = posterior.options
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


def describe_registration(posterior: Posterior) -> dict[str, Any] | None:
    if not posterior.options.registration:
        return None
    declared = registration_of(posterior.case)
    found = posterior.nuisances[-6:]
    return {
        "prior_shift_mm": MILLIMETRES * declared.shift,
        "prior_turn_degrees": math.degrees(declared.turn),
        "shift_mm": [MILLIMETRES * value for _, value, _ in found[:3]],
        "shift_standard_deviation_mm": [MILLIMETRES * deviation for _, _, deviation in found[:3]],
        "turn_degrees": [math.degrees(value) for _, value, _ in found[3:]],
        "turn_standard_deviation_degrees": [math.degrees(deviation) for _, _, deviation in found[3:]],
    }


def remarks_of(posterior: Posterior) -> list[str]:
    """With what a user must know of recordings that no parameters explain."""
    return list(posterior.remarks) + [
        f"{int(one.gross.sum())} of {len(one.rows)} rows of '{one.name}' are gross errors, farther from the prediction "
        "than its noise allows: what moved them is not in this case"
        for one in posterior.predictions
        if one.gross.mean() > _UNEXPLAINED
    ]
