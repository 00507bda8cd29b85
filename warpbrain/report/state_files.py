"""Deformed bodies in the folders of results, opened again: what images are warped by."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.mesh.patience import patience
from warpbrain.mesh.vtu import read_vtu
from warpbrain.report.files import MIDDLES, MILLIMETRES

#: Files that hold a deformed body, in the order in which they are looked for: of `run`, of `estimate` and `diagnose`,
#: and of `ensemble`.
FILES = ("result.vtu", "state.vtu", "fields.vtu")
#: What is known of a place in the body, as `trust` says it; zero is outside of it.
SEEN, UNSEEN, LEFT = 1, 2, 3
TRUST = {
    SEEN: "recordings see a force, and nothing is left",
    UNSEEN: "recordings see nothing",
    LEFT: "recordings and the declared case disagree",
}


@dataclass(frozen=True, eq=False)
class SavedState:
    """A deformed body: its mesh at rest, without sets, and what its nodes carry."""

    path: Path
    mesh: TetMesh
    #: Displacement (n, 3) [m], of an ensemble its mean; and (m, 6, 3) that of the midside nodes of quadratic elements.
    u: Floats
    middles: Floats | None
    #: Standard deviation of the displacement (n,) [m]: the root of the summed variances of its components.
    deviation: Floats | None
    #: (n,): `SEEN`, `UNSEEN` where recordings see no force, `LEFT` where they and the declared case disagree.
    trust: Ints | None


def read_state(result: Path) -> SavedState:
    """Open the deformed body of a result: of a folder that a command has written, or a file of `FILES`.

    `InputError`, naming the file, what was found and what was expected.
    """
    path = result
    if result.is_dir():
        known = [result / name for name in FILES if (result / name).is_file()]
        if not known:
            raise InputError(f"{result}: found none of {', '.join(FILES)}: it is no folder of a result with a body")
        path = known[0]
    elif not result.is_file():
        raise InputError(f"{result}: no such file or folder")
    try:
        with patience(path):
            file = read_vtu(path)
        cells = file.cells[0].data
        at = {name: np.asarray(values, dtype=np.float64) for name, values in file.point_data.items()}
        of_cells = {name: values[0] for name, values in file.cell_data.items()}
        mesh = TetMesh(file.points / MILLIMETRES, cells, of_cells["tissue"])
    except Exception as error:  # whatever its parsers raise
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: no body of tetrahedra that can be read ({detail})") from None
    u = at.get("displacement", at.get("displacement_mean"))
    if u is None or u.shape != mesh.points.shape or not np.isfinite(u).all():
        raise InputError(f"{path}: displacement: expected a finite vector at each of {len(mesh.points)} nodes")
    middles = None
    if MIDDLES in of_cells:
        middles = np.asarray(of_cells[MIDDLES], dtype=np.float64)
        if middles.shape != (len(cells), 18) or not np.isfinite(middles).all():
            raise InputError(f"{path}: {MIDDLES}: expected 18 finite numbers for each of {len(cells)} tetrahedra")
        middles = middles.reshape(-1, 6, 3) / MILLIMETRES
    deviation = trust = None
    if (spread := at.get("displacement_sd")) is not None:
        deviation = np.asarray(np.linalg.norm(spread.reshape(len(spread), -1), axis=1) / MILLIMETRES)
    if {"blind", "significant"} <= at.keys():
        trust = np.where(at["significant"] > 0.0, LEFT, np.where(at["blind"] > 0.0, UNSEEN, SEEN))
    return SavedState(path, mesh, u / MILLIMETRES, middles, deviation, trust)
