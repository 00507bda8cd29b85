"""`warpbrain estimate`: the tissue that a case's recordings are of."""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.linalg import LinAlgError

from warpbrain.atomic import output_folder, safe_name
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.cli import warp
from warpbrain.cli.log import drawn, note_case
from warpbrain.diagnosis.locating import ScoreMap, map_of_search
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.estimate import Estimation
from warpbrain.estimation.finer_mesh import Discretisation
from warpbrain.estimation.fit import GaussNewtonStep
from warpbrain.estimation.likelihood import Likelihood
from warpbrain.estimation.options import EstimationOptions, Listener
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.posterior import Posterior
from warpbrain.estimation.sweep import SweepPoint, sweep
from warpbrain.gp.sampling import SWEEP
from warpbrain.gp.trained import find_model
from warpbrain.kernels.module import find_device
from warpbrain.recordings.base import Registration
from warpbrain.report import sweep as table
from warpbrain.report import views
from warpbrain.report.estimate import describe_estimate, estimate_lines, write_estimated_state, write_predictions
from warpbrain.report.estimate_page import agreement_figure, densities_figure, residuals_figure, write_estimate_page
from warpbrain.report.files import fingerprint_of, read_state, write_summary
from warpbrain.report.page import lines
from warpbrain.report.rendering import ready_to_render
from warpbrain.report.warped import WarpRequest
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.quiet import start_warp_quietly
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import choose_folder, results_in
from warpbrain.worlds.body.hypotheses import screened
from warpbrain.worlds.body.uncertainty import AveragedTissue, averaged_tissue
from warpbrain.worlds.options import DiagnosisOptions

#: Nodes up to which it is said unasked what else may act: its cost grows faster than that of an estimate.
_LARGEST = 20_000
#: Options that mean nothing for a sweep.
_OF_THE_POSTERIOR = ("nu", "registration", "no_registration", "no_discretisation", "samples", "seed", "causes")


def estimate(options: argparse.Namespace) -> None:
    """Estimate the tissue of a case, by a posterior or by a sweep."""
    if options.method == "grid":
        for name in _OF_THE_POSTERIOR:
            if (value := getattr(options, name)) is not None and value is not False:
                raise InputError(f"--{name.replace('_', '-')}: means nothing with --method grid")
    settings = EstimationOptions(
        Likelihood(None) if options.nu == math.inf else Likelihood(),
        None if options.no_discretisation else Discretisation(),
        not options.no_registration,
        samples=options.samples or EstimationOptions.samples,
        seed=options.seed or 0,
    )
    registration = None
    if options.registration is not None:
        shift, turn = options.registration
        if not (shift > 0.0 and turn > 0.0 and math.isfinite(shift + turn)):
            raise InputError(f"--registration {shift:g} {turn:g}: expected two positive numbers [mm] and [degrees]")
        registration = Registration(0.001 * shift, math.radians(turn))
    record: Record = options.record
    say = record.say

    start_warp_quietly()
    device = find_device(options.device).alias
    images = warp.requested(options)
    if images is not None and options.method == "grid":
        raise InputError("--method grid: has no state that --image, --labels and --points could be warped by")
    case = find_case(options.case, options.tissue)
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: tissue is estimated from a deformed body, not from tests")
    warp.check_place(images, case)
    if options.model is not None:
        case = case.with_law(options.model)
    if registration is not None:
        case = replace(case, registration=registration)
    usual = f"warpbrain-estimate-{safe_name(case.name)}-{options.tissue}"
    # a sweep goes on where it was left, and draws the estimate that lies beside it
    allowed = ("estimate.json", "sweep.csv") if options.method == "grid" else ("sweep.csv",)
    out = choose_folder(options.out, usual, options.overwrite, allowed)
    note_case(record, case, device)
    say(case.title)
    if case.origin == "stand-in":
        say("  a stand-in, not a patient: what is estimated is the tissue of a model")
    if options.method == "grid":
        _sweep(options, case, out)
    else:
        _posterior(options, settings, case, images, out)


def _posterior(
    options: argparse.Namespace, settings: EstimationOptions, case: Case, images: WarpRequest | None, out: Path
) -> None:
    record: Record = options.record
    say = record.say

    def on_stage(text: str) -> None:
        progress.clear()
        say(*lines("estimate.txt", "stage", text))

    def on_step(step: GaussNewtonStep) -> None:
        say(*lines("estimate.txt", "gauss_newton_step", step))

    model = find_model(options.gp or "hierarchical")
    with Progress("equilibria", options.quiet) as progress:
        listener = Listener(on_stage, on_step, progress.show)
        posterior = Estimation(case, model, settings, options.device, listener).run()
    averaged = where = None
    if options.causes or (options.causes is None and len(case.mesh.points) <= _LARGEST):
        averaged, where = _what_else(posterior, options.device, on_stage)
    elif options.causes is None:
        say("", f"what else may act is left out on more than {_LARGEST} nodes; --causes computes it")
    described = describe_estimate(posterior, find_device(options.device).alias, averaged)
    say(*estimate_lines(described))
    with results_in(out, record, options.overwrite):
        write_predictions(out / "predictions.csv", posterior)
        write_estimated_state(out / "state.vtu", posterior, where)
        views.save(densities_figure(posterior, narrow=False), out / "posterior.png", case.title, 10.0)
        views.save(agreement_figure(posterior, narrow=False), out / "predicted.png", case.title, 10.0)
        views.save(residuals_figure(posterior), out / "residuals.png", case.title)
        write_summary(out / "estimate.json", described)
        record.files += ["estimate.json", "predictions.csv", "state.vtu"]
        record.files += ["posterior.png", "predicted.png", "residuals.png"]
        with ready_to_render():
            record.files += drawn(write_estimate_page(out, described, posterior), say)
        if images is not None:
            warp.warp(read_state(out / "state.vtu"), out, images, record, options.quiet)


def _what_else(
    posterior: Posterior, device: str | None, on_stage: Callable[[str], None]
) -> tuple[AveragedTissue | None, ScoreMap | None]:
    """Tissue averaged over what may act, and where something is left; None if that cannot be known, which is said."""
    prior, mesh_error = posterior.best.problem.mode.gaussian, posterior.options.discretisation is not None
    try:
        search = screened(posterior.case, device, Listener(on_stage), prior, mesh_error=mesh_error)
        where = map_of_search(search, DiagnosisOptions().draws, np.random.default_rng(posterior.options.seed))
        return averaged_tissue(search), where
    except (InputError, SolveError, LinAlgError) as error:
        on_stage(f"what else may act is not known: {error}")
        return None, None


def _sweep(options: argparse.Namespace, case: Case, out: Path) -> None:
    record: Record = options.record
    say = record.say

    # the paper's process on the paper's data
    model = find_model(options.gp or "coregionalised", "corrected" if options.gp else "as_published")
    parameters = Parameters.of(case)
    header = table.columns(parameters, fingerprint_of(case, model))
    path = out / table.TABLE
    estimated = table.estimated_in(out / "estimate.json")
    if options.overwrite:
        path.unlink(missing_ok=True)
    known, damaged = table.read_sweep(path, header, len(parameters.tissues))
    total = len(SWEEP) ** len(parameters.tissues)
    say(f"sweep of {total} equilibria" + (f", {len(known)} of which are there already" if known else ""))
    if damaged:
        say(f"  damaged   {damaged} of the lines of {path.name}: nothing of them is used")
    points = dict(known)

    def on_point(point: SweepPoint) -> None:
        points[point.k] = point
        output_folder(out)
        table.write_sweep(path, header, points.values())
        progress.show(len(points) / total, ", ".join(f"k = {k:+.2f}" for k in point.k))

    with Progress("sweep", options.quiet) as progress:
        finished = sweep(case, model, SWEEP, known, options.device, on_point)
    say(*table.sweep_lines(finished))
    # beside an estimate, and of points that were there before
    with results_in(out, record, replace=False):
        table.write_sweep_picture(out / "sweep.png", finished, case.title, estimated)
        record.files += [table.TABLE, "sweep.png"]
