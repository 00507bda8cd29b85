"""What a posterior costs beside the paper's sweep of 289 equilibria: processor seconds, one thread.

python bench/estimation_cost.py [CASE]      # writes results/estimation_cost.json
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from phantom_truth import RESULTS

from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.estimation.estimate import Estimation
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.parameters import prior_of
from warpbrain.estimation.problem import Nuisances
from warpbrain.estimation.sweep import sweep
from warpbrain.gp.trained import trained


def error(found: Any) -> float:
    """Root mean square error at all fitted recordings [mm]."""
    return 1000.0 * found.overall_errors[0].after


def main() -> None:
    """Estimate, then sweep, on the CPU."""
    case = find_case(sys.argv[1] if len(sys.argv) > 1 else "0529", "multi")
    prior = prior_of(case)
    options = EstimationOptions()
    # kernels are loaded before the clock runs
    Estimation(case, prior, options, "cpu").fit(Nuisances())
    found: dict[str, Any] = {"case": case.name}
    begun = time.process_time()
    estimation = Estimation(case, prior, replace(options, discretisation=None), "cpu")
    estimation.fit(Nuisances())
    found["Gauss-Newton and Laplace"] = {
        "seconds": time.process_time() - begun,
        "equilibria": estimation.forward.solves,
    }
    for name, given in (("with the check", None), ("with the error of the mesh and the check", options.discretisation)):
        begun = time.process_time()
        posterior = Estimation(case, prior, replace(options, discretisation=given), "cpu").run()
        found[name] = {
            "seconds": time.process_time() - begun,
            "equilibria": dict(posterior.solves),
            "rmse_mm": error(posterior),
        }
    begun = time.process_time()
    swept = sweep(case, trained("coregionalised", "as_published"), device="cpu")
    found["sweep"] = {
        "seconds": time.process_time() - begun,
        "equilibria": len(swept.points),
        "rmse_mm": 1000.0 * (swept.best.error or 0.0),
    }
    begun = time.process_time()
    forward = Forward(case, np.array(swept.points[0].theta), "cpu")
    for point in swept.points:
        # as 289 runs would: each from rest
        with suppress(SolveError):
            forward.solve(np.array(point.theta))
    found["sweep, each from rest"] = {"seconds": time.process_time() - begun, "equilibria": forward.solves}
    print(json.dumps(found, indent=1))
    (RESULTS / "estimation_cost.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
