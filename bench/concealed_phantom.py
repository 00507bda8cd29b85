"""The paper's experiment, concealed: is the phantom's tissue found from what another mesh and another code say?

    python bench/phantom_truth.py single    # what is observed, kept in results/; and multi
    python bench/concealed_phantom.py       # writes results/concealed_phantom.json

One estimation goes the whole way, with its check; 99 more, of other points and other noise, take the error of the mesh
from it and start at its estimate. The truth is read for nothing but to score.
"""

from __future__ import annotations

import csv
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from phantom_truth import FORCE, RESULTS

from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.estimation.estimate import Estimation
from warpbrain.estimation.fit import Estimate, GaussNewton
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.posterior import Posterior
from warpbrain.estimation.problem import Problem
from warpbrain.recordings.recording import PointsRecording

Floats = NDArray[np.float64]

REPETITIONS = 100
#: Observed points, and their noise [m] in one component.
POINTS, SIGMA = 200, 0.0005
#: What is concealed [Pa].
TRUTH = {"single": (333.28,), "multi": (1370.0, 1000.0)}


def pressed(tissue: str) -> Case:
    """The coarse phantom under the force of the experiment, with laws that are not the truth."""
    case = find_case("phantom", tissue)
    force = (0.0, 0.0, -FORCE[tissue])
    boundaries = tuple(replace(b, total=force) if isinstance(b, Forced) else b for b in case.boundaries)
    return replace(case, boundaries=boundaries).with_shear_moduli(dict.fromkeys(case.tissues, 800.0))


def observed(case: Case, points: Floats, u: Floats, seed: int, sigma: float = SIGMA) -> Case:
    """The case with some points of the surface that move, with noise."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(np.flatnonzero(u.any(axis=1)), POINTS, replace=False)
    moved = u[chosen] + sigma * rng.normal(size=(POINTS, 3))
    recording = PointsRecording(name="surface", file="", points=points[chosen], displacement=moved, sigma=SIGMA)
    return replace(case, recordings=(recording,))


def error(case: Case, points: Floats, u: Floats, displacement: Floats) -> float:
    """Root mean square error [mm] at the nodes of the surface."""
    from scipy.spatial import cKDTree

    nodes = cKDTree(case.mesh.points).query(points)[1]
    return 1000.0 * float(np.sqrt(np.mean(np.sum((displacement[nodes] - u) ** 2, axis=1))))


def displacement(estimate: Estimate) -> Floats:
    """Of each node [m], shape (n, 3): of the most probable state, less the error of the mesh."""
    return estimate.problem.nuisances.observed(estimate.point.state, estimate.point.nuisances)[0]


def experiment(tissue: str, repetitions: int, options: EstimationOptions | None = None) -> dict[str, Any]:
    """One tissue mode."""
    options = options or EstimationOptions(registration=False)
    with (RESULTS / f"phantom_truth_{tissue}.csv").open(encoding="utf-8") as file:
        table = np.array([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    points, u, case = 0.001 * table[:, :3], 0.001 * table[:, 3:], pressed(tissue)
    truth = np.log(TRUTH[tissue])
    begun = time.perf_counter()
    first = Estimation(observed(case, points, u, 0), None, options, "cpu").run()
    whole = time.perf_counter() - begun
    estimates, intervals, errors = [], [], []
    for seed in range(repetitions):
        found = first.best if seed == 0 else again(first, observed(case, points, u, seed))
        estimates.append(found.theta)
        intervals.append(found.laplace.interval())
        errors.append(error(case, points, u, displacement(found)))
    ends = np.array(intervals)
    covered = (ends[:, :, 0] <= truth) & (truth <= ends[:, :, 1])
    without = Estimation(observed(case, points, u, 0), first.prior, replace(options, discretisation=None), "cpu").run()
    return {
        "tissue": tissue,
        "truth_Pa": TRUTH[tissue],
        "force_N": FORCE[tissue],
        "points": POINTS,
        "sigma_mm": 1000.0 * SIGMA,
        "surface_displacement_rms_mm": 1000.0 * float(np.sqrt(np.mean(np.sum(u**2, axis=1)))),
        "repetitions": repetitions,
        "covered": covered.sum(axis=0).tolist(),
        "all_covered": int(covered.all(axis=1).sum()),
        "mean_estimate_Pa": np.exp(np.mean(estimates, axis=0)).tolist(),
        "scatter_of_estimates": np.std(estimates, axis=0).tolist(),
        "standard_deviation": first.best.laplace.posterior.standard_deviations.tolist(),
        "rmse_mm": {"median": float(np.median(errors)), "largest": float(np.max(errors))},
        "pareto_k": first.importance.smoothed.k,
        "amount_of_mesh_error": first.nuisances[0][1:],
        "first": described(first, case, points, u, truth, whole),
        "without_error_of_mesh": described(without, case, points, u, truth, sum(without.seconds.values())),
    }


def again(first: Posterior, case: Case) -> Estimate:
    """Another estimate with the error of the mesh of the first, from its state."""
    problem = first.best.problem
    other = Problem(problem.forward, Observations.to_fit(case), problem.mode, problem.likelihood, problem.nuisances)
    return GaussNewton(other, 3e-3, lambda _step: None).solve(first.best)


def described(
    posterior: Posterior, case: Case, points: Floats, u: Floats, truth: Floats, spent: float
) -> dict[str, Any]:
    """One whole estimation."""
    ends = np.array([marginal.interval for marginal in posterior.marginals])
    return {
        "estimate_Pa": np.exp(posterior.theta).tolist(),
        "interval_95_Pa": np.exp(ends).tolist(),
        "covered": ((ends[:, 0] <= truth) & (truth <= ends[:, 1])).tolist(),
        "rmse_mm": error(case, points, u, displacement(posterior.best)),
        "equilibria": dict(posterior.solves),
        "seconds": spent,
    }


def same_mesh(tissue: str) -> dict[str, Any]:
    """Without noise, on one mesh: what is left is the method's own error."""
    from warpbrain.estimation.forward import Forward

    case = pressed(tissue)
    truth = np.log(TRUTH[tissue])
    u = Forward(case, truth, "cpu").solve(truth).u
    mesh = case.mesh
    surface = mesh.node_sets["surface"] | mesh.node_sets["ventricle"]
    points, moved = mesh.points[surface], u[surface]
    seen = observed(case, points, moved, 0, sigma=0.0)
    # a prior pulls a little where noise is stated that there is none of: stated small
    recording = replace(seen.recordings[0], sigma=1e-5)  # type: ignore[type-var]
    options = EstimationOptions(discretisation=None, registration=False)
    found = Estimation(replace(seen, recordings=(recording,)), None, options, "cpu").run()
    return {
        "tissue": tissue,
        "relative_error": (np.exp(found.theta - truth) - 1.0).tolist(),
        "rmse_mm": error(case, points, moved, displacement(found.best)),
    }


def main() -> None:
    """Everything, into one file."""
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else REPETITIONS
    found = {
        "same_mesh_no_noise": [same_mesh(tissue) for tissue in TRUTH],
        "other_mesh": [experiment(tissue, repetitions) for tissue in TRUTH],
    }
    text = json.dumps(found, indent=1)
    print(text)
    Path(RESULTS / "concealed_phantom.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
