"""What `warpbrain diagnose` says of the eight stand-ins, beside what their truths hold (docs/stand-ins.md).

    python bench/stand_in_diagnoses.py [NAME ...]   # writes results/stand_in_diagnoses.json, and goes on

The tool never opens a truth: this script does, once the verdict is written. A name is right if that kind acted. Cases
declare a neo-Hookean law, truths have another: `sum w alpha` of its terms, 2 of the neo-Hookean law, is its asymmetry.
"""

from __future__ import annotations

import gzip
import json
import platform
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from warpbrain.atomic import whole_file
from warpbrain.cases.shipped import STAND_INS, find_case
from warpbrain.diagnosis.diagnose import Diagnosing

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "bench" / "results" / "stand_in_diagnoses.json"
#: What a truth calls what it drew, and what the tool calls the same.
KINDS = {"cavity pressure": "pressure", "slip": "contact"}


def diagnosed(name: str) -> dict[str, Any]:
    """Of one case."""
    began, worked = time.perf_counter(), time.process_time()
    found = Diagnosing(find_case(name, "multi"), device="cpu").run()
    return {
        "case": name,
        "verdict": found.verdict,
        "named": [one.kind for one in found.named],
        "group": list(found.group),
        "sentence": found.sentence,
        "by_posterior": list(found.by_posterior.causes),
        "sets": [{"causes": list(one.causes), "probability": one.probability} for one in found.combinations[:4]],
        "declared_mm": 1e3 * found.fit.declared[0],
        "refitted_heldout_mm": 1e3 * found.fit.refitted[1],
        "explained_heldout_mm": None if found.fit.explained is None else 1e3 * found.fit.explained[1],
        "seconds": time.perf_counter() - began,
        "processor_seconds": time.process_time() - worked,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "machine": platform.processor() or platform.machine(),
    }


def truth(name: str) -> tuple[list[str], float]:
    """Kinds of what acted, the first the one that moves the cavity; and the exponent of the law at small strains."""
    text = gzip.decompress((ROOT / "concealed" / "truth" / f"{name}.json.gz").read_bytes())
    told = json.loads(text)
    kinds = [effect["kind"] for effect in told["effects"]]
    share, alpha = told["tissue"]["share"], told["tissue"]["alpha"]
    return [KINDS.get(kind, kind) for kind in kinds], share * alpha[0] + (1.0 - share) * alpha[1]


def main() -> None:
    """All that are asked for."""
    names = sys.argv[1:] or STAND_INS
    done = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else []
    for name in names:
        if any(one["case"] == name for one in done):
            continue
        done.append(diagnosed(name))
        with whole_file(FILE) as temporary:
            temporary.write_text(json.dumps(done, indent=1) + "\n", encoding="utf-8")
    print("| case | what acted | exponent | verdict | named | likeliest set | held out without -> with it, mm | s |")
    print("|---|---|---|---|---|---|---|---|")
    for one in done:
        (acted, exponent), named = truth(one["case"]), one["named"] or one["group"]
        likeliest = one["sets"][0]
        explained = one["explained_heldout_mm"]
        held = "" if explained is None else f"{one['refitted_heldout_mm']:.2f} -> {explained:.2f}"
        print(
            f"| {one['case']} | {' and '.join(acted)} | {exponent:.1f} | {one['verdict']} | {' and '.join(named)} "
            f"| {', '.join(likeliest['causes'])} ({likeliest['probability']:.2f}) | {held} "
            f"| {one['processor_seconds']:.0f} |"
        )


if __name__ == "__main__":
    main()
