"""The brain phantom, an unstructured mesh, by other finite element codes."""

import os
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path

import felupe
import numpy as np
import pytest
from bodies import model_of
from verification_rows import Row

from warpbrain.mesh import TetMesh, read_mesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

MU, POISSON = 333.28, 0.45
#: [N]; the cap moves by some 4 mm.
FORCE = (0.05, 0.0, -0.2)


@pytest.fixture(scope="module")
def phantom() -> TetMesh:
    with resources.as_file(resources.files("warpbrain.cases") / "data" / "phantom" / "single-coarse.vtu") as path:
        return read_mesh(path, unit="mm")


def solve(mesh: TetMesh, formulation: str, device: str) -> np.ndarray:
    constrained = np.repeat(mesh.node_sets["fixed"][:, None], 3, axis=1)
    push = NodalForce(nodes="superior", total=FORCE)
    material = Material(NeoHookean(MU), POISSON, formulation)
    model = model_of(mesh, material, constrained=constrained, loads=[push])
    return solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-11)).u


@pytest.fixture
def calculix() -> str:
    """The program of CalculiX, which a continuous integration must have."""
    if program := shutil.which("ccx"):
        return program
    reason = "CalculiX (ccx) is not installed: apt-get install calculix-ccx"
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


def test_felupe(phantom: TetMesh, device: str, verify: Row) -> None:
    """To the tolerance of the two Newton methods."""
    mesh = felupe.Mesh(np.array(phantom.points), np.array(phantom.tetrahedra), "tetra")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionTetra(mesh), dim=3)])
    lam = 2.0 * MU * POISSON / (1.0 - 2.0 * POISSON)
    solid = felupe.SolidBody(felupe.NeoHookeCompressible(mu=MU, lmbda=lam), field)
    cap = np.flatnonzero(phantom.node_sets["superior"])
    load = felupe.PointLoad(field, cap, values=np.tile(np.array(FORCE) / len(cap), (len(cap), 1)))
    fixed = felupe.Boundary(field[0], mask=phantom.node_sets["fixed"])
    dof0, dof1 = felupe.dof.partition(field, {"fixed": fixed})
    result = felupe.newtonraphson(items=[solid, load], dof0=dof0, dof1=dof1, tol=1e-11, verbose=0)
    assert result.success
    expected = result.x[0].values
    found = solve(phantom, "coupled", device)
    largest = np.linalg.norm(expected, axis=1).max()
    assert largest > 0.003
    claim = "displacement of the phantom under a force on its cap, coupled neo-Hookean, 4.3 mm"
    verify(claim, "FElupe, the same mesh", np.abs(found - expected).max() / largest, 1e-10)


def test_calculix(phantom: TetMesh, device: str, calculix: str, tmp_path: Path, verify: Row) -> None:
    """Uncoupled neo-Hookean is CalculiX's NEO HOOKE with `D1 = 2/K`; it prints seven digits."""
    K = 2.0 * MU * (1.0 + POISSON) / (3.0 * (1.0 - 2.0 * POISSON))
    cap = np.flatnonzero(phantom.node_sets["superior"])

    def listing(ids: np.ndarray) -> list[str]:
        return [f"{i + 1}," for i in ids]

    # CalculiX reads twenty characters of a number and no more
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i + 1}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(phantom.points)]
    lines += ["*ELEMENT, TYPE=C3D4, ELSET=EALL"]
    lines += [f"{i + 1}, " + ", ".join(str(n + 1) for n in t) for i, t in enumerate(phantom.tetrahedra)]
    lines += ["*NSET, NSET=FIXED", *listing(np.flatnonzero(phantom.node_sets["fixed"]))]
    lines += ["*MATERIAL, NAME=NH", "*HYPERELASTIC, NEO HOOKE", f"{MU / 2.0:.16g}, {2.0 / K:.16g}"]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=NH", "*STEP, NLGEOM, INC=200", "*STATIC", "0.5, 1.0"]
    # tighter than by default: residual and correction to 1e-8 of force and displacement
    lines += ["*CONTROLS, PARAMETERS=FIELD", "1e-8, 1e-8, , , 1e-8, , , "]
    lines += ["*BOUNDARY", "FIXED, 1, 3, 0.0", "*CLOAD"]
    lines += [f"{i + 1}, {k + 1}, {FORCE[k] / len(cap):.16g}" for i in cap for k in range(3)]
    lines += ["*NODE PRINT, NSET=NALL, FREQUENCY=999", "U", "*END STEP", ""]
    (tmp_path / "phantom.inp").write_text("\n".join(lines))
    run = subprocess.run([calculix, "-i", "phantom"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Job finished" in run.stdout, run.stdout[-2000:]
    expected = np.full(phantom.points.shape, np.nan)
    last = re.split(r"\n(?= displacements)", (tmp_path / "phantom.dat").read_text())[-1]
    for row in (line.split() for line in last.splitlines()[1:]):
        if len(row) == 4:
            expected[int(row[0]) - 1] = [float(v) for v in row[1:]]
    assert np.all(np.isfinite(expected))
    found = solve(phantom, "uncoupled", device)
    largest = np.linalg.norm(expected, axis=1).max()
    claim = "displacement of the phantom under a force on its cap, uncoupled neo-Hookean"
    verify(claim, "CalculiX, the same mesh, all seven digits it prints", np.abs(found - expected).max() / largest, 2e-7)
