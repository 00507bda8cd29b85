"""An estimate of tissue: its JSON, what is printed, and every recorded row beside what it makes of it, as CSV."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import write_csv
from warpbrain.diagnosis.locating import ScoreMap
from warpbrain.estimation.parameters import Parameter, Parameters
from warpbrain.estimation.posterior import INTERVALS, Marginal, Posterior, Prediction
from warpbrain.estimation.registration import registration_of
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report.comparison import SHOWN, error_text
from warpbrain.report.diagnosis.files import seen
from warpbrain.report.files import MILLIMETRES, body_file, fingerprints, picked, write_body
from warpbrain.report.page import lines
from warpbrain.report.summary import describe_model, machine
from warpbrain.worlds.body.uncertainty import AveragedTissue

#: More than this part of a recording being gross errors is said.
_UNEXPLAINED = 0.3


def describe_estimate(posterior: Posterior, device: str, averaged: AveragedTissue | None) -> dict[str, Any]:
    """Everything that is known of an estimate, with units in keys or beside the values; docs/estimation.md."""
    prior, parameters, case, options = posterior.prior, posterior.parameters, posterior.case, posterior.options
    check, chain, best, known = posterior.importance, posterior.chain, posterior.best, posterior.identifiability
    noise, laplace = best.point.noise, best.laplace
    each = zip(laplace.gains.tolist(), laplace.combinations, laplace.directions, strict=True)
    directions = [
        {"gain": gain, "variance_left": 1.0 / (1.0 + gain), "told": constrained, "undone": undone}
        for gain, constrained, undone in each
    ]
    drawn = chain and {"draws": len(chain.theta)} | picked(
        chain, equilibria="solves", accepted="accepted", effective_draws="effective"
    )
    errors_mm = {f"root_mean_square_{key}_mm": key for key in ("before", "after", "of_run")}
    return {
        "case": picked(case, "name", "title", "origin", "assumptions"),
        "inputs_sha256": fingerprints(case, prior.model),
        "identifiability": {
            **picked(known, "nothing", "sentences", "informed", "weakly_informed", "hidden", "scale_is_hidden"),
            "directions": directions,
        },
        "parameters": [_describe(marginal, posterior) for marginal in posterior.marginals],
        "nothing_else": None if averaged is None else describe_nothing_else(averaged),
        "correlation": {"names": list(parameters.names), "matrix": posterior.correlation},
        "covariance": {"names": list(parameters.names), "matrix": posterior.covariance},
        "method": posterior.method,
        "check_of_laplace": {
            "draws": len(check.theta),
            **picked(check.smoothed, pareto_k="k", effective_draws="effective"),
            **picked(check, unstable_laws="unstable", without_equilibrium="failed", mean="mean"),
            **picked(check, standard_deviation="standard_deviations"),
            "doubts": posterior.doubts,
        },
        "chain": drawn,
        "modes": [
            {"theta": mode.theta, "probability": probability, "share_of_prior": mode.problem.mode.share}
            for mode, probability in zip(posterior.modes, posterior.mode_probabilities, strict=True)
        ],
        "predictions": [_describe_prediction(prediction) for prediction in posterior.predictions],
        "all_recordings": [
            picked(errors, "role", "count")
            | {name: MILLIMETRES * getattr(errors, key) for name, key in errors_mm.items()}
            for errors in posterior.overall_errors
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
            **describe_model(prior.model),
            **picked(prior, groups="groups", laws="laws_of", poisson="poisson"),
            "draws": len(prior.theta),
            **picked(prior, seed="seed", rejection_rate="rejection_rate", distance_from_gaussian="distances"),
        },
        "gauss_newton": {"converged": best.converged, "history": [vars(step) for step in best.history]},
        "remarks": [
            *posterior.remarks,
            # what a user must know of recordings that no parameters explain
            *(
                f"{int(each.gross.sum())} of {len(each.rows)} rows of '{each.name}' are gross errors, farther from the "
                "prediction than its noise allows: what moved them is not in this case"
                for each in posterior.predictions
                if each.gross.mean() > _UNEXPLAINED
            ),
        ],
        "equilibria": dict(posterior.solves),
        "seconds": dict(posterior.seconds),
        "seed": options.seed,
        "device": device,
        "versions": machine(),
    }


def _describe(marginal: Marginal, posterior: Posterior) -> dict[str, Any]:
    parameter, shown = marginal.parameter, _shown(marginal.parameter)
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
            **picked(marginal, "estimate", "mean", standard_deviation="deviation", interval_95="interval"),
            **picked(marginal, "prior_mean", prior_standard_deviation="prior_deviation"),
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


def describe_nothing_else(averaged: AveragedTissue) -> dict[str, Any]:
    """How probable it is that nothing else acts, and tissue averaged over what may."""
    deviations = np.sqrt(np.diag(averaged.covariance)).tolist()
    each = list(zip(averaged.parameters, averaged.mean.tolist(), deviations, averaged.interval(0.95), strict=True))
    return {
        "probability": averaged.nothing,
        "most_probable": bool(averaged.nothing >= averaged.probabilities.max()),
        "causes": [
            {"name": cause.name, "kind": cause.kind.value, "probability": cause.probability}
            for cause in averaged.causes
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


def _describe_prediction(prediction: Prediction) -> dict[str, Any]:
    factor, unit = SHOWN[prediction.unit]
    sigma = left = None
    if prediction.sigma is not None:
        variance = float(np.mean(prediction.sigma**2))
        sigma, left = factor * math.sqrt(variance), factor * math.sqrt(prediction.after.shape[1] * variance)
    return {
        **picked(prediction, "name", "kind", "role"),
        "unit": unit,
        "count": prediction.fitted.count,
        "root_mean_square_before": factor * prediction.error_before,
        "root_mean_square_after": factor * prediction.error_after,
        "root_mean_square_of_run": factor * prediction.run.after.root_mean_square,
        "noise_sigma": sigma,
        "noise_root_mean_square": left,
        "prediction_standard_deviation": factor * float(np.sqrt(np.mean(prediction.deviation**2))),
        "gross_errors": prediction.rows[prediction.gross],
        "coverage": prediction.coverage
        and {f"{100 * p:g} %": part for p, part in zip(INTERVALS, prediction.coverage, strict=True)},
    }


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
    registration = posterior.nuisances[-6:]
    return {
        "prior_shift_mm": MILLIMETRES * declared.shift,
        "prior_turn_degrees": math.degrees(declared.turn),
        "shift_mm": [MILLIMETRES * value for _, value, _ in registration[:3]],
        "shift_standard_deviation_mm": [MILLIMETRES * deviation for _, _, deviation in registration[:3]],
        "turn_degrees": [math.degrees(value) for _, value, _ in registration[3:]],
        "turn_standard_deviation_degrees": [math.degrees(deviation) for _, _, deviation in registration[3:]],
    }


# as printed and on the page -------------------------------------------------------------------------------------------


def estimate_lines(summary: Mapping[str, Any]) -> list[str]:
    """What is printed of what `describe_estimate` says."""
    averaged = () if summary["nothing_else"] is None else map(averaged_row, summary["nothing_else"]["tissue"])
    tissue, recorded = map(parameter_row, summary["parameters"]), map(prediction_row, summary["predictions"])
    return lines("estimate.txt", "estimate", summary, list(tissue), list(averaged), list(recorded))


def parameter_row(parameter: Mapping[str, Any]) -> list[str]:
    """Tissue, parameter, estimate, standard deviation, 95 % interval, that of the prior, how much of its spread is
    gone, unit."""
    numbers = _number(parameter["estimate"]), _number(parameter["standard_deviation"])
    intervals = interval_of(parameter), interval_of(parameter["prior"])
    gone = f"{100.0 * parameter['shrinkage']:.0f} %"
    return [parameter["tissue"], parameter["name"], *numbers, *intervals, gone, unit_of(parameter)]


def averaged_row(parameter: Mapping[str, Any]) -> list[str]:
    """Tissue, parameter, middle, standard deviation, 95 % interval and unit."""
    middle, deviation = parameter["middle"], parameter["coordinate"]["standard_deviation"]
    deviation *= middle if parameter["unit"] == "Pa" else 1.0
    numbers = _number(middle), _number(deviation)
    return [parameter["tissue"], parameter["name"], *numbers, interval_of(parameter), unit_of(parameter)]


def interval_of(parameter: Mapping[str, Any]) -> str:
    """The 95 % interval of a parameter."""
    low, high = parameter["interval_95"]
    return f"{_number(low)} to {_number(high)}"


def unit_of(parameter: Mapping[str, Any]) -> str:
    """The unit of a parameter, if it has one."""
    return "" if parameter["unit"] == "1" else str(parameter["unit"])


def prediction_row(prediction: Mapping[str, Any]) -> list[Any]:
    """Recording, rows, root mean square with nothing moved, of the estimate and of its state as a run, what noise alone
    leaves, parts in the 50 % and 95 % intervals, gross errors, unit, whether it is only checked."""
    unit, noise, cover = prediction["unit"], prediction["noise_root_mean_square"], prediction["coverage"] or {}
    return [
        prediction["name"],
        prediction["count"],
        *(error_text(prediction[f"root_mean_square_{which}"], unit) for which in ("before", "after", "of_run")),
        "" if noise is None else error_text(noise, unit),
        *(f"{100.0 * cover[key]:.0f} %" if key in cover else "" for key in ("50 %", "95 %")),
        len(prediction["gross_errors"]),
        unit,
        "check" if prediction["role"] == "check" else "",
    ]


def _number(value: float) -> str:
    """Four digits, as a person writes them."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


# as a table -----------------------------------------------------------------------------------------------------------


def write_predictions(path: Path, posterior: Posterior) -> None:
    """Write every row, in mm or N, axes RAS; of a surface the distance stands in the first of three components."""
    recordings = {recording.name: recording for recording in posterior.case.recordings}
    names = [f"{quantity}_{axis}" for quantity in ("observed", "predicted", "standard_deviation") for axis in "xyz"]
    rows: list[list[Any]] = [
        ["recording", "kind", "role", "unit", "row", "gross_error", "x_mm", "y_mm", "z_mm", *names]
    ]
    for prediction in posterior.predictions:
        (factor, unit), recording = SHOWN[prediction.unit], recordings[prediction.name]
        each = zip(prediction.before, prediction.before - prediction.after, prediction.deviation, strict=True)
        for row, gross, vectors in zip(prediction.rows.tolist(), prediction.gross.tolist(), each, strict=True):
            cells = [prediction.name, prediction.kind, prediction.role, unit, row, int(gross)]
            if isinstance(recording, PointsRecording | SurfaceRecording):
                cells += [f"{MILLIMETRES * value:.6g}" for value in recording.points[row]]
            else:
                cells += [""] * 3
            for values in vectors:
                shown = [f"{factor * value:.6g}" for value in np.atleast_1d(values)]
                cells += shown + [""] * (3 - len(shown))
            rows.append(cells)
    write_csv(path, rows)


def write_estimated_state(path: Path, posterior: Posterior, where: ScoreMap | None) -> None:
    """Write the most probable state of an estimate as VTU with coordinates in mm.

    Point arrays: ``displacement`` [mm] and ``displacement_sd`` of its components [mm]: what is not known of the tissue,
    to first order about that state. With a map of what is left ``significant`` and ``blind``, too, as in `map.vtu`.
    """
    file = file_of_estimate(posterior)
    if where is not None:
        file.point_data |= seen(where, posterior.case.remaining[0])
    write_body(path, file)


def file_of_estimate(posterior: Posterior) -> Any:
    """What `write_estimated_state` writes, as a `meshio.Mesh`."""
    du, covariance = posterior.best.linearised.derivatives[0], posterior.covariance
    variance = np.einsum("pnk,pq,qnk->nk", du, covariance, du)
    deviation = MILLIMETRES * np.sqrt(np.maximum(variance, 0.0))
    arrays = {"displacement": MILLIMETRES * posterior.best.point.state.u, "displacement_sd": deviation}
    return body_file(posterior.case.remaining[0], arrays)
