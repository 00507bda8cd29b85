"""`warpbrain gp sample`: laws that the literature makes likely."""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.cli.gp.choice import LAWS, add_model, chosen_model, require_stable_range
from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.gp.process import Process
    from warpbrain.report.generative.laws_table import LawRow


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain gp`."""
    parser = actions.add_parser(
        "sample",
        help="draw laws of one or several tissues",
        description="Draws curves of one or several groups, jointly, and fits a law to each; an unstable draw is told "
        "and drawn again. With --sweep, takes the curves at even distances from the mean instead, as the paper does.",
    )
    parser.add_argument("--group", required=True, nargs="+", metavar="GROUP", help='such as "hyperelastic/brain"')
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
    parser.add_argument("--seed", type=int, metavar="S", help="of the draws (default: 0)")
    add_model(parser)
    parser.add_argument("--poisson", type=float, default=0.45, metavar="NU", help="to be stable with (default: 0.45)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the table there instead of printing it")
    parser.set_defaults(call=_sample)


def _sample(options: argparse.Namespace) -> None:
    for name, value, least in (("-n", options.number, 1), ("--sweep", options.sweep, 2), ("--seed", options.seed, 0)):
        if value is not None and value < least:
            raise InputError(f"{name} {value}: expected a whole number of at least {least}")
    if options.sweep is not None and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing with --sweep, which draws nothing")
    require_stable_range(options.poisson)
    if len(set(options.group)) < len(options.group):
        raise InputError(f"--group {' '.join(options.group)}: a group is given twice")

    from warpbrain.atomic import check_writable
    from warpbrain.report.generative.laws_table import law_lines, write_laws

    if options.csv is not None:
        check_writable(options.csv.absolute())
    model = chosen_model(options)
    if options.sweep is None:
        first: tuple[str, ...] = ("draw", "attempts")
        rows, said = _drawn(options, model)
        last = "why attempts were redrawn"
    else:
        first = tuple(f"k of {group}" for group in options.group)
        rows, said = _swept(options, model)
        last = "unstable"
    if options.csv is None:
        shown = first if options.sweep is None else tuple(f"k {i}" for i in range(1, len(first) + 1))
        print(*law_lines(shown, options.group, rows), sep="\n")
    else:
        write_laws(options.csv, first, options.group, rows, last)
        said.append(f"written to {options.csv}")
    print("", *said, sep="\n")


def _drawn(options: argparse.Namespace, model: Process) -> tuple[list[LawRow], list[str]]:
    from warpbrain.gp.sampling import draw_many
    from warpbrain.report.generative.laws_table import LawRow, redrawn_lines
    from warpbrain.terminal.progress import Progress

    bar, draws = Progress("draws"), []
    try:
        seed = options.seed or 0
        for drawn in draw_many(model, options.group, options.model, options.number, seed, options.poisson):
            draws.append(drawn)
            bar.show(len(draws) / options.number)
    finally:
        bar.clear()
    rows = [LawRow((str(one.number), str(1 + len(one.rejected))), one.fits, one.rejected) for one in draws]
    return rows, redrawn_lines(draws)


def _swept(options: argparse.Namespace, model: Process) -> tuple[list[LawRow], list[str]]:
    from warpbrain.gp.metamodels import unstable
    from warpbrain.gp.sampling import law_of_curve
    from warpbrain.report.generative.laws_table import LawRow

    places = [-2.0 + 4.0 * i / (options.sweep - 1) for i in range(options.sweep)]
    fits = {(group, k): law_of_curve(model, group, k, options.model) for group in options.group for k in places}
    reasons = {key: unstable(fitted, options.poisson) for key, fitted in fits.items()}
    rows = []
    for combination in product(places, repeat=len(options.group)):
        keys = list(zip(options.group, combination, strict=True))
        wrong = tuple(f"{key[0]}: {reasons[key]}" for key in keys if reasons[key])
        rows.append(LawRow(tuple(f"{k:g}" for k in combination), tuple(fits[key] for key in keys), wrong))
    count = sum(bool(row.reasons) for row in rows)
    said = [f"unstable: {count} of {len(rows)}"]
    return rows, said + sorted({f"  {reason}" for row in rows for reason in row.reasons})
