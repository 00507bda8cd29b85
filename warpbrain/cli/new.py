"""`warpbrain cases new FOLDER`: a ready case folder from a segmentation or a mesh."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add `new` to the actions of `warpbrain cases`."""
    parser = actions.add_parser(
        "new",
        help="make a ready case folder from a segmentation (needs warpbrain[build]) or from a mesh",
        description="Makes a case folder with a conforming mesh, node sets and a commented case.toml that can be run "
        "at once. See docs/your-data.md.",
    )
    parser.add_argument(
        "folder", type=Path, metavar="FOLDER", help="folder to make; one that is there and not empty needs --overwrite"
    )
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
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="make mesh.vtu and case.toml anew in a case folder that is there; its case.toml is kept as case.toml.old, "
        "and all else stays",
    )
    parser.set_defaults(call=_new)


def _new(options: argparse.Namespace) -> None:
    from warpbrain.cases.starting import start_from_labels, start_from_mesh, summary
    from warpbrain.errors import InputError
    from warpbrain.frame import Frame

    foreign = ("units", "axes", "array") if options.labels else ("others", "size", "preset")
    for name in foreign:
        if getattr(options, name) is not None:
            raise InputError(f"--{name} means nothing with {'--labels' if options.labels else '--mesh'}")
    if options.labels:
        case = start_from_labels(
            options.folder,
            options.labels,
            options.tissue,
            options.others,
            options.size,
            progress=print,
            program=options.preset,
            overwrite=options.overwrite,
        )
    else:
        frame = Frame(options.units or "mm", options.axes or "RAS")
        case = start_from_mesh(
            options.folder, options.mesh, frame, options.tissue, options.array, overwrite=options.overwrite
        )
    print("\n".join(summary(case)))
