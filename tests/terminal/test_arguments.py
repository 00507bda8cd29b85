"""Commands as a table describes them: arguments shared and changed, ranges, and actions."""

import pytest

from warpbrain.errors import InputError
from warpbrain.terminal.arguments import call, fill
from warpbrain.terminal.command import OneLineParser

SHARED = {"--steps": {"type": "int", "least": 1, "default": 3}}
DESCRIBED = {
    "call": "first:run",
    "arguments": {
        "--steps": {},
        "--nu": {"type": "float", "above": 0, "below": 0.5, "expected": "a ratio"},
        "--out": {"type": "path"},
    },
    "actions": {"again": {"help": "once more", "call": "second:run", "arguments": {"--steps": {"default": 7}}}},
}


def parsed(*arguments: str):
    parser = OneLineParser(prog="tool")
    fill(parser, DESCRIBED, SHARED)
    return parser.parse_args(arguments)


def test_what_several_commands_share_each_may_change():
    assert (parsed().steps, parsed("again").steps, parsed("again", "--steps", "2").steps) == (3, 7, 2)
    assert (parsed().program, parsed("again").program) == ("tool", "tool again")
    assert (parsed().call, parsed("again").call) == ("first:run", "second:run")


def test_an_empty_text_is_no_path(capsys):
    with pytest.raises(SystemExit) as ended:
        parsed("--out", "")
    assert ended.value.code == 2 and "--out: expected a path, found an empty text" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--steps", "0"), "--steps 0: expected a whole number of at least 1"),
        (("--nu", "0.5"), "--nu 0.5: expected a ratio"),
        (("again", "--steps", "-1"), "--steps -1: expected a whole number of at least 1"),
    ],
)
def test_numbers_out_of_range_are_refused_before_anything_is_imported(arguments, message):
    with pytest.raises(InputError, match=message):
        call(parsed(*arguments), "no.such.package")
