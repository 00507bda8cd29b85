"""`warpbrain gp`: show, fit, sample and compare generative models of tissue."""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from warpbrain.cli.options import add_to, require_poisson, require_whole
from warpbrain.errors import InputError
from warpbrain.terminal.progress import Progress

if TYPE_CHECKING:
    from warpbrain.gp.process import Process
    from warpbrain.report.generative_text import LawRow

#: As in `warpbrain.gp`, which takes time to import: variants of the literature, kinds of models and laws; the default
#: of each stands first.
VARIANTS: tuple[Literal["corrected"], Literal["as_published"]] = ("corrected", "as_published")
KINDS = ("hierarchical", "coregionalised")
LAWS = ("neo-hookean", "mooney-rivlin", "ogden")
_GP = "hierarchical (default), coregionalised (the paper's) or a folder of warpbrain gp fit"


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    gp = commands.add_parser(
        "gp",
        help="what 73 published strain energies make likely of tissue",
        description="The generative model of tissue, learnt from 73 published strain energies.",
    )
    actions = gp.add_subparsers(dest="action", required=True, metavar="ACTION")
    for add_action in (_add_show, _add_fit, _add_sample, _add_compare):
        add_action(actions)


def _chosen_model(options: argparse.Namespace) -> Process:
    """The model that `--gp` and `--variant` name."""
    from warpbrain.gp.trained import find_model

    if options.variant is not None and options.gp not in KINDS:
        raise InputError(f"--variant {options.variant}: the model in {options.gp} says itself what it learnt from")
    return find_model(options.gp, options.variant or VARIANTS[0])


def _add_show(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "show",
        help="draw a model and print the shear moduli that it makes likely",
        description="Writes studies.png (the published energies), draws.png (the distribution with draws from it), "
        "extrapolation.png (beyond the data, beside the other kind of model) and moduli.csv, and prints the table: "
        "laws fitted to the mean curve and to those two standard deviations from it, and what 95 %% of draws have; of "
        "hyperelastic groups also whether tissue is stiffer in compression or in tension, with its posterior interval.",
    )
    add = partial(add_to, parser)
    add("--group", metavar="GROUP", help='only this one, such as "hyperelastic/brain"')
    add("--gp", default=KINDS[0], help=_GP)
    add("--variant", help="of the literature that it learnt from (default: corrected)")
    parser.add_argument(
        "--model", choices=LAWS, help="only laws of this kind (default: all three of a --group, else neo-hookean)"
    )
    add("--draws", type=int, default=1000, metavar="N", help="for the intervals (default: 1000)")
    add("--seed", default=0, help="of the draws (default: 0)")
    add("--poisson", default=0.45, help="of the laws (default: 0.45)")
    add("--out", help="folder for the results (default: warpbrain-gp)")
    parser.set_defaults(call=_show)


def _show(options: argparse.Namespace) -> None:
    if options.draws < 40:
        raise InputError(f"--draws {options.draws}: expected at least 40, for an interval that holds 95 % of them")
    require_whole(options, seed=0)
    require_poisson(options.poisson)

    from warpbrain.atomic import output_folder
    from warpbrain.gp.asymmetry import asymmetries_of_papers, asymmetry
    from warpbrain.gp.hierarchy import Hierarchical
    from warpbrain.gp.sampling import moduli
    from warpbrain.gp.trained import trained
    from warpbrain.report.generative_pictures import draw_draws, draw_extrapolation, draw_studies, save
    from warpbrain.report.generative_text import asymmetry_lines, moduli_lines, write_moduli

    model = _chosen_model(options)
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
    rows = []
    with Progress("moduli") as bar:
        for index, (group, law) in enumerate(wanted):
            bar.show(index / len(wanted), f"{group}, {law}")
            rows.append(moduli(model, group, law, options.draws, options.seed, options.poisson))
    print("", *moduli_lines(rows), sep="\n")
    if any(reason for row in rows for reason in row.unstable):
        print("(a modulus in brackets is of a law that is unstable)")
    error = 100.0 * max(row.median_error for row in rows)
    print(f"{options.draws} draws each: their medians are known to {error:.0f} % or better")
    curved = [group for group in groups if group.startswith("hyperelastic/")]
    if curved and isinstance(model, Hierarchical):
        papers = asymmetries_of_papers(model.studies)
        print("", *asymmetry_lines([asymmetry(model, group) for group in curved], papers), sep="\n")
    other = trained("coregionalised" if model.name == KINDS[0] else "hierarchical", options.variant or VARIANTS[0])
    write_moduli(out / "moduli.csv", rows)
    save(draw_studies(model, options.group), out / "studies.png")
    save(draw_draws(model, options.group, options.seed), out / "draws.png")
    save(draw_extrapolation(model, other, options.group), out / "extrapolation.png")
    print("", f"written to {out}: moduli.csv, studies.png, draws.png, extrapolation.png", sep="\n")


def _add_fit(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "fit",
        help="fit a model to the literature and to your own studies",
        description="Fits a model and writes a folder that --gp takes wherever a model is asked for. See "
        "docs/generative-model.md for the file of studies: three lines a study.",
    )
    add = partial(add_to, parser)
    add("--add", type=Path, metavar="FILE", help="your own studies, a TOML file")
    add("--gp", choices=KINDS, metavar=None, default=KINDS[0], help=f"kind of model (default: {KINDS[0]})")
    add("--variant", default=VARIANTS[0], help=f"default: {VARIANTS[0]}")
    add(
        "--climbs",
        type=int,
        metavar="N",
        help="from how many starts the coregionalised model is climbed in full (default: 1)",
    )
    add("--out", help="folder to make (default: warpbrain-gp-KIND-VARIANT)")
    parser.set_defaults(call=_fit)


def _fit(options: argparse.Namespace) -> None:
    require_whole(options, climbs=1)
    if options.climbs is not None and options.gp == KINDS[0]:
        raise InputError(f"--climbs {options.climbs}: means nothing with the {KINDS[0]} model")

    from warpbrain.atomic import check_new_folder, whole_folder
    from warpbrain.gp.trained import fit_model, write_model
    from warpbrain.report.page import lines

    out = options.out or Path(f"warpbrain-gp-{options.gp}-{options.variant}")
    check_new_folder(out)
    with Progress("fit") as bar:
        model, record = fit_model(
            options.gp, options.variant, options.add, climbs=options.climbs or 1, progress=bar.show
        )
    print(*lines("gp.txt", "fit", model, record), sep="\n")
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
    from warpbrain.report.generative_text import moduli_lines

    added = model.studies[len(read_studies(options.variant)) :]
    for group in dict.fromkeys(study.group for study in added):
        tables = {
            when: moduli(process, group, "neo-hookean")
            for when, process in (("before", trained(options.gp, options.variant)), ("after", model))
            if group in process.groups
        }
        head, *lines = moduli_lines(list(tables.values()))
        print(
            "", f"with {', '.join(study.name for study in added if study.group == group)}:", f"{'':10}{head}", sep="\n"
        )
        for when, line in zip(tables, lines, strict=True):
            print(f"  {when:<8}{line}")
        if len(tables) == 1:
            print("  (there was no study of this group before)")


def _add_sample(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "sample",
        help="draw laws of one or several tissues",
        description="Draws curves of one or several groups, jointly, and fits a law to each; an unstable draw is told "
        "and drawn again. With --sweep, takes the curves at even distances from the mean instead, as the paper does.",
    )
    add = partial(add_to, parser)
    add("--group", required=True, nargs="+", metavar="GROUP", help='such as "hyperelastic/brain"')
    how = parser.add_mutually_exclusive_group()
    how.add_argument("-n", "--number", type=int, default=10, metavar="N", help="of draws (default: 10)")
    how.add_argument(
        "--sweep",
        type=int,
        metavar="N",
        help="laws of N curves from 2 standard deviations below the mean to 2 above (the paper: 17), in all "
        "combinations over groups",
    )
    parser.add_argument("--model", choices=LAWS, default=LAWS[0], help=f"law (default: {LAWS[0]})")
    add("--seed", help="of the draws (default: 0)")
    add("--gp", default=KINDS[0], help=_GP)
    add("--variant", help="of the literature that it learnt from (default: corrected)")
    add("--poisson", default=0.45, help="to be stable with (default: 0.45)")
    add("--csv", help="write the table there instead of printing it")
    parser.set_defaults(call=_sample)


def _sample(options: argparse.Namespace) -> None:
    if options.number < 1:
        raise InputError(f"-n {options.number}: expected a whole number of at least 1")
    require_whole(options, sweep=2, seed=0)
    if options.sweep is not None and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing with --sweep, which draws nothing")
    require_poisson(options.poisson)
    if len(set(options.group)) < len(options.group):
        raise InputError(f"--group {' '.join(options.group)}: a group is given twice")

    from warpbrain.atomic import check_writable
    from warpbrain.report.generative_text import law_lines, write_laws

    if options.csv is not None:
        check_writable(options.csv.absolute())
    model = _chosen_model(options)
    if options.sweep is None:
        first: tuple[str, ...] = ("draw", "attempts")
        rows, sentences = _drawn(options, model)
        last = "why attempts were redrawn"
    else:
        first = tuple(f"k of {group}" for group in options.group)
        rows, sentences = _swept(options, model)
        last = "unstable"
    if options.csv is None:
        shown = first if options.sweep is None else tuple(f"k {i}" for i in range(1, len(first) + 1))
        print(*law_lines(shown, options.group, rows), sep="\n")
    else:
        write_laws(options.csv, first, options.group, rows, last)
        sentences.append(f"written to {options.csv}")
    print("", *sentences, sep="\n")


def _drawn(options: argparse.Namespace, model: Process) -> tuple[list[LawRow], list[str]]:
    from warpbrain.gp.sampling import draw_many
    from warpbrain.report.generative_text import LawRow, redrawn_lines

    draws, seed = [], options.seed or 0
    with Progress("draws") as bar:
        for drawn in draw_many(model, options.group, options.model, options.number, seed, options.poisson):
            draws.append(drawn)
            bar.show(len(draws) / options.number)
    rows = [LawRow((str(draw.number), str(1 + len(draw.rejected))), draw.fits, draw.rejected) for draw in draws]
    return rows, redrawn_lines(draws)


def _swept(options: argparse.Namespace, model: Process) -> tuple[list[LawRow], list[str]]:
    from warpbrain.gp.sampling import law_of_curve, unstable
    from warpbrain.report.generative_text import LawRow

    places = [-2.0 + 4.0 * i / (options.sweep - 1) for i in range(options.sweep)]
    fits = {(group, k): law_of_curve(model, group, k, options.model) for group in options.group for k in places}
    reasons = {key: unstable(fitted, options.poisson) for key, fitted in fits.items()}
    rows = []
    for combination in product(places, repeat=len(options.group)):
        keys = list(zip(options.group, combination, strict=True))
        wrong = tuple(f"{key[0]}: {reasons[key]}" for key in keys if reasons[key])
        rows.append(LawRow(tuple(f"{k:g}" for k in combination), tuple(fits[key] for key in keys), wrong))
    count = sum(bool(row.reasons) for row in rows)
    sentences = [f"unstable: {count} of {len(rows)}"]
    return rows, sentences + sorted({f"  {reason}" for row in rows for reason in row.reasons})


def _add_compare(actions: argparse._SubParsersAction[Any]) -> None:
    parser = actions.add_parser(
        "compare",
        help="score models on studies that they have not seen",
        description="Leaves out each study of the literature, or each paper with all its studies, fits every model "
        "again without it and scores what it says of it: log predictive density, with a sign test against the "
        "default model, and how many levels are within intervals, by method of measurement. Takes minutes to half an "
        "hour; models that are in the file already are not scored again, so that it goes on where it was interrupted.",
    )
    add = partial(add_to, parser)
    add("--variant", default=VARIANTS[0], help=f"default: {VARIANTS[0]}")
    add("--leave", choices=("paper", "study"), default="paper", help="what is left out (default: paper)")
    add("--only", metavar="TEXT", default="", help="only models that have this in their name")
    add("--csv", help="file to write (default: warpbrain-gp-VARIANT-LEAVE.csv)")
    parser.set_defaults(call=_compare)


def _compare(options: argparse.Namespace) -> None:
    from warpbrain.atomic import check_writable
    from warpbrain.gp import leaving_out
    from warpbrain.gp.leaving_out import DEFAULT, candidates
    from warpbrain.gp.literature.studies import read_studies

    path = options.csv or Path(f"warpbrain-gp-{options.variant}-{options.leave}.csv")
    check_writable(path)
    studies = read_studies(options.variant)
    left = leaving_out.folds(studies, options.leave)
    held = list(left)
    scores = leaving_out.read_scores(path, held)
    done = {score.name for score in scores}
    chosen = [candidate for candidate in candidates() if options.only in candidate.name]
    if not chosen:
        names = ", ".join(candidate.name for candidate in candidates())
        raise InputError(f"--only {options.only!r}: no model has this in its name (there are: {names})")
    for candidate in chosen:
        if candidate.name not in done:
            with Progress(f"{candidate.name:<46}") as bar:
                scores.append(leaving_out.leave_out(candidate, studies, options.leave, bar.show))
            leaving_out.write_scores(path, scores, held)
    papers = len({study.paper for study in studies})
    print(f"{len(studies)} studies of {papers} papers, one {options.leave} after the other left out:")
    shown = [score for score in scores if options.only in score.name]
    print(*leaving_out.score_lines(shown), sep="\n")
    for score in shown:
        if score.levels:
            lines = leaving_out.calibration_lines(
                leaving_out.calibration(score, leaving_out.methods_of(left)), options.leave
            )
            title = f"{score.name}: {options.leave}s whose level is within an interval (95 % interval of that part)"
            print("", title, *lines, sep="\n")
    default = next((score for score in scores if score.name == DEFAULT), None)
    others = [score for score in shown if score.name != DEFAULT]
    if default is not None and others:
        print(
            "",
            *leaving_out.comparison_lines(default.name, [leaving_out.compared(default, other) for other in others]),
            sep="\n",
        )
    print("", f"written to {path}", sep="\n")
