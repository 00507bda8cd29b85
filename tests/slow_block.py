"""A block of gel with tracked points that is pressed on once and gives way in time, of which its case says nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh, write_mesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.recordings.location import locate
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

#: When was recorded [s], and what with.
TIMES = (5.0, 40.0, 300.0)
PERMEABILITY = 5e-10
CAUSES: dict[str, Mechanism] = {
    "drainage": Drainage(permeability=PERMEABILITY),
    "viscoelasticity": Viscoelasticity(moduli=(1.0,), times=(100.0,)),
    "viscoelasticity of two times": Viscoelasticity(moduli=(0.5, 0.5), times=(20.0, 200.0)),
}
#: Edge [m], noise [m] and points of the recording.
_SIDE, _NOISE, _POINTS = 0.06, 2e-5, 30

_CASE = """\
[case]
name = "slow"
title = "A block of gel that gives way"
origin = "synthetic"
units = "mm"
axes = "RAS"

[mesh]
file = "mesh.vtu"

[tissue.1]
name = "gel"
model = "neo-hookean"
mu = 1000.0

[body]
density = 1000.0
poisson = 0.3

[[boundary]]
name = "table"
nodes = "bottom"
kind = "fixed"

[[boundary]]
name = "lid"
nodes = "top"
kind = "force"
total = [0.2, 0.0, -0.6]
"""

_RECORDING = """\
[[recording]]
name = "beads"
kind = "points"
file = "beads.csv"
role = "fit"
sigma = 0.02
"""


def write_slow(folder: Path, cause: Mechanism) -> Case:
    """Write the case with recordings of what the cause makes of it, in 25 steps for each order of time."""
    mesh = box((5, 5, 5), (_SIDE, _SIDE, _SIDE))
    z = mesh.points[:, 2]
    one = np.ones(len(mesh.tetrahedra), dtype=np.int32)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, one, {"bottom": z == 0.0, "top": z == z.max()}, {})
    folder.mkdir(parents=True, exist_ok=True)
    write_mesh(folder / "mesh.vtu", mesh, unit="mm")
    (folder / "case.toml").write_text(_CASE, encoding="utf-8")
    model = model_of(replace(find_case(str(folder)), mechanisms=(cause,)))
    steps = sorted({*TIMES, *np.geomspace(1e-3 * TIMES[0], TIMES[-1], 120).tolist()[:-1]})
    moments = follow_slowly(System(model, "cpu"), steps, EquilibriumOptions(tolerance=1e-6))
    found = {moment.time: moment.state.u for moment in moments}
    rng = np.random.default_rng(3)
    points = rng.uniform(0.05, 0.95, size=(_POINTS, 3)) * _SIDE
    matrix = locate(mesh.points, mesh.tetrahedra, points).matrix(len(mesh.points))
    lines = ["id,t,x,y,z,ux,uy,uz"]
    for time in TIMES:
        moved = matrix @ found[time] + _NOISE * rng.normal(size=points.shape)
        for number, row in enumerate(np.column_stack([points, moved])):
            lines.append(f"p{number},{time:g}," + ",".join(f"{1000.0 * v:.6f}" for v in row))
    (folder / "beads.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
    (folder / "case.toml").write_text(_CASE + _RECORDING, encoding="utf-8")
    return find_case(str(folder))
