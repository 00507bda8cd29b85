"""``python -m referee challenge export|pack|unpack|baselines|tool|commit|score|leaderboard``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from referee.errors import InputError

if TYPE_CHECKING:
    from referee.challenge.answers import Answer

#: The cases of an exported set, in its folder: what is scored.
LIST = "cases.txt"


def add_challenge(commands: Any) -> None:
    """Add the command to those of the referee."""
    challenge = commands.add_parser("challenge", help="cases in a neutral format, scores of any code's answers")
    parts = challenge.add_subparsers(dest="part", required=True)
    export = parts.add_parser("export", help="write cases in the neutral format")
    export.add_argument("--cases", type=Path, required=True, help="folder of case folders")
    pack = parts.add_parser("pack", help="write cases that share declared bodies small, a file for each body")
    pack.add_argument("folder", type=Path, help="gets a file of each body and mesh")
    pack.add_argument("--cases", type=Path, required=True, help="folder of case folders")
    unpack = parts.add_parser("unpack", help="write packed cases as export writes them")
    unpack.add_argument("--packed", type=Path, default=Path("bench/challenge"), help="where pack wrote")
    baselines = parts.add_parser("baselines", help="answer by forward selection, LASSO, relevance vectors, discrepancy")
    baselines.add_argument("folder", type=Path, help="where export wrote")
    baselines.add_argument("--out", type=Path, required=True, help="folder that gets METHOD.csv")
    for parser in (export, unpack):
        parser.add_argument("folder", type=Path, help="gets CASE.npz, the folder CASE and cases.txt")
        parser.add_argument("--only", default="", help="names of cases, separated by commas; all if absent")
    for parser in (export, pack, unpack, baselines):
        parser.add_argument("--workers", type=int, default=1, help="processes")
    tool = parts.add_parser("tool", help="turn diagnoses of warpbrain into answers")
    tool.add_argument("folder", type=Path, help="where export wrote")
    tool.add_argument("--diagnoses", type=Path, required=True, help="folder with CASE/diagnosis.json")
    tool.add_argument("--out", type=Path, required=True, help="table that is written")
    commit = parts.add_parser("commit", help="write the hash of answers, to be published before labels are")
    commit.add_argument("answers", type=Path)
    score = parts.add_parser("score", help="check both commitments, open the labels, and score")
    score.add_argument("answers", type=Path)
    score.add_argument("labels", type=Path, help="folder of sealed labels")
    score.add_argument("--cases", type=Path, help="list of the cases that count; all with a label if absent")
    score.add_argument("--commitment", type=Path, help="the hash of the answers; ANSWERS.sha256 if absent")
    score.add_argument("--commitments", type=Path, help="hashes of the labels; commitments.txt beside them if absent")
    score.add_argument("--about", default="", help="which code, of which version")
    score.add_argument("--set", default="", dest="of_set", help="which cases, in words")
    score.add_argument("--out", type=Path, help="file of scores, for the leaderboard")
    board = parts.add_parser("leaderboard", help="make the page from all scores")
    board.add_argument("--results", type=Path, default=Path("bench/results/challenge"))
    board.add_argument("--out", type=Path, default=Path("bench/results/challenge/README.md"))


def challenge(given: argparse.Namespace) -> int:
    """Run a part of the command."""
    return _PARTS[given.part](given)


def _export(given: argparse.Namespace) -> int:
    from referee.challenge.export import export

    count = export(given.cases, given.folder, [name for name in given.only.split(",") if name], given.workers)
    print(f"{count} cases in {given.folder}")
    return 0


def _pack(given: argparse.Namespace) -> int:
    from referee.challenge.pack import pack

    print(f"{pack(given.cases, given.folder, given.workers)} bodies in {given.folder}")
    return 0


def _unpack(given: argparse.Namespace) -> int:
    from referee.challenge.unpack import unpack

    count = unpack(given.packed, given.folder, [name for name in given.only.split(",") if name], given.workers)
    print(f"{count} cases in {given.folder}")
    return 0


def _baselines(given: argparse.Namespace) -> int:
    from referee.baselines import METHODS
    from referee.challenge.answers import write_answers
    from referee.threads import mapped

    names = _names(given.folder)
    answers = []
    with mapped(given.workers) as each:
        for of_case in each(_of_baselines, [given.folder / f"{name}.npz" for name in names]):
            answers.append(of_case)
            words = (f"{method}: {answer.verdict} {' '.join(answer.names)}" for method, answer in of_case.items())
            print(f"{names[len(answers) - 1]}: {', '.join(words)}", flush=True)
            # what is interrupted leaves the answers that there are
            for method in METHODS:
                write_answers(given.out / f"{method}.csv", [of_case[method] for of_case in answers])
    return 0


def _of_baselines(file: Path) -> dict[str, Answer]:
    from referee.baselines import answers_of
    from referee.challenge.neutral import read_case

    return answers_of(read_case(file))


def _tool(given: argparse.Namespace) -> int:
    from referee.challenge.answers import write_answers
    from referee.challenge.of_tool import answers_of_tool

    answers = answers_of_tool(_names(given.folder), given.diagnoses)
    write_answers(given.out, answers)
    print(f"{len(answers)} answers")
    return 0


def _commit(given: argparse.Namespace) -> int:
    from referee.challenge.answers import commit

    print(f"{commit(given.answers)}  {given.answers.name}")
    return 0


def _score(given: argparse.Namespace) -> int:
    from referee.challenge.answers import COMMITMENT
    from referee.challenge.score import score, write_scores
    from referee.intervals import Share
    from referee.sealed import COMMITMENTS

    scores = score(
        given.answers,
        given.labels,
        commitment=given.commitment or given.answers.with_name(given.answers.name + COMMITMENT),
        commitments=given.commitments or given.labels / COMMITMENTS,
        cases=given.cases,
        about=given.about,
        of_set=given.of_set,
    )
    for name, counts in (scores["shares"] | scores["mechanisms"]).items():
        print(f"{name}: {Share(counts['hits'], counts['of'])}")
    known = scores["calibration"]
    if known["of"]:
        print(
            f"calibration error of {known['of']} stated probabilities: {known['ece']:.3f}; Brier: {known['brier']:.3f}"
        )
    if given.out:
        write_scores(given.out, scores)
    return 0


def _leaderboard(given: argparse.Namespace) -> int:
    from referee.challenge.leaderboard import leaderboard

    given.out.write_text(leaderboard(given.results), encoding="utf-8")
    return 0


def _names(folder: Path) -> list[str]:
    try:
        return (folder / LIST).read_text(encoding="ascii").split()
    except OSError as error:
        raise InputError(f"{folder}: {error}; first: challenge export {folder}") from None


_PARTS = {
    "export": _export,
    "pack": _pack,
    "unpack": _unpack,
    "baselines": _baselines,
    "tool": _tool,
    "commit": _commit,
    "score": _score,
    "leaderboard": _leaderboard,
}
