"""
What was left out
=================

A concealed case, step by step: a block of gel hangs half out of its bath, which its case does not say. Tracked points
are all that the diagnosis has.
"""

import tempfile
from itertools import permutations
from pathlib import Path

import numpy as np

import warpbrain as wb
from warpbrain.recordings.location import locate

SIDE, CELLS, POINTS, NOISE = 0.06, 5, 45, 1e-4
rng = np.random.default_rng(7)

# %%
# 1. The body: a cube, each cell of which is cut into six tetrahedra.

lattice = np.stack(np.meshgrid(*3 * [np.arange(CELLS + 1)], indexing="ij"), -1).reshape(-1, 3)
corner = np.stack(np.meshgrid(*3 * [np.arange(CELLS)], indexing="ij"), -1).reshape(-1, 3)
stride = np.array([(CELLS + 1) ** 2, CELLS + 1, 1])
tetrahedra = []
for path in permutations(range(3)):
    steps = np.vstack([np.zeros(3, int), np.cumsum(np.eye(3, dtype=int)[list(path)], axis=0)])
    cells = np.stack([(corner + step) @ stride for step in steps], -1)
    odd = np.linalg.det(np.eye(3)[list(path)]) < 0
    tetrahedra.append(cells[:, [0, 2, 1, 3]] if odd else cells)
points = SIDE / CELLS * lattice
mesh = wb.TetMesh(points, np.concatenate(tetrahedra), node_sets={"bottom": points[:, 2] == 0.0})

# %%
# 2. What its case says: gel that is glued to the table.

CASE = """
[case]
name = "bath"
title = "A block of gel"
origin = "synthetic"
gravity_axis = [0, 0, -1]
[mesh]
file = "mesh.vtu"
[tissue.1]
name = "gel"
mu = 1000.0
[body]
density = 1000.0
poisson = 0.45
[[boundary]]
name = "table"
nodes = "bottom"
kind = "fixed"
"""
RECORDING = """
[[recording]]
name = "{0}"
kind = "points"
file = "{0}.csv"
role = "{1}"
sigma = 0.1
"""
folder = Path(tempfile.mkdtemp()) / "bath"
folder.mkdir()
wb.write_mesh(folder / "mesh.vtu", mesh, unit="mm")
(folder / "case.toml").write_text(CASE)

# %%
# 3. What is true: fluid reaches to half of its height. Two sets of points are tracked, one to fit and one to check.

truth = wb.run(wb.assume(wb.read_case(folder), "gravity:csf_level=30"), elements="tet4", device="cpu")
for name in ("beads", "others"):
    where = rng.uniform(0.05, 0.95, size=(POINTS, 3)) * SIDE
    moved = locate(mesh.points, mesh.tetrahedra, where).matrix(len(points)) @ truth.u
    moved += NOISE * rng.normal(size=moved.shape)
    table = 1000.0 * np.column_stack([where, moved])
    np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="x,y,z,ux,uy,uz", comments="", fmt="%.6f")
(folder / "case.toml").write_text(CASE + RECORDING.format("beads", "fit") + RECORDING.format("others", "check"))
case = wb.read_case(folder)

# %%
# 4. What the case as it is declared explains: nothing moves.

wb.run(case, device="cpu")

# %%
# 5. What the diagnosis says of it. Four kinds of mechanisms are looked for here; `warpbrain diagnose` looks for all.

options = wb.DiagnosisOptions(candidates=("gravity", "pressure", "swelling", "falx"), mesh_error=False)
diagnosis = wb.diagnose(case, options, device="cpu")
print(diagnosis.sentence)
diagnosis

# %%
# 6. Where recordings and the declared case differ, and the case with what was named, which is ready to run.

diagnosis.plot()

# %%

again = wb.run(diagnosis.explained, device="cpu")
print(
    {
        name: f"{1000.0 * before:.2f} mm before, {1000.0 * after:.2f} after"
        for name, (before, after) in again.errors.items()
    }
)
assert "gravity" in [one.kind for one in diagnosis.named]
