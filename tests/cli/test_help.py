"""`warpbrain --help`: every command once, under what a user wants of it."""

import argparse
import re
from importlib import import_module

from command import warpbrain

from warpbrain.cli import _parser
from warpbrain.cli.estimate import _LARGEST
from warpbrain.ensemble.run import SAMPLES


def test_every_command_is_under_one_title():
    said = warpbrain("--help").out
    parser = _parser()
    for title, commands in parser.groups.items():
        section = said.split(f"\n{title}:\n")[1].split("\n\n")[0]
        assert re.findall(r"^  (\w+)  ", section, flags=re.MULTILINE) == list(commands)
    listed = [name for commands in parser.groups.values() for name in commands]
    assert sorted(listed) == sorted(parser.commands.choices)


def test_it_fits_a_screen():
    lines = warpbrain("--help").out.splitlines()
    assert len(lines) <= 40 and max(map(len, lines)) <= 80


def test_every_command_calls_a_function_that_there_is():
    def called(parser):
        actions = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        if parser.get_default("call") is not None:
            yield parser.get_default("call")
        for action in actions:
            for command in action.choices.values():
                yield from called(command)

    for call in called(_parser()):
        module, function = call.split(":")
        assert callable(getattr(import_module(f"warpbrain.cli.{module}"), function)), call


def test_numbers_in_the_help_are_those_of_the_code():
    assert f"(default: {SAMPLES})" in " ".join(warpbrain("ensemble", "--help").out.split())
    assert f"meshes of up to {_LARGEST} nodes" in " ".join(warpbrain("estimate", "--help").out.split())
