"""Help that groups commands by what a user wants of them."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from warpbrain.terminal.command import OneLineParser


class GroupedParser(OneLineParser):
    """A parser whose help lists its commands under titles.

    Attributes
    ----------
    commands : argparse action
        Of `add_subparsers`.
    groups : mapping of str to sequence of str
        Title and names of its commands, in their order.
    """

    commands: argparse._SubParsersAction[Any]
    groups: Mapping[str, Sequence[str]]

    def format_help(self) -> str:
        """As `argparse` formats it, with a section for each group."""
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        by_name = {action.dest: action for action in self.commands._get_subactions()}
        sections: dict[str, list[argparse.Action]] = {
            title: [by_name[name] for name in names] for title, names in self.groups.items()
        }
        sections["options"] = [action for action in self._actions if action is not self.commands]
        for title, actions in sections.items():
            formatter.start_section(title)
            formatter.add_arguments(actions)
            formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()
