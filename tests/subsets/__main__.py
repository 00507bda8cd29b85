"""Every shipped case with every subset of its recordings, as one tissue or many, is diagnosed, small subsets first:
`PYTHONPATH=tests python -m subsets`; exit status 1 if one ends in neither a verdict nor a sentence."""

from __future__ import annotations

import argparse
import sys

from subsets.tries import TISSUES, one_try, subsets
from warpbrain.cases.shipped import SHIPPED, find_case
from warpbrain.terminal.quiet import start_warp_quietly


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m subsets", description=__doc__)
    parser.add_argument("--cases", nargs="+", choices=SHIPPED, default=SHIPPED, metavar="NAME")
    parser.add_argument("--tissue", choices=TISSUES, nargs="+", default=TISSUES)
    options, of_diagnose = parser.parse_known_args()
    start_warp_quietly()
    tries = [
        (name, tissue, some)
        for name in options.cases
        for tissue in options.tissue
        for some in subsets(find_case(name, tissue).recordings)
    ]
    defects = verdicts = 0
    for name, tissue, some in sorted(tries, key=lambda entry: len(entry[2])):
        ended = one_try(name, tissue, some, of_diagnose)
        print(ended, flush=True)
        defects += bool(ended.defect)
        verdicts += bool(ended.verdict)
    print(f"{len(tries)} tries: {verdicts} verdicts, {len(tries) - verdicts - defects} sentences, {defects} defects")
    return int(defects > 0)


if __name__ == "__main__":
    sys.exit(main())
