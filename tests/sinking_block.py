"""A block of gel with tracked points that sinks under its weight, of which its case says nothing; and its diagnosis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.inference.decide import Decision
from warpbrain.mesh import TetMesh, write_mesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.location import locate
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.options import DiagnosisOptions

#: What is looked for: few kinds take few seconds.
OPTIONS = DiagnosisOptions(candidates=("gravity", "pressure", "swelling", "falx"), mesh_error=False)

#: Noise of the recordings [m].
NOISE = 1e-4
#: Edge [m] and points of a recording.
_SIDE, _POINTS = 0.06, 45

_CASE = """\
[case]
name = "sinking"
title = "A block of gel that sinks"
origin = "synthetic"
units = "mm"
axes = "RAS"
gravity_axis = [0.0, 0.0, -1.0]

[mesh]
file = "mesh.vtu"

[tissue.1]
name = "gel"
model = "neo-hookean"
mu = 1000.0

[body]
density = 1000.0
poisson = 0.45

[[boundary]]
name = "table"
nodes = "bottom"
kind = "fixed"
"""

_RECORDINGS = """\
[[recording]]
name = "beads"
kind = "points"
file = "recordings/beads.csv"
role = "fit"
sigma = 0.1

[[recording]]
name = "others"
kind = "points"
file = "recordings/others.csv"
role = "check"
sigma = 0.1
"""


def write_sinking(folder: Path, also: tuple[Mechanism, ...] = ()) -> Case:
    """Write the case with recordings of a state that has the weight which the case leaves out, and what else acts."""
    mesh = box((5, 5, 5), (_SIDE, _SIDE, _SIDE))
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    one = np.ones(len(mesh.tetrahedra), dtype=np.int32)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, one, {"bottom": z == 0.0, "side": x == x.max()}, {})
    folder.mkdir(parents=True, exist_ok=True)
    write_mesh(folder / "mesh.vtu", mesh, unit="mm")
    (folder / "case.toml").write_text(_CASE, encoding="utf-8")
    # half of the block is out of the fluid
    sinks = Gravity(direction=(0.0, 0.0, -1.0), density=1000.0, csf_level=0.03)
    model = model_of(replace(find_case(str(folder)), mechanisms=(sinks, *also)))
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    (folder / "recordings").mkdir()
    rng = np.random.default_rng(7)
    for name in ("beads", "others"):
        points = rng.uniform(0.05, 0.95, size=(_POINTS, 3)) * _SIDE
        moved = locate(mesh.points, mesh.tetrahedra, points).matrix(len(mesh.points)) @ u
        moved += NOISE * rng.normal(size=moved.shape)
        lines = [",".join(f"{1000.0 * v:.6f}" for v in row) for row in np.column_stack([points, moved])]
        (folder / "recordings" / f"{name}.csv").write_text("\n".join(["x,y,z,ux,uy,uz", *lines, ""]), encoding="utf-8")
    (folder / "case.toml").write_text(_CASE + _RECORDINGS, encoding="utf-8")
    return find_case(str(folder))


def diagnose_sinking(folder: Path, also: tuple[Mechanism, ...] = ()) -> Diagnosis:
    """Its diagnosis, in seconds."""
    return Diagnosing(write_sinking(folder, also), OPTIONS, "cpu").run()


def verdict_of(found, verdict):
    """The diagnosis as if another verdict had been given."""
    if verdict.startswith("named"):
        return replace(found, decision=Decision(verdict, ("gravity",)))
    fit = replace(found.fit, explained=None, improvement=None, placebo_p=None)
    causes = {"group": ("gravity", "swelling"), "not physics": ("registration",)}.get(verdict, ())
    return replace(found, decision=Decision(verdict, causes), named=(), explained=None, fit=fit)
