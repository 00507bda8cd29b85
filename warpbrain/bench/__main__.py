"""Command line of the bench, as `commands.toml` describes it."""

from warpbrain.terminal.arguments import call, described_in, fill
from warpbrain.terminal.command import OneLineParser, exit_status


def main() -> int:
    """Parse, measure, print; returns the exit status."""
    described = described_in("warpbrain.bench")
    parser = OneLineParser(prog="python -m warpbrain.bench", description=described["bench"]["description"])
    fill(parser, described["bench"], described["arguments"])
    options = parser.parse_args()
    return exit_status(options.program, lambda: call(options, "warpbrain.bench"))


raise SystemExit(main())
