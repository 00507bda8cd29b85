"""Opens the labels, verifies that they are those which were committed to, and scores what the tool said."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from referee.analysed import NOT_ASKED, Analysis, analysts, read_analyses, rightness, with_conditionals
from referee.errors import InputError
from referee.figures import draw_figures
from referee.intervals import Share
from referee.outcomes import Outcome, ScoredSet, read_outcomes
from referee.scores import amounts, calibration, confusion, shares
from referee.sealed import open_labels
from referee.tables import score_text


def score_all(
    sets: Sequence[ScoredSet], out: Path, compared: bool, beside: Mapping[str, Path], analysed: Path | None = None
) -> str:
    """Write `score.json`, `score.md` and figures.

    Parameters
    ----------
    sets : sequence of ScoredSet
        Scored as one. If there are several, names of cases begin with the number of theirs, and nothing stands beside.
    out : Path
    compared : bool
        Whether the baselines diagnose the cases too.
    beside : mapping of str to Path
        Other runs of the same cases by name, such as an ablation, to be compared with.
    analysed : Path, optional
        What `analyse` wrote: the optimal analyst's shares stand beside all others; of several sets in folders 1, 2 ...

    Returns
    -------
    str
        The page of scores.

    Raises
    ------
    InputError
        If a label is not the one that was committed to, a diagnosis is not one, or another run has no case in common.
    """
    opened: dict[str, Mapping[str, Any]] = {}
    outcomes: list[Outcome] = []
    missing: list[str] = []
    folders: dict[str, Path] = {}
    analyses: dict[str, Analysis] = {}
    for number, each in enumerate(sets, 1):
        prefix = f"{number}/" if len(sets) > 1 else ""
        of_set: Mapping[str, Mapping[str, Any]] = open_labels(each.labels, each.commitments)
        known = read_analyses(analysed / prefix, of_set) if analysed else {}
        of_set = {name: with_conditionals(label, known.get(name)) for name, label in of_set.items()}
        diagnosed, silent = read_outcomes(of_set, each.diagnoses)
        if not diagnosed:
            raise InputError(f"{each.diagnoses}: no diagnosis of any case")
        opened |= {prefix + name: label for name, label in of_set.items()}
        analyses |= {prefix + name: analysis for name, analysis in known.items()}
        folders |= {prefix + o.name: each.cases / o.name for o in diagnosed}
        outcomes += [replace(o, name=prefix + o.name) for o in diagnosed]
        missing += [prefix + name for name in silent]
    scored, calibrated, measured = shares(outcomes), calibration(outcomes), amounts(outcomes)
    confused = confusion(outcomes)
    baselines = {}
    if compared:
        from referee.compared import compare

        baselines = compare([folders[o.name] for o in outcomes], outcomes)
    others = _beside(opened, outcomes, beside) if beside else {}
    of_analyst = [o for outcome in outcomes for o in analysts(outcome, analyses)]
    optimal = {name: value for name, value in shares(of_analyst).items() if not name.startswith(NOT_ASKED)}
    right = {o.name: value for o in outcomes if (value := rightness(o, analyses)) is not None}
    text = score_text(scored, calibrated, measured, confused, baselines, others, outcomes, missing, optimal, right)
    out.mkdir(parents=True, exist_ok=True)
    summary = {
        "cases": len(outcomes),
        "without_diagnosis": missing,
        "shares": {name: value.described() for name, value in scored.items()},
        "optimal": {name: value.value for name, value in optimal.items()},
        "optimal analyst asked": len({o.name for o in of_analyst}),
        "calibration": calibrated,
        "measured": measured,
        "baselines": {m: {name: value.described() for name, value in row.items()} for m, row in baselines.items()},
        "beside": {name: {key: value.described() for key, value in row.items()} for name, row in others.items()},
        "draws_given_up": sum(len(label["attempts"]) for label in opened.values()),
    }
    (out / "score.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    (out / "score.md").write_text(text, encoding="utf-8")
    draw_figures(out, confused, calibrated, outcomes)
    return text


def _beside(
    opened: Mapping[str, Mapping[str, Any]], outcomes: Sequence[Outcome], beside: Mapping[str, Path]
) -> dict[str, dict[str, Share]]:
    """Shares of the run and of others, in the cases that all of them have diagnosed."""
    runs = {"the run": outcomes, **{name: read_outcomes(opened, folder)[0] for name, folder in beside.items()}}
    all_of = set.intersection(*({o.name for o in of_run} for of_run in runs.values()))
    if not all_of:
        raise InputError(f"--beside: no case that the run, {' and '.join(beside)} all have diagnosed")
    return {name: shares([o for o in of_run if o.name in all_of]) for name, of_run in runs.items()}
