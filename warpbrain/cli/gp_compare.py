"""`warpbrain gp compare`: which model predicts studies that it has not seen."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain gp`."""
    parser = actions.add_parser(
        "compare",
        help="score models on studies that they have not seen",
        description="Leaves out each study of the literature, or each paper with all its studies, fits every model "
        "again without it and scores what it says of it. Takes minutes to half an hour; models that are in the file "
        "already are not scored again, so that it goes on where it was interrupted.",
    )
    parser.add_argument(
        "--variant", choices=("corrected", "as_published"), default="corrected", help="of the literature"
    )
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
    from warpbrain.gp.candidates import candidates
    from warpbrain.gp.leaving_out import folds, leave_out
    from warpbrain.gp.literature.studies import read_studies
    from warpbrain.gp.score_table import read_scores, score_lines, write_scores
    from warpbrain.terminal.progress import Progress

    path = options.csv or Path(f"warpbrain-gp-{options.variant}-{options.leave}.csv")
    check_writable(path)
    studies = read_studies(options.variant)
    held = list(folds(studies, options.leave))
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
    print(*score_lines([score for score in scores if options.only in score.name]), sep="\n")
    print("", f"written to {path}", sep="\n")
