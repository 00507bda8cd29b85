"""An estimate of tissue: its JSON, what is printed, and every recorded row beside what it makes of it, as CSV."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.diagnosis.locating import ScoreMap
from warpbrain.estimation.parameters import Parameter, Parameters
from warpbrain.estimation.posterior import Marginal, Posterior
from warpbrain.estimation.prediction import INTERVALS, OverallErrors, Prediction
from warpbrain.estimation.registration import registration_of
from warpbrain.inference.probability import percent
from warpbrain.physics.words import tabled
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording
from warpbrain.report.comparison import SHOWN
from warpbrain.report.diagnosis.files import seen
from warpbrain.report.files import MILLIMETRES, body_file, fingerprints, picked, write_body, write_csv
from warpbrain.report.summary import machine
from warpbrain.worlds.body.averaged_tissue import AveragedTissue

#: More than this part of a recording being gross errors is said.
_UNEXPLAINED = 0.3
#: Correlations that are smaller are not told, nor are causes that are less probable.
_TIED, _LIKELY = 0.3, 0.05
_METHODS = {"laplace": "Laplace's approximation", "chain": "a Markov chain"}


def describe_estimate(posterior: Posterior, device: str, averaged: AveragedTissue | None = None) -> dict[str, Any]:
    """Everything that is known of an estimate, with units in keys or beside the values; docs/estimation.md."""
    prior, parameters, case, options = posterior.prior, posterior.parameters, posterior.case, posterior.options
    check, chain, best, known = posterior.importance, posterior.chain, posterior.best, posterior.identifiability
    noise, laplace = best.point.noise, best.laplace
    each = zip(laplace.gains.tolist(), laplace.combinations, laplace.directions, strict=True)
    directions = [
        {"gain": gain, "variance_left": 1.0 / (1.0 + gain), "told": told, "undone": undone}
        for gain, told, undone in each
    ]
    drawn = None
    if chain is not None:
        numbers = picked(chain, equilibria="solves", accepted="accepted", effective_draws="effective")
        drawn = {"draws": len(chain.theta), **numbers}
    return {
        "case": picked(case, "name", "title", "origin", "assumptions"),
        "inputs_sha256": fingerprints(case),
        "identifiability": {
            **picked(known, "nothing", "sentences", "informed", "weakly_informed", "hidden", "scale_is_hidden"),
            "directions": directions,
        },
        "parameters": [_describe(marginal, posterior) for marginal in posterior.marginals],
        "nothing_else": None if averaged is None else _describe_nothing_else(averaged),
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
        "all_recordings": [picked(one, "role", "count") | _errors_mm(one) for one in posterior.overall_errors],
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
            **picked(prior.model, model="name", variant="variant"),
            **picked(prior, groups="groups", laws="laws_of", poisson="poisson"),
            "draws": len(prior.theta),
            **picked(prior, seed="seed", rejection_rate="rejection_rate", distance_from_gaussian="distances"),
        },
        "gauss_newton": {"converged": best.converged, "history": [vars(step) for step in best.history]},
        "remarks": remarks_of(posterior),
        "equilibria": dict(posterior.solves),
        "seconds": dict(posterior.seconds),
        "seed": options.seed,
        "device": device,
        "versions": machine(),
    }


def _errors_mm(one: OverallErrors) -> dict[str, float]:
    return {f"root_mean_square_{key}_mm": MILLIMETRES * getattr(one, key) for key in ("before", "after", "of_run")}


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
        "name": _name(parameter),
        "unit": "Pa" if parameter.is_modulus else "1",
    }


def _name(parameter: Parameter) -> str:
    return "shear modulus" if parameter.is_modulus else parameter.coordinate.name


def _shown(parameter: Parameter) -> Callable[[float], float]:
    """From the coordinate of a parameter to what people read."""
    return math.exp if parameter.is_modulus else float


def _describe_nothing_else(averaged: AveragedTissue) -> dict[str, Any]:
    deviations = np.sqrt(np.diag(averaged.covariance)).tolist()
    each = list(zip(averaged.parameters, averaged.mean.tolist(), deviations, averaged.interval(0.95), strict=True))
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


def _describe_prediction(prediction: Prediction) -> dict[str, Any]:
    factor, unit = SHOWN[prediction.unit]
    sigma = None if prediction.sigma is None else factor * float(np.sqrt(np.mean(prediction.sigma**2)))
    return {
        **picked(prediction, "name", "kind", "role"),
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


def correlated(posterior: Posterior) -> list[str]:
    """Parameters that are tied to each other, for the terminal and for its page."""
    names, matrix = posterior.parameters.names, posterior.correlation
    return [
        f"correlation of {names[i]} and {names[j]}: {matrix[i, j]:.2f}"
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i, j]) >= _TIED
    ]


def recorded_points(posterior: Posterior, surfaces: bool = True) -> Iterator[tuple[Prediction, Any]]:
    """Predictions at places, with their recordings: of points, and of surfaces unless these are left out."""
    recordings = {recording.name: recording for recording in posterior.case.recordings}
    for one in posterior.predictions:
        if isinstance(recordings[one.name], PointsRecording | SurfaceRecording if surfaces else PointsRecording):
            yield one, recordings[one.name]


# as printed -----------------------------------------------------------------------------------------------------------


def estimate_lines(posterior: Posterior, averaged: AveragedTissue | None = None) -> list[str]:
    """The tables, as printed; with tissue averaged over what may act, if that is known."""
    lines = [*posterior.identifiability.sentences, ""]
    lines.append(
        "tissue             parameter         estimate       sd   95 % interval         prior 95 %         shrinkage"
    )
    for marginal in posterior.marginals:
        parameter = marginal.parameter
        prior = f"   {_interval(parameter, marginal.prior_interval):<16} {100 * marginal.shrinkage:>7.0f} %"
        lines.append(_row(parameter, marginal.estimate, marginal.deviation, marginal.interval, prior))
    if averaged is not None:
        lines += averaged_lines(averaged)
    lines += [f"  {line}" for line in (*correlated(posterior), *checks(posterior))]
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


def _row(parameter: Parameter, estimate: float, deviation: float, interval: tuple[float, float], more: str = "") -> str:
    """Of a parameter by its coordinate, as people read it."""
    shown = _shown(parameter)(estimate)
    deviation *= shown if parameter.is_modulus else 1.0
    return (
        f"  {parameter.tissue:<16.16} {_name(parameter):<15} {_number(shown):>9} {_number(deviation):>8}   "
        f"{_interval(parameter, interval):<19}{more:<29}  {'Pa' if parameter.is_modulus else ''}"
    )


def _interval(parameter: Parameter, interval: tuple[float, float]) -> str:
    low, high = map(_shown(parameter), interval)
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
            lines.append(_row(parameter, mean, deviation, (low, high), f" {'':<29}"))
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


def checks(posterior: Posterior) -> list[str]:
    """How far an estimate is to be believed, for the terminal and for its page."""
    check, chain = posterior.importance, posterior.chain
    lines = [
        f"{_METHODS[posterior.method]}: Pareto k {check.smoothed.k:.2f} of {len(check.theta)} weighted draws, "
        f"{check.smoothed.effective:.0f} of them effective, {check.failed} without equilibrium, {check.unstable} of "
        "unstable laws",
        *(f"Laplace's approximation fails: {doubt}" for doubt in posterior.doubts),
    ]
    if chain is not None:
        lines.append(
            f"chain of {chain.solves} equilibria, {100 * chain.accepted:.0f} % accepted, worth "
            f"{chain.effective.min():.0f} independent draws"
        )
    lines.append(f"noise: {posterior.best.point.noise.scale:.2f} times as large as declared")
    mesh, registration = describe_discretisation(posterior), describe_registration(posterior)
    if mesh is not None:
        lines.append(
            f"error of the mesh: {mesh['amount']:.2f} ± {mesh['standard_deviation']:.2f} times what elements of half "
            f"the size change, {tabled(mesh['difference_root_mean_square_mm'])} mm root mean square"
        )
    if registration is not None:
        shift, turn = (", ".join(f"{x:.2f}" for x in registration[key]) for key in ("shift_mm", "turn_degrees"))
        lines.append(f"registration: shifted by ({shift}) mm, turned by ({turn}) degrees")
    return lines


def _number(value: float) -> str:
    """Four digits, as a person writes them."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


# as a table -----------------------------------------------------------------------------------------------------------


def write_predictions(path: Path, posterior: Posterior) -> None:
    """Write every row, in mm or N, axes RAS; of a surface the distance stands in the first of three components."""
    recordings = {recording.name: recording for recording in posterior.case.recordings}
    vectors = [f"{what}_{axis}" for what in ("observed", "predicted", "standard_deviation") for axis in "xyz"]
    rows = [["recording", "kind", "role", "unit", "row", "gross_error", "x_mm", "y_mm", "z_mm", *vectors]]
    for one in posterior.predictions:
        rows += [_predicted(one, recordings[one.name], number) for number in range(len(one.rows))]
    write_csv(path, rows)


def _predicted(one: Prediction, recording: Recording, number: int) -> list[Any]:
    factor, unit = SHOWN[one.unit]
    row = int(one.rows[number])
    cells = [one.name, one.kind, one.role, unit, row, int(one.gross[number])]
    if isinstance(recording, PointsRecording | SurfaceRecording):
        cells += [f"{MILLIMETRES * value:.6g}" for value in recording.points[row]]
    else:
        cells += [""] * 3
    before = one.before[number]
    for values in (before, before - one.after[number], one.deviation[number]):
        shown = [f"{factor * value:.6g}" for value in np.atleast_1d(values)]
        cells += shown + [""] * (3 - len(shown))
    return cells


def write_estimated_state(path: Path, posterior: Posterior, where: ScoreMap | None = None) -> None:
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
    du, covariance = posterior.best.linearised.du, posterior.covariance
    variance = np.einsum("pnk,pq,qnk->nk", du, covariance, du)
    deviation = MILLIMETRES * np.sqrt(np.maximum(variance, 0.0))
    arrays = {"displacement": MILLIMETRES * posterior.best.point.state.u, "displacement_sd": deviation}
    return body_file(posterior.case.remaining[0], arrays)
