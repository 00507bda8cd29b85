"""Everything that docs/reliability.md counts, tried many times in several processes: `PYTHONPATH=tests python -m
reliability --processes 16 --seconds 540 --out tries.jsonl`; exit status 1 if anything is wrong.

Each try is one line of the file from the moment it ends, and is not done again where the file has it; `--table` lays
files of tries out as the page has them. A try is its kind and its seed: `same-estimate --seed S --tries 1`.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path


def main() -> int:
    # before anything reads them: tries share the processors, and GPUs are left alone
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["CUDA_VISIBLE_DEVICES"] = ""
    from reliability.kinds import KINDS
    from reliability.running import try_all
    from reliability.table import table_of

    counts = ", ".join(f"{name} {kind.promised}" for name, kind in KINDS.items())
    parser = argparse.ArgumentParser(prog="python -m reliability", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"default: all; {counts}")
    parser.add_argument("--tries", type=int, help="of each kind; default: its number above")
    parser.add_argument("--seed", type=int, default=0, help="of the first try; each has the next")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seconds", type=float, help="what has not ended by then is given up")
    parser.add_argument("--out", type=Path, default=Path("tries.jsonl"))
    parser.add_argument("--table", type=Path, nargs="+", metavar="FILE", help="lay out tries, and do none")
    options = parser.parse_args()
    if options.table:
        print(table_of(options.table))
        return 0
    unknown = [name for name in options.kinds if name not in KINDS]
    if unknown:
        parser.error(f"{unknown[0]!r}: expected one of {', '.join(KINDS)}")
    wrong = try_all(
        options.kinds or list(KINDS), options.tries, options.seed, options.processes, options.seconds, options.out
    )
    print(table_of([options.out]))
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
