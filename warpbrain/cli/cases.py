"""`warpbrain cases`: list, show, check, begin and rebuild cases."""

import argparse
import json
from pathlib import Path

from warpbrain.errors import InputError


def list_shipped(options: argparse.Namespace) -> None:
    """List the cases that ship with the package."""
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


def show(options: argparse.Namespace) -> None:
    """Print a case and draw it."""
    from warpbrain.atomic import check_writable, safe_name
    from warpbrain.cases.shipped import find_case
    from warpbrain.report.case_picture import write_case_picture
    from warpbrain.report.summary import show_lines

    case = find_case(options.name, options.tissue)
    path = options.out or Path(f"warpbrain-{safe_name(case.name)}-{options.tissue}.png")
    check_writable(path.absolute(), options.overwrite)
    print(*show_lines(case), sep="\n")
    missing = write_case_picture(path.absolute(), case)
    print(f"\nwritten: {path}" + (f", without the body from outside: {missing}" if missing else ""))


def check(options: argparse.Namespace) -> None:
    """Check case folders completely."""
    from warpbrain.cases.checking import check_case
    from warpbrain.cases.shipped import files_of
    from warpbrain.report.page import lines
    from warpbrain.report.summary import SET_TITLES
    from warpbrain.simulation.run import why_not

    wrong = 0
    for file in files_of(options.folder):
        checked = check_case(file)
        wrong += len(checked.problems)
        cannot = why_not(checked.case) if checked.case is not None and not checked.problems else ""
        print(*lines("case.txt", "check", checked, cannot, SET_TITLES), sep="\n")
    if wrong:
        raise InputError(f"{options.folder}: {wrong} problem{'s' if wrong > 1 else ''}, listed above")


def print_schema(options: argparse.Namespace) -> None:
    """Print the JSON Schema of `case.toml`."""
    from warpbrain.cases.format.schema import case_schema

    print(json.dumps(case_schema(), indent=2))


def begin(options: argparse.Namespace) -> None:
    """Make a case folder from a segmentation or from a mesh."""
    from warpbrain.cases.starting import start_from_labels, start_from_mesh
    from warpbrain.frame import Frame
    from warpbrain.report.page import lines

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
    print(*lines("case.txt", "started", case), sep="\n")


def build(options: argparse.Namespace) -> None:
    """Remake the meshes of a shipped case."""
    from warpbrain.cases.building.pipeline import NAMES, build
    from warpbrain.terminal.result_folder import claim

    if options.name in NAMES:
        claim(options.out / options.name)
    folder = build(options.name, options.out, progress=print)
    print(f"written to {folder}")
