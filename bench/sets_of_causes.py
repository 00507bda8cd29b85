"""Verdicts by the posterior over sets of causes, beside those of `warpbrain diagnose` until it takes their place.

python bench/sets_of_causes.py 0529 0535 path/to/case ... --out verdicts.json
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from warpbrain.atomic import whole_file
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import decide
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.screened import screened
from warpbrain.worlds.listener import Listener


def weighed(case: Case, device: str | None, listener: Listener) -> HypothesisSearch:
    """All sets of causes of a case that are worth looking at."""
    search = screened(case, device, listener)
    search.fit()
    return search


def verdict(name: str, tissue: str, device: str | None, listener: Listener) -> dict[str, Any]:
    """What is said of a case, and of which sets."""
    began = time.perf_counter()
    with one_thread_of_blas():
        search = weighed(find_case(name, tissue), device, listener)
    decision, _ = decide([one.hypothesis for one in search.weighed], search.probabilities, calibration().losses)
    sets = [
        {
            "causes": one.hypothesis.causes,
            "kinds": [kind.value for kind in one.hypothesis.kinds],
            "log_evidence": one.hypothesis.log_evidence,
            "log_prior": one.hypothesis.log_prior,
            "probability": chance,
            "fitted": one.refit is not None,
            "gross_errors": int(one.marginal.gross.sum()),
        }
        for one, chance in zip(search.weighed, search.probabilities.tolist(), strict=True)
    ]
    said = {"verdict": decision.verdict, "causes": decision.causes}
    return {"case": name, **said, "seconds": time.perf_counter() - began, "hypotheses": sets}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="+", metavar="CASE")
    parser.add_argument("--tissue", choices=("single", "multi"), default="multi")
    parser.add_argument("--device")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    found = []
    for name in options.cases:
        found.append(verdict(name, options.tissue, options.device, Listener(lambda text: print(f"  {text}"))))
        last = found[-1]
        print(f"{name}: {last['verdict']} {' and '.join(last['causes'])} ({last['seconds']:.0f} s)")
        with whole_file(options.out) as temporary:
            temporary.write_text(json.dumps(found, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
