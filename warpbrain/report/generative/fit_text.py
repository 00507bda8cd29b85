"""How the fit of a generative model went, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpbrain.gp.process import Process


def fit_lines(model: Process, record: Mapping[str, Any]) -> list[str]:
    """Objective, convergence, restarts, conditioning and time.

    Parameters
    ----------
    model : Process
    record : mapping
        Of `warpbrain.gp.trained.fit_model`.
    """
    lines = [f"{model.name} model of the literature as {model.variant}, {record['studies']} studies"]
    if "climbs" not in record:
        said = "converged" if record["converged"] else "NOT converged"
        lines += [
            f"  objective   {record['objective']:.3f} (negative log of likelihood times prior)",
            f"  {said} after {record['iterations']} iterations: {record['message']}",
            f"  condition   {record['condition']:.2g} of the covariance; no jitter: what studies leave open is in it",
        ]
    else:
        starts = record["starts"]
        lines += [
            f"  objective   {record['negative log likelihood']:.3f} (negative log marginal likelihood of "
            f"{record['points']} points, {record['means of replicates']} means)",
            f"  jitter      {record['jitter']:g} on the diagonal",
            f"  starts      {len(starts)} on every {starts[0]['every']}th stretch, values "
            f"{starts[0]['value']:.2f} to {starts[-1]['value']:.2f}; best: {_arrangement(starts[0])}",
        ]
        for index, climb in enumerate(record["climbs"], 1):
            said = "converged" if climb["converged"] else "NOT converged"
            lines.append(
                f"  climb {index}     {climb['value']:.3f}, {said} after {climb['iterations']} iterations, last gain "
                f"{climb['gain']:.1g}, largest derivative {climb['gradient']:.2g}, condition {climb['condition']:.1g}"
            )
    return [*lines, f"  time        {record['seconds']:.1f} s"]


def _arrangement(start: Mapping[str, Any]) -> str:
    return "all groups together" if start["apart"] is None else f"{start['apart']} apart"
