"""Fitting a model of either kind to the literature, with a record of how it went."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from warpbrain.gp.coregionalised import Coregionalised, training_points
from warpbrain.gp.literature.groups import GROUPS
from warpbrain.gp.literature.studies import Variant, read_studies
from warpbrain.gp.process import Process
from warpbrain.gp.trained import Kind, fitted_hierarchical
from warpbrain.gp.training import Climb, train


def fit_model(
    kind: Kind = "hierarchical",
    variant: Variant = "corrected",
    add: Path | None = None,
    *,
    climbs: int = 1,
    progress: Callable[[float, str], None] = lambda part, said: None,
) -> tuple[Process, dict[str, Any]]:
    """Fit a model to the literature and to the studies of a user's file.

    Parameters
    ----------
    kind : {"hierarchical", "coregionalised"}
    variant : {"corrected", "as_published"}
    add : Path, optional
        File of studies, see `warpbrain.gp.literature.reading`.
    climbs : int
        Of the coregionalised process, see `warpbrain.gp.training.train`.
    progress : callable
        Is told the part done, 0 to 1, and what is going on.

    Returns
    -------
    model : Process
    record : dict
        Objective, convergence, restarts, conditioning and seconds; for `write_model` and for the reader.

    Raises
    ------
    InputError
        If the file of studies is wrong.
    SolveError
        If no covariance can be factored.
    """
    began = time.perf_counter()
    studies = read_studies(variant, add)
    command = f"warpbrain gp fit --gp {kind} --variant {variant}" + (f" --climbs {climbs}" if climbs > 1 else "")
    record: dict[str, Any] = {"command": command + (" --add studies.toml" if add else ""), "studies": len(studies)}
    model: Process
    if kind == "hierarchical":
        progress(0.0, "climbing")
        model, fitted = fitted_hierarchical(studies, variant)
        record |= asdict(fitted)
    else:
        data = training_points(studies)
        training = train(data, climbs=climbs, progress=progress)
        model = Coregionalised(studies, training.best.parameters, variant, training.kernel, training.jitter)
        record |= {
            "points": int(data.count.sum()),
            "means of replicates": data.size,
            "jitter": training.jitter,
            "negative log likelihood": training.best.value,
            "climbs": [_described(climb) for climb in training.climbs],
            "starts": [
                {"apart": None if start.apart is None else GROUPS[start.apart], "every": training.step}
                | _described(start.climb)
                for start in training.starts
            ],
        }
    record["seconds"] = time.perf_counter() - began
    return model, record


def _described(climb: Climb) -> dict[str, Any]:
    table = asdict(climb)
    del table["parameters"]
    return table
