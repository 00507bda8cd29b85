"""What the three proofs on real recordings share: a case folder from tables, its diagnosis, its table and figure."""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from warpbrain.atomic import write_text
from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.reading import read_case
from warpbrain.cases.specimen import Specimen
from warpbrain.cases.writing import write_case
from warpbrain.estimation.options import Listener
from warpbrain.physics.laws import NeoHookean
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.recordings.recording import TestRecording
from warpbrain.report.diagnosis.description import describe
from warpbrain.report.diagnosis.files import write_curves, write_explained
from warpbrain.report.diagnosis.page import page_of
from warpbrain.report.diagnosis.text import diagnosis_lines
from warpbrain.report.files import write_summary
from warpbrain.terminal.quiet import start_warp_quietly
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

sys.path.append(str(Path(__file__).resolve().parents[2] / "docs"))
from figure_records import record

Floats = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
RESULTS, FIGURES = ROOT / "bench" / "results", ROOT / "docs" / "figures"
#: Okabe and Ito's colours, dark to light.
BLACK, BLUE, VERMILION, ORANGE, SKY = "#000000", "#0072B2", "#D55E00", "#E69F00", "#56B4E9"


def keep_figure(figure: Figure, name: str, script: str) -> None:
    """Save a figure of docs/proof-recordings.md, and write down which script made it."""
    figure.savefig(FIGURES / name, dpi=150)
    record(f"python bench/real/{Path(script).name} FOLDER", [name])


def arguments(what: str) -> argparse.Namespace:
    """The folder with the data, and where cases and diagnoses go."""
    parser = argparse.ArgumentParser(description=what)
    parser.add_argument("data", type=Path, help="folder with the public originals, see docs/proof-recordings.md")
    parser.add_argument("--out", type=Path, default=Path("proof"), help="folder for cases and diagnoses")
    return parser.parse_args()


def declared(name: str, title: str, specimen: Specimen, mu: float, poisson: float, tests: list[TestRecording]) -> Case:
    """A case that declares a neo-Hookean solid and nothing else."""
    return Case(
        name=name,
        title=title,
        origin="measured",
        path=Path("case.toml"),
        mesh=specimen.mesh(),
        mesh_file="",
        tissues={1: Tissue("specimen", NeoHookean(mu))},
        density=1000.0,
        poisson=poisson,
        specimen=specimen,
        recordings=tuple(tests),
    )


def recorded_test(
    name: str,
    mode: str,
    quantities: tuple[str, str],
    imposed: Floats,
    response: Floats,
    times: Floats | None = None,
    role: str = "fit",
    specimen: str = "",
) -> TestRecording:
    """A test; rows whose time does not increase are left out."""
    kept = np.ones(len(imposed), dtype=bool)
    if times is not None:
        kept = np.concatenate([[True], times[1:] > np.maximum.accumulate(times)[:-1]])
    return TestRecording(
        name=name,
        file=f"{name}.csv",
        role=role,
        mode=mode,
        quantities=quantities,
        imposed=imposed[kept],
        response=response[kept],
        time=None if times is None else times[kept],
        specimen=specimen,
    )


def diagnose(case: Case, out: Path, ends: bool = True) -> tuple[SpecimenDiagnosis, dict[str, Any]]:
    """Write a case folder, read it, diagnose it as `warpbrain diagnose` does, and write what was found beside it."""
    start_warp_quietly()
    folder = out / case.name
    if not (folder / "case.toml").exists():
        write_case(folder, case)
    options = DiagnosisOptions(ends=ends)
    start = time.perf_counter()
    found = DiagnosingSpecimen(
        read_case(folder),
        options,
        "cpu",
        Listener(lambda text: print(f"{time.perf_counter() - start:7.1f} s  {text}", flush=True)),
    ).run()
    said = describe(found, options, "cpu")
    beside = out / f"{case.name}-diagnosis{'' if ends else '-homogeneous'}"
    beside.mkdir(parents=True, exist_ok=True)
    write_curves(beside / "curves.csv", found)
    if found.explained is not None:
        write_explained(beside / "explained", found.explained)
    write_summary(beside / "diagnosis.json", said)
    write_text(beside / "report.html", page_of(found, said))
    print(*diagnosis_lines(said), "", sep="\n", flush=True)
    return found, said


def row(found: SpecimenDiagnosis, said: dict[str, Any]) -> dict[str, Any]:
    """What the docs say of a case: no curve, no row of the data."""
    keys = ("verdict", "sentence", "p_value", "mechanism", "combinations", "group", "doubts", "where", "when", "fit")
    by_test: dict[str, Any] = {}
    for each, rows in zip(found.protocol.tests, found.protocol.rows, strict=True):
        errors = {
            name: root_mean_square(each.stress - stress[rows])
            for name, stress in found.stresses.items()
            if not np.isnan(stress[rows]).any()
        }
        by_test[each.name] = {
            "role": "fit" if each.fitted else "check",
            "largest_stress_pa": each.peak,
            "rows": len(each.strain),
            "rmse_pa": errors,
        }
    return {
        **{key: said[key] for key in keys},
        "named": said["mechanisms"],
        "not_tried": {
            one["mechanism"]: one["rejected_because"] for one in said["ranking"] if one["log_evidence"] is None
        },
        "tests": by_test,
        "next_measurement": said["next_measurement"][:3],
        "seconds": sum(found.seconds.values()),
    }


def write_results(name: str, rows: dict[str, Any]) -> None:
    """Write the table that the docs quote."""
    said = {"machine": platform.processor() or platform.machine(), "date": time.strftime("%Y-%m-%d"), "cases": rows}
    RESULTS.mkdir(exist_ok=True)
    text = json.dumps(said, indent=1, default=_plain)
    (RESULTS / f"{name}.json").write_text(text + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def draw(axis: Any, found: SpecimenDiagnosis, number: int, over: str, which: tuple[str, str]) -> None:
    """One test: recorded, and simulated before and after, over time or strain."""
    each, rows = found.protocol.tests[number], found.protocol.rows[number]
    x = each.strain if over == "strain" or each.time is None else each.time - each.time[0]
    axis.plot(x, 1e-3 * each.stress, ".", color=BLACK, markersize=3.5, label="recorded")
    for name, colour, style, label in zip(
        which, (VERMILION, BLUE), ("--", "-"), ("as declared, refitted", "with what was added"), strict=True
    ):
        if name in found.stresses:
            axis.plot(x, 1e-3 * found.stresses[name][rows], style, color=colour, linewidth=1.5, label=label)
    axis.set_title(f"{each.name}{'' if each.fitted else ' (not seen)'}", fontsize=9)
    axis.set_ylabel("nominal stress [kPa]")
    named = {"axial": "stretch", "shear": "shear", "torsion": "shear at the rim"}[each.mode]
    axis.set_xlabel("time [s]" if over == "time" and each.time is not None else named)
    axis.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    axis.spines[["top", "right"]].set_visible(False)
