"""`warpbrain cases`: list, show, check, begin and rebuild cases."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from warpbrain.cli import build, new


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    cases = commands.add_parser(
        "cases",
        help="the cases that ship with the package, and a user's own",
        description="Without an action, lists the cases that ship with the package.",
    )
    cases.set_defaults(call=_list)
    actions = cases.add_subparsers(dest="action", metavar="ACTION")
    _add_show(actions)
    _add_check(actions)
    new.add_parser(actions)
    build.add_parser(actions)
    schema = actions.add_parser("schema", help="print the JSON Schema of case.toml")
    schema.set_defaults(call=_schema)


def _add_show(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "show",
        help="print a case and draw it",
        description="Prints what a case says and writes a picture: the anatomy cut open, tissues, node sets, recorded "
        "arrows.",
    )
    parser.add_argument("name", metavar="NAME", help="a shipped case, or the path of a case folder")
    parser.add_argument("--tissue", choices=("single", "multi"), default="multi", help="default: multi")
    parser.add_argument("--out", type=Path, metavar="PNG", help="the picture (default: warpbrain-CASE-TISSUE.png)")
    parser.set_defaults(call=_show)


def _add_check(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "check",
        help="check a case folder completely",
        description="Reads everything in a case folder and prints all that is wrong with it, each with the file, the "
        "key or row and the cure; also the quality of the mesh, its volume and whether that is plausible. Exit "
        "status 2 if anything is wrong.",
    )
    parser.add_argument("folder", metavar="FOLDER", help="a case folder, a case.toml, or a shipped case")
    parser.set_defaults(call=_check)


def _list(options: argparse.Namespace) -> None:
    from warpbrain.cases.catalogue import catalogue
    from warpbrain.report.case_list import list_lines

    print(*list_lines(catalogue()), sep="\n")
    print(
        "\nA stand-in is the MNI anatomy, deformed and scaled to a patient's published figures: not the "
        "patient's images.\nOf resect-01 to resect-15 the landmarks are patients', measured; the mesh is the template, "
        "not these patients' anatomy.\nThe beam is of silicone, recorded at ETH Zurich.\n"
        "Your own: `warpbrain cases new FOLDER --labels seg.nii.gz`; a folder's path "
        "works wherever a name does."
    )


def _show(options: argparse.Namespace) -> None:
    from warpbrain.atomic import check_writable, safe_name
    from warpbrain.cases.shipped import find_case
    from warpbrain.report.case_picture import write_case_picture
    from warpbrain.report.case_text import show_lines

    case = find_case(options.name, options.tissue)
    path = options.out or Path(f"warpbrain-{safe_name(case.name)}-{options.tissue}.png")
    check_writable(path.absolute())
    print(*show_lines(case), sep="\n")
    missing = write_case_picture(path.absolute(), case)
    print(f"\nwritten: {path}" + (f", without the body from outside: {missing}" if missing else ""))


def _check(options: argparse.Namespace) -> None:
    from warpbrain.cases.checking import check_case
    from warpbrain.cases.shipped import files_of
    from warpbrain.errors import InputError
    from warpbrain.report.case_text import check_lines
    from warpbrain.simulation.readiness import why_not

    wrong = 0
    for file in files_of(options.folder):
        checked = check_case(file)
        wrong += len(checked.problems)
        cannot = why_not(checked.case) if checked.case is not None and not checked.problems else ""
        print(*check_lines(checked, cannot), sep="\n")
    if wrong:
        raise InputError(f"{options.folder}: {wrong} problem{'s' if wrong > 1 else ''}, listed above")


def _schema(options: argparse.Namespace) -> None:
    from warpbrain.cases.format.schema import schema_text

    print(schema_text(), end="")
