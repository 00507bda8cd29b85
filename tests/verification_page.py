"""The tables of docs/verification.md, made of the rows that a run of the tests recorded."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from verification_rows import Measurement, worst

#: Sections in their order: of all beginnings of a test's path the longest one that fits says where its rows are.
SECTIONS: dict[str, str] = {
    "tests/kernels/": "Laws, elements and linear algebra",
    "tests/mesh/": "Meshes and integrals",
    "tests/verification/": "Bodies with known solutions",
    "tests/verification/test_manufactured": "Manufactured solutions: orders of convergence",
    "tests/verification/test_convergence": "Manufactured solutions: orders of convergence",
    "tests/verification/test_consolidation": "Consolidation",
    "tests/verification/test_contact": "Contact",
    "tests/verification/test_second_opinions": "The same mesh by other codes",
    "tests/verification/test_mechanisms_felupe": "The same mesh by other codes",
    "tests/verification/test_golden_cube": "The same mesh by other codes",
    "tests/verification/test_febio": "FEBio's test problems",
    "tests/physics/": "Laws, loads and mechanisms",
    "tests/simulation/": "Equilibria, motions, specimens and derivatives",
    "tests/gp/": "The generative model",
    "tests/estimation/": "Estimation",
    "tests/inference/": "Inference",
    "tests/diagnosis/": "Diagnosis",
    "tests/referee/": "Referee",
    "tests/bench/": "Benchmarks",
    "tests/": "Everything else",
}

INTRODUCTION = """\
# What was verified

Made by `python docs/make_verification.py`. An error without a unit is relative; `python -m pytest TEST` runs a row.
"""


def page(measurements: Iterable[Measurement], made: Mapping[str, str]) -> str:
    """Markdown text of the tables.

    Parameters
    ----------
    measurements : iterable of Measurement
        Of one run of all tests that verify.
    made : mapping
        What the figures were made on and with: machine, date, commit, versions, in words.

    Raises
    ------
    ValueError
        If there is no measurement, or one lies beyond its bound.
    """
    rows = worst(measurements)
    if not rows:
        raise ValueError("no test recorded a row")
    for row in rows:
        if not row.error <= row.bound:
            raise ValueError(f"{row.test}: {row.claim}: {row.error:.3g} {row.unit}, allowed {row.bound:.3g}")
    parts = [INTRODUCTION, "".join(f"- {what}: {value}\n" for what, value in made.items())]
    for title in dict.fromkeys(SECTIONS.values()):
        if own := [row for row in rows if section(row.test) == title]:
            lines = ["| claim | reference | error | allowed | test |", "|---|---|---|---|---|"]
            parts.append(f"## {title}\n\n" + "\n".join([*lines, *map(_line, own)]) + "\n")
    return "\n".join(parts)


def section(test: str) -> str:
    """Title of the section of a test (a node of pytest)."""
    return SECTIONS[max((path for path in SECTIONS if test.startswith(path)), key=len)]


def node(test: str) -> str:
    """A node of pytest without the parameters of a test."""
    return test.partition("[")[0]


def named_tests(text: str) -> list[tuple[str, str]]:
    """File and function of every test that the tables name."""
    return re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text)


def _line(row: Measurement) -> str:
    cells = (row.claim, row.reference, amount(row.error, row.unit), amount(row.bound, row.unit))
    cells = (*cells, f"`{node(row.test)}`")
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def amount(value: float, unit: str) -> str:
    """An error with its unit; a relative one above 1e-3 in per cent."""
    if not unit and value >= 1e-3:
        value, unit = 100.0 * value, "%"
    number = f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
    return f"{number} {unit}".rstrip()
