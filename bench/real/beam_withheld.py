"""What `warpbrain diagnose` says of the silicone beam with its weight withheld, the one hung on it, or both.

python -m bench.real.beam_withheld [PART ...]     # of `WITHHELD`, all if none is given; prints rows of a table
"""

from __future__ import annotations

import sys
from dataclasses import replace

from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import BEAM, find_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.inference.calibration import percent
from warpbrain.terminal.quiet import start_warp_quietly

#: What is withheld of which case: its weight, and what hangs on it.
WITHHELD = {
    "gravity, of beam-gravity": (BEAM[0], True, False),
    "gravity, of beam-52g": (BEAM[1], True, False),
    "52 g, of beam-52g": (BEAM[1], False, True),
    "both, of beam-52g": (BEAM[1], True, True),
    "nothing, of beam-gravity": (BEAM[0], False, False),
    "nothing, of beam-52g": (BEAM[1], False, False),
}


def case_without(name: str, gravity: bool, weight: bool) -> Case:
    """A case of the beam that does not declare its gravity, or the weight at its tip."""
    case = find_case(name)
    if gravity:
        case = replace(case, mechanisms=tuple(one for one in case.mechanisms if one.kind != "gravity"))
    if weight:
        case = replace(case, boundaries=tuple(one for one in case.boundaries if not isinstance(one, Forced)))
    return case


def row(part: str) -> str:
    """Markdown: what is withheld, the verdict, the likeliest sets of causes, and all of it in words."""
    found = Diagnosing(case_without(*WITHHELD[part]), device="cpu").run()
    sets = ", ".join(f"{' + '.join(s.causes) or 'nothing'} {percent(s.probability)}" for s in found.combinations[:3])
    return f"| {part} | {found.verdict}, p = {found.p_value:.2g} | {sets} | {found.sentence} |"


def main() -> None:
    """Print a row of each, as it comes."""
    start_warp_quietly()
    print("| withheld | verdict | likeliest sets | |\n|---|---|---|---|", flush=True)
    for part in sys.argv[1:] or WITHHELD:
        print(row(part), flush=True)


if __name__ == "__main__":
    main()
