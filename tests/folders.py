"""Case folders that tests write: a block of two tissues that is fixed below and pressed from above."""

from pathlib import Path

import numpy as np
from shapes import box

from warpbrain.mesh import TetMesh, write_mesh

#: Edge of the block [m].
SIDE = 0.03

CASE = """\
[case]
name = "block"
title = "A block of gel"
origin = "synthetic"
units = "mm"
axes = "RAS"

[mesh]
file = "mesh.vtu"

[tissue.1]
name = "soft"
model = "neo-hookean"
mu = 1000.0

[tissue.2]
name = "stiff"
mu = 3000.0

[body]
density = 1000.0
poisson = 0.45

[[boundary]]
name = "table"
nodes = "bottom"
kind = "fixed"

[[boundary]]
name = "press"
nodes = "top"
kind = "force"
total = [0.01, 0.02, -0.05]
"""


#: Recordings that can be added to the case: one of each kind that a body with a mesh can have.
RECORDINGS = """
[[recording]]
name = "beads"
kind = "points"
file = "recordings/beads.csv"
sigma = 0.1

[[recording]]
name = "lid"
kind = "surface"
file = "recordings/lid.csv"
nodes = "top"
role = "check"

[[recording]]
name = "cell"
kind = "force"
file = "recordings/cell.csv"
boundary = "press"
"""

FILES = {
    "recordings/beads.csv": (
        "# tracked by hand\nid,x,y,z,ux,uy,uz\na,10,10,10,0.1,0.0,-0.2\nb,20,15,25,0.0,0.1,-0.5\nc,5,5,30,0.3,0,-1\n"
    ),
    "recordings/lid.csv": "x,y,z\n10,10,29\n20,10,29.5\n10,20,29\n",
    "recordings/cell.csv": "t,fx,fy,fz\n0,0,0,0\n1.0,0.01,0.02,-0.049\n",
}


def block(cells: int = 2) -> TetMesh:
    """A cube with the tissues 1 and 2 side by side, node sets `bottom`, `top` and `nobody`, element set `corner`."""
    mesh = box((cells, cells, cells), (SIDE, SIDE, SIDE))
    z = mesh.points[:, 2]
    centres = mesh.points[mesh.tetrahedra].mean(axis=1)
    return TetMesh(
        mesh.points,
        mesh.tetrahedra,
        np.where(centres[:, 0] < SIDE / 2, 1, 2),
        {"bottom": z == 0.0, "top": z == z.max(), "nobody": np.zeros(len(z), dtype=bool)},
        {"corner": (centres > SIDE / 2).all(axis=1)},
    )


def changed(text: str, *changes: tuple[str, str]) -> str:
    """The text with pieces replaced, each of which must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def write_folder(folder: Path, *changes: tuple[str, str], mesh: TetMesh | None = None) -> Path:
    """Write the block as a case folder, its `case.toml` with pieces replaced; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.toml").write_text(changed(CASE, *changes), encoding="utf-8")
    write_mesh(folder / "mesh.vtu", mesh or block(), unit="mm")
    return folder


def write_recorded(folder: Path, *changes: tuple[str, str], files: dict[str, str | bytes] | None = None) -> Path:
    """The block with its recordings; `files` replaces some of their files."""
    write_folder(folder, *changes)
    with (folder / "case.toml").open("a", encoding="utf-8") as stream:
        stream.write(RECORDINGS)
    for name, content in {**FILES, **(files or {})}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder
