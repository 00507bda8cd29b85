"""FEBio's test problems: its golden number of each, the norm of the displacements that are solved for, and ours.

The numbers of the problems and their golden numbers are those of FEBio's test suite (`data/febio/*.json`, written by
`febio.reader` and `febio.problem`). Where an exact solution is homogeneous our own solver computes it on tetrahedra;
otherwise FElupe does on FEBio's hexahedra, with our materials at the quadrature points. How far off a number is is how
far FEBio iterates: to changes of displacements of 1e-3. docs/febio.md lists all problems, and those that are left out.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from febio.hexahedra import solve_on_hexahedra
from febio.materials import constitution
from febio.problem import Problem, read_problems
from febio.tetrahedra import solve_on_tetrahedra

# kernels of FEBio's laws, which nobody else uses, take ten seconds to compile
pytestmark = pytest.mark.slow(1)

DATA = Path(__file__).parent / "data"
PROBLEMS = {problem.name: problem for problem in read_problems(DATA / "febio")}
#: Bounds of the relative errors; the solution is homogeneous.
HOMOGENEOUS = {
    "ma03": 2e-7, "ma12": 2e-6, "ma13": 5e-7, "ma20": 2e-12, "ma22": 2e-12, "ma24": 2e-12, "ma36": 1e-8, "ma37": 1e-7,
    "ma47": 1e-9, "ma48": 1e-5, "ma53": 2e-12, "mi03": 1e-10, "mi04": 5e-8, "mi25": 2e-6, "mi27": 2e-6, "mi44": 5e-10,
    "mi45": 1e-8, "mu03": 2e-9, "te01": 2e-8,
}  # fmt: skip
#: Bounds, and in how many steps the loads are put on; on hexahedra.
HEXAHEDRA = {
    "di01": (5e-8, 1), "di02": (1e-8, 1), "fi02": (2e-8, 1), "ma01": (5e-6, 1), "ma02": (1e-7, 1), "ma05": (1e-11, 1),
    # FEBio iterates the pressure of fi03 until its volume nearly stays; here it stays
    "fi03": (5e-5, 5),
    "ma06": (2e-11, 1), "ma11": (1e-7, 2), "ma14": (2e-9, 1), "ma15": (2e-5, 1), "ma21": (1e-11, 1), "ma23": (2e-12, 1),
    "ma25": (2e-12, 1), "ma32": (2e-9, 20), "mi02": (2e-7, 1), "mi05": (2e-7, 1), "mi06": (5e-12, 1),
    "mi09": (1e-5, 1), "mi37": (5e-6, 2), "mi43": (1e-8, 1), "mu02": (2e-12, 1),
}  # fmt: skip
#: Where FEBio's number is off by more than its iterations are.
LOOSE = {
    "mi01": "its nodes are tied by a penalty and multipliers that are good to a tenth of the force",
    "ma52": "a viscous solid creeps to rest under a pressure; the state of rest is computed here",
}
REFERENCE = "FEBio's golden numbers"


def parts(problem: Problem) -> str:
    """Whether a problem's law is one of warpbrain's, or one that only the tests have."""
    found = constitution(problem, problem.elements[0]["material"], problem.end)
    return "warpbrain's laws" if found.shipped else "further laws"


def cases() -> list[tuple[str, str]]:
    """Problems and elements: what only the tests have does not act on quadratic tetrahedra."""
    found = []
    for name in HOMOGENEOUS:
        kinds = ["tet4", "tet4-averaged", "tet10"] if parts(PROBLEMS[name]) == "warpbrain's laws" else ["tet4"]
        found += [(name, kind) for kind in kinds]
    return found


@pytest.mark.parametrize(("name", "elements"), cases())
def test_on_tetrahedra(name, elements, device, verify):
    problem = PROBLEMS[name]
    error = abs(solve_on_tetrahedra(problem, elements, device) / problem.golden - 1.0)
    verify(f"FEBio's homogeneous problems, {parts(problem)}, {elements}", REFERENCE, error, HOMOGENEOUS[name])


@pytest.mark.parametrize("name", HEXAHEDRA)
def test_on_hexahedra(name, verify):
    problem, (bound, steps) = PROBLEMS[name], HEXAHEDRA[name]
    error = abs(solve_on_hexahedra(problem, "cpu", steps) / problem.golden - 1.0)
    verify(f"FEBio's problems on FElupe's hexahedra, {parts(problem)} at their points", REFERENCE, error, bound)


@pytest.mark.parametrize("name", LOOSE)
def test_where_febio_is_less_exact(name, verify):
    problem = PROBLEMS[name]
    error = abs(solve_on_tetrahedra(problem, "tet4", "cpu") / problem.golden - 1.0)
    verify(f"FEBio's `{name}`: {LOOSE[name]}", REFERENCE, error, 3e-4)


def test_every_problem_is_compared():
    assert {*HOMOGENEOUS, *HEXAHEDRA, *LOOSE} == set(PROBLEMS)


def test_where_the_error_comes_from():
    """Our second opinion of te01 (B1): SciPy on three stretches, with differences of the energy."""
    other = json.loads((DATA / "structures.json").read_text())["B1 FEBio te01 single tet"]["solution_norm"]
    ours = solve_on_tetrahedra(PROBLEMS["te01"], "tet4", "cpu")
    assert np.isclose(ours, other, rtol=1e-9)
