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
