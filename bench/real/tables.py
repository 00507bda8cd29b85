"""The tables of docs/proof-recordings.md, written into it from `bench/results/real_*.json`: none is copied by hand.

python bench/real/tables.py
"""

from __future__ import annotations

import json
import re
from typing import Any

from common import RESULTS, ROOT

from warpbrain.inference.probability import percent

PAGE = ROOT / "docs" / "proof-recordings.md"
STATES = {"declared": "as declared", "refitted": "tissue refitted", "explained": "with what was added"}


def table(head: list[str], rows: list[list[str]]) -> str:
    """Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def verdicts(cases: dict[str, Any]) -> str:
    """What is said of each case, and what is behind it."""
    rows = []
    for name, said in cases.items():
        best = said["combinations"][0]
        named = ", ".join(
            f"{one['mechanism']} ("
            + ", ".join(
                f"{k} {v['value']:.3g} ± {v['sd']:.2g} {v['unit']}".rstrip() for k, v in one["estimate"].items()
            )
            + ")"
            for one in said["named"]
        )
        rows.append(
            [
                name,
                f"**{said['verdict']}**",
                named or " / ".join(said["group"]),
                " + ".join(best["causes"]) or "nothing",
                f"{percent(best['probability'])}, {best['log_evidence']:+.0f}",
            ]
        )
    return table(["", "verdict", "named, or among", "most probable set", "its probability, log evidence"], rows)


def errors(cases: dict[str, Any]) -> str:
    """Root mean squares over all recorded rows."""
    rows = []
    for name, said in cases.items():
        fit = said["fit"]
        fitted = sum(test["rows"] for test in said["tests"].values() if test["role"] == "fit")
        lines = {f"fitted, {fitted} rows": fit["rmse_pa"], "each from the others": fit["heldout_rmse_pa"]}
        for test, known in said["tests"].items():
            if known["role"] == "check":
                checks = {state: (own or {}).get(test) for state, own in fit["check_rmse_pa"].items()}
                lines[f"{test}, not seen, {known['rows']} rows"] = checks
        for what, values in lines.items():
            shown = [f"{values[state]:.4g} Pa" if values.get(state) is not None else "" for state in STATES]
            rows.append([name, what, *shown])
    return table(["", "", *STATES.values()], rows)


def confirmations(cases: dict[str, Any]) -> str:
    """What each mechanism is worth where the others act."""
    rows = []
    for name, said in cases.items():
        for one in said["fit"]["confirmations"]:
            part, (low, high) = one["heldout_gain"]["part"], one["heldout_gain"]["interval_95"]
            rows.append(
                [
                    name,
                    one["mechanism"],
                    f"{one['log_evidence']:+.0f}",
                    f"{one['heldout_log_density']:+.0f}",
                    f"{100 * part:.0f} % ({100 * low:.0f} to {100 * high:.0f} %)",
                    f"{one['placebo_p']:.2g}",
                ]
            )
    head = ["", "mechanism", "log evidence", "of held-out rows", "of the held-out error gone", "placebo p"]
    return table(head, rows)


def main() -> None:
    """Write them."""
    page = PAGE.read_text(encoding="utf-8")
    for name in ("cortex_specimen", "brain_regions", "adhesive"):
        cases = json.loads((RESULTS / f"real_{name}.json").read_text(encoding="utf-8"))["cases"]
        text = "\n\n".join((verdicts(cases), errors(cases), confirmations(cases)))
        pattern = rf"(<!-- {name} -->\n).*?(\n<!-- end -->)"
        page, count = re.subn(pattern, lambda found: found[1] + text + found[2], page, flags=re.S)  # noqa: B023
        assert count == 1, name
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
