"""`report.html` of the tests of a specimen: recorded and simulated curves, and what the model leaves out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpbrain.report.comparison import explained_of
from warpbrain.report.generative.page import BLUE
from warpbrain.report.page.document import document, header, listed, section, write_document
from warpbrain.report.page.figures import inlined
from warpbrain.report.page.tables import table
from warpbrain.report.run_page import recordings_table, remarks, tissue_table, versions
from warpbrain.report.specimen_picture import tests_figure
from warpbrain.simulation.specimen_run import Tested


def write_specimen_page(path: Path, summary: Mapping[str, Any], tests: Sequence[Tested]) -> None:
    """Write the page; `summary` is what `summary.json` holds."""
    case, compared = summary["case"], summary["recordings"]["compared"]
    figure = inlined(
        lambda narrow: tests_figure(tests, 1 if narrow else 2),
        f"Recorded and simulated curves of {len(tests)} tests.",
        "Each test as it was recorded and as it is simulated. What is marked check is not to be fitted.",
    )
    seconds = [[name, f"{value:.2f}"] for name, value in summary["seconds_by_phase"].items()]
    sections = [
        section("Tests", figure),
        section("What was recorded", recordings_table(compared)),
        section("What the model leaves out", listed(case["left_out"])),
        section("What was assumed", listed(case["assumptions"]), tissue_table(case), remarks(case["remarks"])),
        section(
            "How it was computed",
            table(("phase", "time [s]"), seconds, numbers=(1,)),
            versions(summary["versions"]),
        ),
    ]
    worse = explained_of(compared).sentences
    sentences = worse or ["Every test is nearer to this simulation than to none."]
    top = header(case["title"], "tests of a specimen", sentences, [("tests", f"{len(tests)}")])
    write_document(path, document(f"{case['name']}: {case['title']}", top, sections, (BLUE, "#ffffff")))
