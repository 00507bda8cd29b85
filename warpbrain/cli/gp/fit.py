"""`warpbrain gp fit`: fit a generative model to the literature and to a user's studies."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.cli.gp.choice import KINDS, VARIANTS
from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.gp.process import Process


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain gp`."""
    parser = actions.add_parser(
        "fit",
        help="fit a model to the literature and to your own studies",
        description="Fits a model and writes a folder that --gp takes wherever a model is asked for. See "
        "docs/generative-model.md for the file of studies: three lines a study.",
    )
    parser.add_argument("--add", type=Path, metavar="FILE", help="your own studies, a TOML file")
    parser.add_argument("--gp", choices=KINDS, default=KINDS[0], help=f"kind of model (default: {KINDS[0]})")
    parser.add_argument("--variant", choices=VARIANTS, default=VARIANTS[0], help=f"default: {VARIANTS[0]}")
    parser.add_argument(
        "--climbs",
        type=int,
        metavar="N",
        help="from how many starts the coregionalised model is climbed in full (default: 1)",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder to make (default: warpbrain-gp-KIND-VARIANT)")
    parser.set_defaults(call=_fit)


def _fit(options: argparse.Namespace) -> None:
    if options.climbs is not None:
        if options.climbs < 1:
            raise InputError(f"--climbs {options.climbs}: expected a whole number of at least 1")
        if options.gp == KINDS[0]:
            raise InputError(f"--climbs {options.climbs}: means nothing with the {KINDS[0]} model")

    from warpbrain.atomic import check_new_folder, whole_folder
    from warpbrain.gp.trained import fit_model, write_model
    from warpbrain.report.generative.fit_text import fit_lines
    from warpbrain.terminal.progress import Progress

    out = options.out or Path(f"warpbrain-gp-{options.gp}-{options.variant}")
    check_new_folder(out)
    bar = Progress("fit")
    try:
        model, record = fit_model(
            options.gp, options.variant, options.add, climbs=options.climbs or 1, progress=bar.show
        )
    finally:
        bar.clear()
    print(*fit_lines(model, record), sep="\n")
    if options.add is not None:
        _print_change(options, model)
    with whole_folder(out) as folder:
        write_model(folder, model, record, options.add)
    print("", f"written to {out}; use it as --gp {out}", sep="\n")


def _print_change(options: argparse.Namespace, model: Process) -> None:
    """What a user's studies changed: the moduli of their groups before and after."""
    from warpbrain.gp.literature.studies import read_studies
    from warpbrain.gp.sampling import moduli
    from warpbrain.gp.trained import trained
    from warpbrain.report.generative.moduli_text import moduli_lines

    added = model.studies[len(read_studies(options.variant)) :]
    for group in dict.fromkeys(study.group for study in added):
        found = {
            said: moduli(one, group, "neo-hookean")
            for said, one in (("before", trained(options.gp, options.variant)), ("after", model))
            if group in one.groups
        }
        head, *lines = moduli_lines(list(found.values()))
        print(
            "", f"with {', '.join(study.name for study in added if study.group == group)}:", f"{'':10}{head}", sep="\n"
        )
        for said, line in zip(found, lines, strict=True):
            print(f"  {said:<8}{line}")
        if len(found) == 1:
            print("  (there was no study of this group before)")
