"""`warpbrain gp`: show, fit, sample and compare generative models of tissue."""

from __future__ import annotations

import argparse
from typing import Any

from warpbrain.cli.gp import compare, fit, sample, show


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    gp = commands.add_parser(
        "gp",
        help="what 73 published strain energies make likely of tissue",
        description="The generative model of tissue, learnt from 73 published strain energies.",
    )
    actions = gp.add_subparsers(dest="action", required=True, metavar="ACTION")
    for action in (show, fit, sample, compare):
        action.add_parser(actions)
