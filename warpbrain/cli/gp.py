"""`warpbrain gp`: show, fit, sample and compare generative models of tissue."""

import argparse
import math
from itertools import product
from pathlib import Path

from warpbrain.atomic import check_new_folder, check_writable, output_folder, whole_folder
from warpbrain.errors import InputError
from warpbrain.gp import leaving_out
from warpbrain.gp.asymmetry import asymmetries_of_papers, asymmetry
from warpbrain.gp.hierarchy import Hierarchical
from warpbrain.gp.leaving_out import DEFAULT, candidates
from warpbrain.gp.literature.studies import read_studies
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import draw_laws, law_of_curve, moduli, unstable
from warpbrain.gp.trained import KINDS, find_model, fit_model, trained, write_model
from warpbrain.report import generative_text as text
from warpbrain.report.generative_pictures import draw_draws, draw_extrapolation, draw_studies, save
from warpbrain.report.page import lines
from warpbrain.terminal.progress import Progress

#: Laws that moduli are shown of, the default first.
_LAWS = ("neo-hookean", "mooney-rivlin", "ogden")


def _chosen_model(options: argparse.Namespace) -> Process:
    """The model that `--gp` and `--variant` name."""
    if options.variant is not None and options.gp not in KINDS:
        raise InputError(f"--variant {options.variant}: the model in {options.gp} says itself what it learnt from")
    return find_model(options.gp, options.variant or "corrected")


def show(options: argparse.Namespace) -> None:
    """Draw a generative model and print the shear moduli that it makes likely."""
    model = _chosen_model(options)
    if options.group is not None and options.group not in model.groups:
        raise InputError(
            f"--group {options.group}: the model has seen no study of it; it has {', '.join(model.groups)}"
        )
    out = output_folder(options.out or Path("warpbrain-gp"))
    groups = model.groups if options.group is None else (options.group,)
    laws = (options.model,) if options.model else _LAWS[:1] if options.group is None else _LAWS
    wanted = [(group, law) for group in groups for law in laws]
    studies = [study for study in model.studies if study.group in groups]
    print(*lines("gp.txt", "learnt", model, len(studies), len(groups)), sep="\n")
    rows = []
    with Progress("moduli") as bar:
        for index, (group, law) in enumerate(wanted):
            bar.show(index / len(wanted), f"{group}, {law}")
            rows.append(moduli(model, group, law, options.draws, options.seed, options.poisson))
    print("", *text.moduli_lines(rows), *lines("gp.txt", "known", rows, options.draws), sep="\n")
    curved = [group for group in groups if group.startswith("hyperelastic/")]
    if curved and isinstance(model, Hierarchical):
        papers = asymmetries_of_papers(model.studies)
        asymmetries = [asymmetry(model, group) for group in curved]
        told = lines("gp.txt", "tension_over_compression", asymmetries, list(papers.values()), math.exp)
        print("", *told, sep="\n")
    other = trained("coregionalised" if model.name == KINDS[0] else "hierarchical", options.variant or "corrected")
    text.write_moduli(out / "moduli.csv", rows)
    save(draw_studies(model, options.group), out / "studies.png")
    save(draw_draws(model, options.group, options.seed), out / "draws.png")
    save(draw_extrapolation(model, other, options.group), out / "extrapolation.png")
    print("", f"written to {out}: moduli.csv, studies.png, draws.png, extrapolation.png", sep="\n")


def fit(options: argparse.Namespace) -> None:
    """Fit a generative model and write it."""
    if options.climbs is not None and options.gp == KINDS[0]:
        raise InputError(f"--climbs {options.climbs}: means nothing with the {KINDS[0]} model")

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
    added = model.studies[len(read_studies(options.variant)) :]
    for group in dict.fromkeys(study.group for study in added):
        tables = {
            when: moduli(process, group, "neo-hookean")
            for when, process in (("before", trained(options.gp, options.variant)), ("after", model))
            if group in process.groups
        }
        head, *lines = text.moduli_lines(list(tables.values()))
        print(
            "", f"with {', '.join(study.name for study in added if study.group == group)}:", f"{'':10}{head}", sep="\n"
        )
        for when, line in zip(tables, lines, strict=True):
            print(f"  {when:<8}{line}")
        if len(tables) == 1:
            print("  (there was no study of this group before)")


def sample(options: argparse.Namespace) -> None:
    """Draw laws of one or several tissues."""
    if options.sweep is not None and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing with --sweep, which draws nothing")
    if len(set(options.group)) < len(options.group):
        raise InputError(f"--group {' '.join(options.group)}: a group is given twice")

    if options.csv is not None:
        check_writable(options.csv.absolute(), options.overwrite)
    model = _chosen_model(options)
    if options.sweep is None:
        draws, seed = [], options.seed or 0
        with Progress("draws") as bar:
            for number in range(options.number):
                draws.append(draw_laws(model, options.group, options.model, number, seed, options.poisson))
                bar.show(len(draws) / options.number)
        rows = [text.LawRow((str(d.number), str(1 + len(d.rejected))), d.fits, d.rejected) for d in draws]
        sentences = text.redrawn_lines(draws)
        first, last = ["draw", "attempts"], "why attempts were redrawn"
        shown = first
    else:
        rows, sentences = _swept(options, model)
        first, last = [f"k of {group}" for group in options.group], "unstable"
        shown = [f"k {number}" for number, _ in enumerate(first, 1)]
    if options.csv is None:
        print(*text.law_lines(shown, options.group, rows), sep="\n")
    else:
        text.write_laws(options.csv, first, options.group, rows, last)
        sentences.append(f"written to {options.csv}")
    print("", *sentences, sep="\n")


def _swept(options: argparse.Namespace, model: Process) -> tuple[list[text.LawRow], list[str]]:
    places = [-2.0 + 4.0 * i / (options.sweep - 1) for i in range(options.sweep)]
    fits = {(group, k): law_of_curve(model, group, k, options.model) for group in options.group for k in places}
    reasons = {key: unstable(fitted, options.poisson) for key, fitted in fits.items()}
    rows = []
    for combination in product(places, repeat=len(options.group)):
        keys = list(zip(options.group, combination, strict=True))
        wrong = tuple(f"{key[0]}: {reasons[key]}" for key in keys if reasons[key])
        rows.append(text.LawRow(tuple(f"{k:g}" for k in combination), tuple(fits[key] for key in keys), wrong))
    count = sum(bool(row.reasons) for row in rows)
    sentences = [f"unstable: {count} of {len(rows)}"]
    return rows, sentences + sorted({f"  {reason}" for row in rows for reason in row.reasons})


def compare(options: argparse.Namespace) -> None:
    """Score models on studies that they have not seen."""
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
    print(*lines("gp.txt", "scores", shown), sep="\n")
    for score in shown:
        if score.levels:
            calibrated = leaving_out.calibration(score, leaving_out.methods_of(left))
            table = lines("gp.txt", "calibrations", calibrated, options.leave, leaving_out.INTERVALS)
            title = f"{score.name}: {options.leave}s whose level is within an interval (95 % interval of that part)"
            print("", title, *table, sep="\n")
    default = next((score for score in scores if score.name == DEFAULT), None)
    others = [score for score in shown if score.name != DEFAULT]
    if default is not None and others:
        compared = [leaving_out.compared(default, other) for other in others]
        print("", *lines("gp.txt", "comparisons", default.name, compared), sep="\n")
    print("", f"written to {path}", sep="\n")
