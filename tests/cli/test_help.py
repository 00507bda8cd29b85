"""`warpbrain --help`: every command once, under what a user wants of it."""

import re

from command import warpbrain

from warpbrain.cli import _GROUPS, _parser


def test_every_command_is_under_one_title():
    said = warpbrain("--help").out
    for title, commands in _GROUPS.items():
        section = said.split(f"\n{title}:\n")[1].split("\n\n")[0]
        assert re.findall(r"^  (\w+)  ", section, flags=re.MULTILINE) == list(commands)
    listed = [name for commands in _GROUPS.values() for name in commands]
    assert sorted(listed) == sorted(_parser().commands.choices)


def test_it_fits_a_screen():
    lines = warpbrain("--help").out.splitlines()
    assert len(lines) <= 40 and max(map(len, lines)) <= 80
