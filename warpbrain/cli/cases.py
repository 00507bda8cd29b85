"""`warpbrain cases`: list, show, check, begin and rebuild cases."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from warpbrain.cli.options import add_to
from warpbrain.errors import InputError


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
    _add_new(actions)
    _add_build(actions)
    schema = actions.add_parser("schema", help="print the JSON Schema of case.toml")
    schema.set_defaults(call=_schema)


def _add_show(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "show",
        help="print a case and draw it",
        description="Prints what a case says and writes a picture: the anatomy cut open, tissues, node sets, recorded "
        "arrows.",
    )
    add = partial(add_to, parser)
    add("name", metavar="NAME", help="a shipped case, or the path of a case folder")
    add("--tissue", help="default: multi")
    add("--out", metavar="PNG", help="the picture (default: warpbrain-CASE-TISSUE.png)")
    parser.set_defaults(call=_show)


def _add_check(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "check",
        help="check a case folder completely",
        description="Reads everything in a case folder and prints all that is wrong with it, each with the file, the "
        "key or row and the cure; also the quality of the mesh, its volume and whether that is plausible. Exit "
        "status 2 if anything is wrong.",
    )
    add_to(parser, "folder", metavar="FOLDER", help="a case folder, a case.toml, or a shipped case")
    parser.set_defaults(call=_check)


def _add_new(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "new",
        help="make a ready case folder from a segmentation (needs warpbrain[build]) or from a mesh",
        description="Makes a case folder with a conforming mesh, node sets and a commented case.toml that can be run "
        "at once. See docs/your-data.md.",
    )
    add = partial(add_to, parser)
    add("folder", type=Path, metavar="FOLDER", help="folder to make; one that is there and not empty needs --overwrite")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--labels", type=Path, metavar="FILE", help="label volume: .nii, .nii.gz, .mgz or .nrrd")
    source.add_argument("--mesh", type=Path, metavar="FILE", help="tetrahedral mesh: .vtu, .msh, .inp, ...")
    parser.add_argument(
        "--tissue",
        nargs="+",
        action="extend",
        default=[],
        metavar="LABEL=NAME",
        help="what each label is, such as 2=white,3=grey,4=ventricle or a range, 1000-2035=grey; "
        "'ventricle' is an open cavity, 'ignore' outside",
    )
    labels = parser.add_argument_group("with --labels")
    labels.add_argument(
        "--preset",
        metavar="PROGRAM",
        help="whose labels they are: freesurfer, synthseg, simnibs or brats; --tissue changes what it says of some",
    )
    labels.add_argument("--others", metavar="NAME", help="what every label is that --tissue does not name")
    labels.add_argument("--size", type=float, metavar="MM", help="mean edge of an element (default: about 5,000 nodes)")
    mesh = parser.add_argument_group("with --mesh")
    mesh.add_argument("--units", choices=("mm", "m"), help="unit of the mesh (default: mm)")
    mesh.add_argument("--axes", choices=("RAS", "LPS"), help="axes of the mesh (default: RAS)")
    mesh.add_argument("--array", metavar="NAME", help="cell array of the tissues, where several could be it")
    add(
        "--overwrite",
        action="store_true",
        help="make mesh.vtu and case.toml anew in a case folder that is there; its case.toml is kept as case.toml.old, "
        "and all else stays",
    )
    parser.set_defaults(call=_new)


def _add_build(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "build",
        help="remake a case's meshes from the MNI template in the nilearn wheel (needs warpbrain[build])",
        description="Remakes the meshes of a shipped case from the installed wheels, to the same meshes on the same "
        "versions. Needs the extra packages of `pip install warpbrain[build]`; downloads nothing.",
    )
    add = partial(add_to, parser)
    add("name", help="a shipped case: 0529, phantom, ...")
    add("--out", default=Path("."), help="folder to write to (default: here)")
    parser.set_defaults(call=_build)


def _list(options: argparse.Namespace) -> None:
    # neither NumPy nor a mesh is loaded for a list
    from warpbrain.cases.shipped import catalogue

    row = "{:<14} {:<7} {:<10} {:>7} {:>9} {:>9}   {}"
    print(row.format("case", "tissue", "origin", "nodes", "elements", "cm3", "recordings"))
    for entry in catalogue():
        recordings = ", ".join(f"{name} ({count})" for name, count in entry.recordings.items()) or "none"
        numbers = (entry.nodes, entry.tetrahedra, f"{entry.volume_cm3:.1f}")
        print(row.format(entry.name, entry.tissue, entry.origin, *numbers, recordings))
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
    from warpbrain.report.case_text import check_lines
    from warpbrain.simulation.run import why_not

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


def _new(options: argparse.Namespace) -> None:
    from warpbrain.cases.starting import start_from_labels, start_from_mesh, summary
    from warpbrain.frame import Frame

    foreign = ("units", "axes", "array") if options.labels else ("others", "size", "preset")
    for name in foreign:
        if getattr(options, name) is not None:
            raise InputError(f"--{name} means nothing with {'--labels' if options.labels else '--mesh'}")
    if options.labels:
        arguments = (options.folder, options.labels, options.tissue, options.others, options.size, print)
        case = start_from_labels(*arguments, program=options.preset, overwrite=options.overwrite)
    else:
        frame = Frame(options.units or "mm", options.axes or "RAS")
        case = start_from_mesh(
            options.folder, options.mesh, frame, options.tissue, options.array, overwrite=options.overwrite
        )
    print(*summary(case), sep="\n")


def _build(options: argparse.Namespace) -> None:
    from warpbrain.cases.building import NAMES, build
    from warpbrain.terminal.result_folder import claim

    if options.name in NAMES:
        claim(options.out / options.name)
    folder = build(options.name, options.out, progress=print)
    print(f"written to {folder}")
