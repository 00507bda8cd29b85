"""The page docs/verification.md, made of the rows that a run of the tests recorded."""

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
# Verification

Numbers that this code did not make, and how far it is from them. Every row is a test; this page is made by
`python docs/make_verification.py`, which runs them and writes what they measured: the error that is nearest to
its bound, where a test does the same for several laws, elements or devices. An error without a unit is relative.
"""

#: What no row can say.
CLOSING = """\
## What is not compared

**CPU against GPU.** Rows are of the machine above. On an H200 the same 20 steps of the multi-tissue phantom differ from
the CPU's by 3e-18 m, the equilibrium of case 0529 by 5e-10 mm (2026-11-21).

**Locking.** Plain linear tetrahedra lock: Cook's membrane at nu = 0.45 moves 11.96 mm at 32 elements a side and 8.12 mm
at 8, by DOLFINx and not by us, against 12.74 mm: 6 % and 36 % too little. Our elements are the same. The other kinds:
[solvers.md](solvers.md).

**Other problems of FEBio's suite.** [febio.md](febio.md) has those that were looked at, each with its reason. Of others
`mg01` is growth of several generations in the loaded shape, which `swelling` is not; `ma16` relaxes the deviator of
Ogden's law, where `viscoelasticity` relaxes the neo-Hookean one; `te02` to `te05` need the stabilisation of FEBio's
nodal tetrahedra.
"""


def page(measurements: Iterable[Measurement], made: Mapping[str, str]) -> str:
    """Markdown text of the page.

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
            lines = ["| claim | reference | error | allowed | command |", "|---|---|---|---|---|"]
            parts.append(f"## {title}\n\n" + "\n".join([*lines, *map(_line, own)]) + "\n")
    return "\n".join([*parts, CLOSING])


def section(test: str) -> str:
    """Title of the section of a test (a node of pytest)."""
    return SECTIONS[max((path for path in SECTIONS if test.startswith(path)), key=len)]


def node(test: str) -> str:
    """A node of pytest without the parameters of a test."""
    return test.partition("[")[0]


def named_tests(text: str) -> list[tuple[str, str]]:
    """File and function of every test that a page gives the command of."""
    return re.findall(r"python -m pytest (tests/[\w/]+\.py)::(\w+)", text)


def _line(row: Measurement) -> str:
    cells = (row.claim, row.reference, amount(row.error, row.unit), amount(row.bound, row.unit))
    command = f"`python -m pytest {node(row.test)}`"
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in (*cells, command)) + " |"


def amount(value: float, unit: str) -> str:
    """An error with its unit; a relative one above 1e-3 in per cent."""
    if not unit and value >= 1e-3:
        value, unit = 100.0 * value, "%"
    number = f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
    return f"{number} {unit}".rstrip()
