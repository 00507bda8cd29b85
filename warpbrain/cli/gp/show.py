"""`warpbrain gp show`: pictures of a generative model, and the shear moduli that it makes likely."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from warpbrain.cli.gp.choice import KINDS, LAWS, VARIANTS, add_model, chosen_model, require_stable_range
from warpbrain.errors import InputError


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain gp`."""
    parser = actions.add_parser(
        "show",
        help="draw a model and print the shear moduli that it makes likely",
        description="Writes studies.png (the published energies), draws.png (the distribution with draws from it), "
        "extrapolation.png (beyond the data, beside the other kind of model) and moduli.csv, and prints the table: "
        "laws fitted to the mean curve and to those two standard deviations from it, and what 95 %% of draws have; of "
        "hyperelastic groups also whether tissue is stiffer in compression or in tension, with its posterior interval.",
    )
    parser.add_argument("--group", metavar="GROUP", help='only this one, such as "hyperelastic/brain"')
    add_model(parser)
    parser.add_argument(
        "--model", choices=LAWS, help="only laws of this kind (default: all three of a --group, else neo-hookean)"
    )
    parser.add_argument("--draws", type=int, default=1000, metavar="N", help="for the intervals (default: 1000)")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the draws (default: 0)")
    parser.add_argument("--poisson", type=float, default=0.45, metavar="NU", help="of the laws (default: 0.45)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the results (default: warpbrain-gp)")
    parser.set_defaults(call=_show)


def _show(options: argparse.Namespace) -> None:
    if options.draws < 40:
        raise InputError(f"--draws {options.draws}: expected at least 40, for an interval that holds 95 % of them")
    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: expected a whole number of at least 0")
    require_stable_range(options.poisson)

    from warpbrain.atomic import output_folder
    from warpbrain.gp.asymmetry import asymmetries_of_papers, asymmetry
    from warpbrain.gp.hierarchical import Hierarchical
    from warpbrain.gp.sampling import moduli
    from warpbrain.gp.trained import trained
    from warpbrain.report.generative.asymmetry_text import asymmetry_lines
    from warpbrain.report.generative.draws_picture import draw_draws
    from warpbrain.report.generative.extrapolation_picture import draw_extrapolation
    from warpbrain.report.generative.moduli_text import moduli_lines, write_moduli
    from warpbrain.report.generative.page import save
    from warpbrain.report.generative.studies_picture import draw_studies
    from warpbrain.terminal.progress import Progress

    model = chosen_model(options)
    if options.group is not None and options.group not in model.groups:
        raise InputError(
            f"--group {options.group}: the model has seen no study of it; it has {', '.join(model.groups)}"
        )
    out = output_folder(options.out or Path("warpbrain-gp"))
    groups = model.groups if options.group is None else (options.group,)
    laws = (options.model,) if options.model else LAWS[:1] if options.group is None else LAWS
    wanted = [(group, law) for group in groups for law in laws]
    studies = [study for study in model.studies if study.group in groups]
    print(
        f"{model.name} model of the literature as {model.variant}: {len(studies)} studies of {len(groups)} group"
        + "s" * (len(groups) > 1)
    )
    bar = Progress("moduli")
    found = []
    for index, (group, law) in enumerate(wanted):
        bar.show(index / len(wanted), f"{group}, {law}")
        found.append(moduli(model, group, law, options.draws, options.seed, options.poisson))
    bar.clear()
    print("", *moduli_lines(found), sep="\n")
    if any(reason for one in found for reason in one.unstable):
        print("(a modulus in brackets is of a law that is unstable)")
    error = 100.0 * max(one.median_error for one in found)
    print(f"{options.draws} draws each: their medians are known to {error:.0f} % or better")
    curved = [group for group in groups if group.startswith("hyperelastic/")]
    if curved and isinstance(model, Hierarchical):
        papers = asymmetries_of_papers(model.studies)
        print("", *asymmetry_lines([asymmetry(model, group) for group in curved], papers), sep="\n")
    other = trained("coregionalised" if model.name == KINDS[0] else "hierarchical", options.variant or VARIANTS[0])
    write_moduli(out / "moduli.csv", found)
    save(draw_studies(model, options.group), out / "studies.png")
    save(draw_draws(model, options.group, options.seed), out / "draws.png")
    save(draw_extrapolation(model, other, options.group), out / "extrapolation.png")
    print("", f"written to {out}: moduli.csv, studies.png, draws.png, extrapolation.png", sep="\n")
