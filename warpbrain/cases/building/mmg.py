"""One pass of MMG in a process of its own: `python -m warpbrain.cases.building.mmg IN OUT OPTIONS`.

MMG answers Ctrl-C by ending the process that it runs in. Here that is a child, and the program itself clears up.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.errors import BuildError

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Exit status of the child where MMG gave up.
_GAVE_UP = 3


def run_mmg(
    points: Floats, tetrahedra: Integers, labels: Integers, options: dict[str, float]
) -> tuple[Floats, Integers, Integers] | None:
    """Remesh with MMG; None where it gives up.

    Parameters
    ----------
    points : (n, 3) array
    tetrahedra : (m, 4) array
    labels : (m,) array
    options : dict
        Of `mmgpy.MmgMesh3D.remesh`.

    Raises
    ------
    BuildError
        If the child cannot be run at all.
    """
    with tempfile.TemporaryDirectory(prefix="warpbrain-mmg-") as folder:
        given, made = Path(folder) / "given.npz", Path(folder) / "made.npz"
        np.savez(given, points=points, tetrahedra=tetrahedra, labels=labels)
        command = [sys.executable, "-m", "warpbrain.cases.building.mmg", str(given), str(made), json.dumps(options)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == _GAVE_UP:
            return None
        if done.returncode != 0 or not made.exists():
            said = (done.stderr.strip() or done.stdout.strip() or f"exit status {done.returncode}").splitlines()[-1]
            raise BuildError(f"MMG could not be run: {said}")
        with np.load(made) as result:
            return result["points"], result["tetrahedra"], result["labels"]


def _child(given: Path, made: Path, options: dict[str, float]) -> int:
    from mmgpy import MmgMesh3D

    with np.load(given) as data:
        arrays = dict(data)
    mesh = MmgMesh3D()
    mesh.set_mesh_size(vertices=len(arrays["points"]), tetrahedra=len(arrays["tetrahedra"]))
    mesh.set_vertices(arrays["points"])
    mesh.set_tetrahedra(arrays["tetrahedra"].astype(np.int32), arrays["labels"].astype(np.int64))
    try:
        mesh.remesh(**options)
    except RuntimeError:
        return _GAVE_UP
    tetrahedra, labels = mesh.get_elements_with_refs()
    np.savez(
        made,
        points=mesh.get_vertices(),
        tetrahedra=np.asarray(tetrahedra, dtype=np.int64),
        labels=np.asarray(labels, dtype=np.int64),
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(_child(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3])))
