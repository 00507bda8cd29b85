"""Arguments that say which generative model is meant."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Literal

from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.gp.process import Process

#: As in `warpbrain.gp`, which takes time to import: variants of the literature, kinds of models and laws; the default
#: of each stands first.
VARIANTS: tuple[Literal["corrected"], Literal["as_published"]] = ("corrected", "as_published")
KINDS = ("hierarchical", "coregionalised")
LAWS = ("neo-hookean", "mooney-rivlin", "ogden")


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add `--gp` and `--variant` for a trained model."""
    parser.add_argument(
        "--gp",
        metavar="MODEL",
        default=KINDS[0],
        help="hierarchical (default), coregionalised (the paper's) or a folder of warpbrain gp fit",
    )
    parser.add_argument(
        "--variant", choices=VARIANTS, help="of the literature that it learnt from (default: corrected)"
    )


def chosen_model(options: argparse.Namespace) -> Process:
    """The model that the arguments name."""
    from warpbrain.gp.trained import find_model

    if options.variant is not None and options.gp not in KINDS:
        raise InputError(f"--variant {options.variant}: the model in {options.gp} says itself what it learnt from")
    return find_model(options.gp, options.variant or VARIANTS[0])


def require_stable_range(poisson: float) -> None:
    """Refuse a Poisson ratio that is none."""
    if not -1.0 < poisson < 0.5:
        raise InputError(f"--poisson {poisson:g}: expected a number in the open interval (-1, 0.5)")
