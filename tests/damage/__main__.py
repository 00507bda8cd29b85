"""Damage case folders at random: `PYTHONPATH=tests python -m damage --tries 10000`; exit status 1 if anything is found.

Every defect is printed with its seed; `--seed S --tries 1` does that one again. `--kill 200` kills each command that
writes results so many times instead, and looks at what it leaves.
"""

from __future__ import annotations

import argparse
import collections
import resource
import sys
import tempfile
from pathlib import Path

from damage.folders_to_damage import write_whole
from damage.killing import killers
from damage.tries import one_try


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m damage", description=__doc__)
    parser.add_argument("--tries", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first try; each has the next")
    parser.add_argument("--kill", type=int, metavar="N", help="kill each command N times")
    parser.add_argument("--commands", nargs="+", default=(), metavar="NAME", help="of those that are killed: which")
    options = parser.parse_args()
    if options.kill is not None:
        return _kill(options)
    counts: collections.Counter[str] = collections.Counter()
    slowest, defects = 0.0, 0
    with tempfile.TemporaryDirectory() as place:
        whole = write_whole(Path(place) / "whole")
        for seed in range(options.seed, options.seed + options.tries):
            outcome = one_try(whole, seed)
            slowest = max(slowest, outcome.seconds)
            counts["defect" if outcome.defect else "refused" if outcome.refused else "read"] += 1
            if outcome.defect:
                defects += 1
                print(f"seed {seed}: {outcome.file}, {outcome.damage}\n{outcome.defect}", flush=True)
            if sys.stderr.isatty():
                print(f"\r{seed - options.seed + 1} of {options.tries}", end="", file=sys.stderr)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    listed = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    print(f"{options.tries} tries: {listed}; the slowest {slowest:.1f} s, {peak:.0f} MB")
    return 1 if defects else 0


def _kill(options: argparse.Namespace) -> int:
    defects = 0
    with tempfile.TemporaryDirectory() as place:
        for name, kill in killers(Path(place), options.commands).items():
            counts: collections.Counter[str] = collections.Counter()
            for seed in range(options.seed, options.seed + options.kill):
                killed = kill(seed)
                counts[f"{killed.way}, {'ended' if killed.status >= 0 else 'killed'}"] += 1
                if killed.defect:
                    defects += 1
                    print(f"seed {seed}: {killed}", flush=True)
            listed = "; ".join(f"{count} {way}" for way, count in sorted(counts.items()))
            print(f"{name}: {options.kill} tries: {listed}", flush=True)
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
