"""`warpbrain gp compare`: which model predicts studies that it has not seen."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from warpbrain.cli.gp.choice import VARIANTS


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain gp`."""
    parser = actions.add_parser(
        "compare",
        help="score models on studies that they have not seen",
        description="Leaves out each study of the literature, or each paper with all its studies, fits every model "
        "again without it and scores what it says of it: log predictive density, with a sign test against the "
        "default model, and how many levels are within intervals, by method of measurement. Takes minutes to half an "
        "hour; models that are in the file already are not scored again, so that it goes on where it was interrupted.",
    )
    parser.add_argument("--variant", choices=VARIANTS, default=VARIANTS[0], help=f"default: {VARIANTS[0]}")
    parser.add_argument(
        "--leave", choices=("paper", "study"), default="paper", help="what is left out (default: paper)"
    )
    parser.add_argument("--only", metavar="TEXT", default="", help="only models that have this in their name")
    parser.add_argument(
        "--csv", type=Path, metavar="FILE", help="file to write (default: warpbrain-gp-VARIANT-LEAVE.csv)"
    )
    parser.set_defaults(call=_compare)


def _compare(options: argparse.Namespace) -> None:
    from warpbrain.atomic import check_writable
    from warpbrain.errors import InputError
    from warpbrain.gp.candidates import DEFAULT, candidates
    from warpbrain.gp.leaving_out import calibration, compared, folds, leave_out, methods_of
    from warpbrain.gp.literature.studies import read_studies
    from warpbrain.gp.score_table import (
        calibration_lines,
        comparison_lines,
        read_scores,
        score_lines,
        write_scores,
    )
    from warpbrain.terminal.progress import Progress

    path = options.csv or Path(f"warpbrain-gp-{options.variant}-{options.leave}.csv")
    check_writable(path)
    studies = read_studies(options.variant)
    left = folds(studies, options.leave)
    held = list(left)
    scores = read_scores(path, held)
    done = {score.name for score in scores}
    chosen = [candidate for candidate in candidates() if options.only in candidate.name]
    if not chosen:
        names = ", ".join(candidate.name for candidate in candidates())
        raise InputError(f"--only {options.only!r}: no model has this in its name (there are: {names})")
    for candidate in chosen:
        if candidate.name not in done:
            bar = Progress(f"{candidate.name:<46}")
            scores.append(leave_out(candidate, studies, options.leave, bar.show))
            bar.clear()
            write_scores(path, scores, held)
    papers = len({study.paper for study in studies})
    print(f"{len(studies)} studies of {papers} papers, one {options.leave} after the other left out:")
    shown = [score for score in scores if options.only in score.name]
    print(*score_lines(shown), sep="\n")
    for score in shown:
        if score.levels:
            lines = calibration_lines(calibration(score, methods_of(left)), options.leave)
            title = f"{score.name}: {options.leave}s whose level is within an interval (95 % interval of that part)"
            print("", title, *lines, sep="\n")
    default = next((score for score in scores if score.name == DEFAULT), None)
    others = [score for score in shown if score.name != DEFAULT]
    if default is not None and others:
        print("", *comparison_lines(default.name, [compared(default, other) for other in others]), sep="\n")
    print("", f"written to {path}", sep="\n")
