"""Reads what the tool said of a calibration set, and prints the numbers of `warpbrain/diagnosis/calibration.py`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from referee.diagnoses import UNKNOWN
from referee.intervals import share
from referee.labels import open_labels
from referee.outcomes import Outcome, read_outcomes
from referee.reliability import reliability
from referee.scores import ALPHA
from referee.temperature import Ballots, Scale, conformal, fit, held_out, intervals
from warpbrain.diagnosis.calibration import BODIES
from warpbrain.errors import InputError

#: Fewest cases that a temperature is fitted to.
FEWEST = 10


def calibrate(cases: Path, labels: Path, commitments: Path, diagnoses: Path) -> str:
    """Fit the temperature and offsets, and the threshold of the alarm.

    Parameters
    ----------
    cases, labels, diagnoses : Path
        Folders of case folders, of sealed labels and of what `run` wrote; cases that are not in `cases` are left out.
    commitments : Path
        Published hashes of the labels.

    Returns
    -------
    str
        What was found, to be read.

    Raises
    ------
    InputError
        If a label or a diagnosis is not one, or there are too few cases in which something is missing.
    """
    opened = {name: label for name, label in open_labels(labels, commitments).items() if (cases / name).is_dir()}
    outcomes, missing = read_outcomes(opened, diagnoses)
    asked = [o for o in outcomes if o.kind != "none" and o.said.p_value <= ALPHA]
    useful = [o for o in asked if any(o.holds(row) for row in o.said.tried)]
    if len(useful) < FEWEST:
        raise InputError(
            f"{diagnoses}: {len(useful)} cases in which something is missing raised an alarm and had the truth among "
            f"what was tried; expected {FEWEST} or more"
        )
    ballots = ballots_of(useful)
    found, (low, high) = fit(ballots), intervals(ballots)
    now = Scale(BODIES.temperature, BODIES.unknown, BODIES.alternative)
    kinds = ", ".join(f"{sum(o.kind == kind for o in useful)} {kind}" for kind in ("effect", "two", "outside", "trap"))
    lines = [
        f"{len(outcomes)} cases, {len(missing)} without a diagnosis; fitted to {len(useful)} with an alarm: {kinds}.",
        f"Left out: {len(asked) - len(useful)} whose truth was not among what was tried.",
        "",
        f"{'':22}{'now':>8}{'fitted':>9}   95 % interval",
    ]
    for name in ("temperature", "unknown", "alternative"):
        ends = f"{getattr(low, name):.2f} to {getattr(high, name):.2f}"
        lines.append(f"{name:22}{getattr(now, name):8.2f}{getattr(found, name):9.2f}   {ends}")
    lines += ["", *_before_and_after(ballots, now), "", *_alarm(outcomes)]
    return "\n".join(lines)


def ballots_of(outcomes: Sequence[Outcome]) -> Ballots:
    """Evidences of what was tried in each case, in one table."""
    count = max(len(o.said.tried) for o in outcomes)
    evidence = np.full((len(outcomes), count), -np.inf)
    flags = np.zeros((3, len(outcomes), count), dtype=bool)
    for i, o in enumerate(outcomes):
        for k, row in enumerate(o.said.tried):
            assert row.log_evidence is not None
            evidence[i, k] = row.log_evidence
            flags[:, i, k] = o.holds(row), row.name == UNKNOWN, row.alternative
    return Ballots(evidence, *flags)


def _before_and_after(ballots: Ballots, now: Scale) -> list[str]:
    tried = np.isfinite(ballots.evidence)
    lines = ["mean log loss and calibration error of all probabilities:"]
    for name, p in (("now", ballots.probabilities(now)), ("fitted to the other four fifths", held_out(ballots))):
        true = (p * ballots.right).sum(axis=1)
        found = reliability(p[tried], ballots.right[tried])
        loss = -np.log(np.maximum(true, 1e-300)).mean()
        lines.append(f"  {name}: {loss:.3f}, {found['ece']:.3f}")
        lines += [f"    stated {q:.2f}: right {r:.2f} of {n}" for q, r, n in found["rows"]]
    return lines


def _alarm(outcomes: Sequence[Outcome]) -> list[str]:
    p_values: NDArray[np.float64] = np.array([o.said.p_value for o in outcomes if o.kind == "none"])
    threshold = conformal(p_values.tolist(), ALPHA)
    told = "too few of them" if threshold is None else f"p < {threshold:.4f}"
    return [
        f"nothing missing, p <= {ALPHA:g}: {share(bool(p <= ALPHA) for p in p_values)}",
        f"conformal threshold of the alarm for {ALPHA:g}: {told}",
    ]
