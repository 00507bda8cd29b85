"""Opens the labels, verifies that they are those which were committed to, and scores what the tool said."""

from __future__ import annotations

import json
from pathlib import Path

from referee.figures import draw_figures
from referee.labels import open_labels
from referee.outcomes import read_outcomes
from referee.scores import amounts, calibration, confusion, shares
from referee.tables import score_text
from warpbrain.errors import InputError


def score_all(cases: Path, labels: Path, commitments: Path, diagnoses: Path, out: Path, compared: bool) -> str:
    """Write `score.json`, `score.md` and figures.

    Parameters
    ----------
    cases, labels, diagnoses : Path
        Folders of case folders, of sealed labels and of what `run` wrote.
    commitments : Path
        Published hashes of the labels.
    out : Path
    compared : bool
        Whether the baselines diagnose the cases too.

    Returns
    -------
    str
        The page of scores.

    Raises
    ------
    InputError
        If a label is not the one that was committed to, or a diagnosis is not one.
    """
    opened = open_labels(labels, commitments)
    outcomes, missing = read_outcomes(opened, diagnoses)
    if not outcomes:
        raise InputError(f"{diagnoses}: no diagnosis of any case")
    found, calibrated, measured = shares(outcomes), calibration(outcomes), amounts(outcomes)
    confused = confusion(outcomes)
    baselines = {}
    if compared:
        from referee.baselines import compare

        baselines = compare(cases, outcomes)
    text = score_text(found, calibrated, measured, confused, baselines, outcomes, missing)
    out.mkdir(parents=True, exist_ok=True)
    told = {
        "cases": len(outcomes),
        "without_diagnosis": missing,
        "shares": {name: value.told() for name, value in found.items()},
        "calibration": calibrated,
        "measured": measured,
        "baselines": {m: {name: value.told() for name, value in row.items()} for m, row in baselines.items()},
        "draws_given_up": sum(len(label["attempts"]) for label in opened.values()),
    }
    (out / "score.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    (out / "score.md").write_text(text, encoding="utf-8")
    draw_figures(out, confused, calibrated, outcomes)
    return text
