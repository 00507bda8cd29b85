"""Bodies drawn at random and turned, mirrored, counted or written anew: `PYTHONPATH=tests python -m metamorphic --tries
1000`; exit status 1 if a result is another one. `--seed S --tries 1` does one again."""

from __future__ import annotations

import argparse
import collections
import sys

import numpy as np

from metamorphic.changes import CHANGES
from metamorphic.tries import BOUNDS, TOLERANCE, Difference, one_try
from warpbrain.terminal.quiet import start_warp_quietly


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m metamorphic", description=__doc__)
    parser.add_argument("--tries", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="of the first try; each has the next")
    parser.add_argument("--kind", choices=list(BOUNDS), default="run")
    parser.add_argument("--change", choices=list(CHANGES), help="default: drawn, too")
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help="of a run")
    options = parser.parse_args()
    start_warp_quietly()
    found: dict[str, list[Difference]] = collections.defaultdict(list)
    for seed in range(options.seed, options.seed + options.tries):
        difference = one_try(seed, options.kind, options.change, options.tolerance)
        found[difference.change].append(difference)
        if difference.wrong:
            print(difference, flush=True)
    for change, differences in sorted(found.items()):
        sizes = [difference.size for difference in differences]
        count = f"{len(sizes):5d} tries, {sum(difference.wrong for difference in differences)} differ"
        print(f"{change:<25}{count}: median {np.median(sizes):.1e}, at most {max(sizes):.1e}")
    return int(any(difference.wrong for differences in found.values() for difference in differences))


if __name__ == "__main__":
    sys.exit(main())
