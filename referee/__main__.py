"""The referee: ``python -m referee make|run|see|analyse|score|calibrate|challenge|mesh``. See docs/referee.md."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from referee.challenge.commands import add_challenge, challenge
from referee.errors import InputError

if TYPE_CHECKING:
    from referee.outcomes import ScoredSet


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m referee", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="make a set of cases and seal what is true of them")
    sets = ("development", "calibration", "scored", "traps", "pairs", "unknown", "challenge")
    make.add_argument("--set", required=True, choices=sets, dest="which")
    make.add_argument("--count", type=int, help="how many; 24, 80, 160, 60, 100, 100 or 500 if absent")
    make.add_argument("--out", type=Path, required=True)
    make.add_argument(
        "--geometry", nargs="+", help="bodies, in turn; phantom 0603 or, for what is not scored, phantom 0529"
    )
    make.add_argument("--bodies", type=int, help="declared bodies that the cases share; each has its own if absent")
    make.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    make.add_argument("--seed", default="1", help="any text, such as the hash of the commit that froze the tool")
    run = commands.add_parser("run", help="let the tool diagnose every case, as a user would")
    run.add_argument("--cases", type=Path, required=True)
    run.add_argument("--out", type=Path, required=True)
    run.add_argument("--device", help="given to the tool")
    run.add_argument("--workers", type=int, default=1, help="processes")
    run.add_argument("--tool-args", default="", help='more for the tool, such as "--ablation no-nuisances"')
    run.add_argument("--limit", type=float, help="seconds of a case, after which it counts as without a diagnosis")
    run.add_argument(
        "--leave-out",
        metavar="MECHANISM",
        help="take a mechanism out of the tool's dictionary; 'each': out of each case its own, which needs --labels",
    )
    run.add_argument("--labels", type=Path, help="with --leave-out: run the cases of these alone that it is true of")
    run.add_argument("--commitments", type=Path, help="the published hashes; beside the labels if absent")
    analyse = commands.add_parser("analyse", help="open the labels and find how often the optimal analyst is right")
    analyse.add_argument(
        "--out", type=Path, required=True, help="gets a file for each case; score --analysed reads them"
    )
    analyse.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    see = commands.add_parser("see", help="open the labels and find how much what acts stands out for the tool")
    score = commands.add_parser("score", help="open the labels and compare")
    score.add_argument("--out", type=Path, required=True)
    score.add_argument("--no-baselines", action="store_true", help="leave the baselines out")
    score.add_argument("--analysed", type=Path, help="where analyse wrote: its shares stand beside the tool's")
    score.add_argument(
        "--beside", action="append", default=[], metavar="NAME=DIR", help="another run to compare with; may be repeated"
    )
    calibrate = commands.add_parser("calibrate", help="fit the numbers of the tool's calibration.json")
    calibrate.add_argument("--write", type=Path, help="that of the package if absent")
    calibrate.add_argument("--price-alone", action="store_true", help="the temperature stays, of more cases than these")
    published = "the published hashes; commitments.txt beside the labels if absent"
    for parser_of in (see, analyse):
        parser_of.add_argument("--labels", type=Path, required=True)
        parser_of.add_argument("--commitments", type=Path, help=published)
    see.add_argument("--diagnoses", type=Path, required=True, help="where run wrote")
    for parser_of in (score, calibrate):
        parser_of.add_argument("--cases", type=Path, nargs="+", required=True, help="of each of several sets")
        parser_of.add_argument("--labels", type=Path, nargs="+", required=True)
        parser_of.add_argument("--commitments", type=Path, nargs="+", help=published)
        parser_of.add_argument("--diagnoses", type=Path, nargs="+", required=True, help="where run wrote")
    add_challenge(commands)
    commands.add_parser("mesh", help="make the meshes of truths anew, with MMG")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 2 if something that was given is wrong."""
    given = _parser().parse_args(arguments)
    try:
        return _COMMANDS[given.command](given)
    except _wrong_input() as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _wrong_input() -> tuple[type[Exception], ...]:
    """What is raised of wrong input; who takes part in the challenge needs no `warpbrain`."""
    try:
        import warpbrain.errors
    except ImportError:
        return (InputError,)
    return InputError, warpbrain.errors.InputError


def _make(given: argparse.Namespace) -> int:
    from referee.geometry import NAMES
    from referee.make import make_set
    from referee.plan import SETS

    geometries = given.geometry or (
        ["phantom", "phantom", "0529" if given.which in ("development", "calibration") else "0603"]
    )
    for name in geometries:
        if name not in NAMES:
            raise InputError(f"--geometry {name}: expected one of {', '.join(NAMES)}")
    count = SETS[given.which] if given.count is None else given.count
    if min(count, given.workers, 1 if given.bodies is None else given.bodies) < 1:
        raise InputError("--count, --workers and --bodies: expected 1 or more")
    not_made = make_set(given.which, count, given.out, geometries, given.workers, given.seed, given.bodies)
    return int(bool(not_made))


def _run(given: argparse.Namespace) -> int:
    from referee.run import run_all

    if given.limit is not None and not given.limit > 0.0:
        raise InputError(f"--limit {given.limit:g}: expected more than 0 s")
    left_out = _left_out(given) if given.leave_out else None
    words = given.tool_args.split()
    return run_all(given.cases, given.out, given.device, given.workers, words, given.limit, left_out)


def _left_out(given: argparse.Namespace) -> dict[str, str]:
    """By case the mechanism that its dictionary is without."""
    from referee.draw import MECHANISMS
    from referee.run import case_folders
    from referee.sealed import open_labels

    if given.leave_out not in (*MECHANISMS, "each"):
        raise InputError(f"--leave-out {given.leave_out}: expected each or one of {', '.join(MECHANISMS)}")
    if given.labels is None:
        if given.leave_out == "each":
            raise InputError("--leave-out each: needs --labels, which say what is to be left out")
        return {folder.name: given.leave_out for folder in case_folders(given.cases)}
    opened = open_labels(given.labels, _commitments(given))
    alone = {name: label["names"][0] for name, label in opened.items() if label["kind"] == "effect"}
    return {name: true for name, true in alone.items() if given.leave_out in ("each", true)}


def _analyse(given: argparse.Namespace) -> int:
    from referee.analyst import analyse
    from referee.sealed import open_labels

    analyse(open_labels(given.labels, _commitments(given)), given.out, given.workers)
    return 0


def _see(given: argparse.Namespace) -> int:
    from referee.sealed import open_labels
    from referee.seen_by_tool import write_seen

    found = write_seen(open_labels(given.labels, _commitments(given)), given.diagnoses)
    print(f"{len(found)} cases with effects")
    return 0


def _score(given: argparse.Namespace) -> int:
    from referee.score import score_all

    if given.beside and len(given.cases) > 1:
        raise InputError("--beside: expected one set")
    beside = {}
    for text in given.beside:
        name, equals, folder = text.partition("=")
        if not (name and equals and Path(folder).is_dir()):
            raise InputError(f"--beside {text}: expected NAME=DIR with a folder that is there")
        beside[name] = Path(folder)
    print(score_all(_sets(given), given.out, not given.no_baselines, beside, given.analysed))
    return 0


def _calibrate(given: argparse.Namespace) -> int:
    from referee.calibrate import FILE, calibrate

    print(calibrate(_sets(given), given.write or FILE, given.price_alone))
    return 0


def _sets(given: argparse.Namespace) -> list[ScoredSet]:
    from referee.outcomes import ScoredSet

    commitments = given.commitments or [labels / "commitments.txt" for labels in given.labels]
    folders = (given.cases, given.labels, commitments, given.diagnoses)
    if len({len(each) for each in folders}) > 1:
        raise InputError("expected as many --cases as --labels, --commitments and --diagnoses")
    return [ScoredSet(*each) for each in zip(*folders, strict=True)]


def _commitments(given: argparse.Namespace) -> Path:
    path: Path = given.commitments or given.labels / "commitments.txt"
    return path


def _mesh(given: argparse.Namespace) -> int:
    from referee.meshing import make_meshes

    make_meshes()
    return 0


_COMMANDS = {
    "make": _make,
    "run": _run,
    "see": _see,
    "analyse": _analyse,
    "score": _score,
    "calibrate": _calibrate,
    "challenge": challenge,
    "mesh": _mesh,
}

if __name__ == "__main__":
    sys.exit(main())
