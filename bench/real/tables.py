"""The tables of docs/proof-recordings.md, bench/results/real.md, made from `bench/results/real_*.json`.

python bench/real/tables.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from warpbrain.inference.calibration import percent

RESULTS = Path(__file__).resolve().parents[1] / "results"
TABLES = RESULTS / "real.md"
TITLES = {
    "cortex_specimen": "One human frontal-cortex specimen",
    "brain_regions": "Four human brain regions",
    "adhesive": "Adhesives",
}
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


def _set(one: dict[str, Any]) -> str:
    first = one["sets"][0]
    return f"{' + '.join(first['causes']) or 'nothing'} ({100 * first['probability']:.0f} %)"


def landmarks(done: list[dict[str, Any]]) -> list[str]:
    """Of each patient what is said, and errors [mm]; a row each, below a head."""
    head = [
        "case",
        "verdict",
        "most probable set",
        "as recorded",
        "rigid: shift",
        "turn",
        "left",
        "left out",
        "tool: left out",
    ]
    lines = [" | ".join([*head, "its rigid part from that", "s"]), "|".join(["---"] * (len(head) + 2))]
    for one in done:
        millimetres = [one[f"{key}_mm"] for key in ("as_recorded", "rigid_shift", "rigid_left", "rigid_left_out")]
        lines.append(
            f"{one['case']} | {one['verdict']} | {_set(one)} | {millimetres[0]:.2f} | "
            f"{millimetres[1]:.2f} | {one['rigid_turn_degrees']:.1f}° | {millimetres[2]:.2f} | {millimetres[3]:.2f} | "
            f"{one['left_out_mm']:.2f} | {one['rigid_apart_mm']:.2f} | {one['processor_seconds']:.0f}"
        )
    return [f"| {line} |" if "---" not in line else f"|{line}|" for line in lines]


def main() -> None:
    """Write them."""
    parts = ["# What was said of real recordings", "Made by `python bench/real/tables.py`."]
    for name, title in TITLES.items():
        cases = json.loads((RESULTS / f"real_{name}.json").read_text(encoding="utf-8"))["cases"]
        parts += [f"## {title}", verdicts(cases), errors(cases), confirmations(cases)]
    patients = json.loads((RESULTS / "real_resect.json").read_text(encoding="utf-8"))
    parts += ["## Landmarks of 15 patients before resection", "\n".join(landmarks(patients))]
    TABLES.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
