"""Check the stand-ins: ``python -m concealed.check`` compares every sealed truth with its published hash.

``--remake NAME`` opens a truth, makes its recordings again from nothing else, and compares them with what is published.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from concealed.body import Floats, body_of
from concealed.observing import WALLS, Nodes
from concealed.places import CASES, MESHES, published_hash, truth_file
from concealed.publish import read_recording
from concealed.published import NAMES
from concealed.record import read_truth
from concealed.sealing import fingerprint, open_sealed, read_sealed
from concealed.trial import Trial
from concealed.truth_mesh import fingerprint as mesh_fingerprint
from concealed.truth_mesh import truth_mesh
from warpbrain.cases.building.pipeline import RECIPES

#: A remade recording differs from the published one by no more than this [m].
SAME = 5e-6


def intact(name: str) -> bool:
    """The sealed truth of a case is the one whose hash was published."""
    data = read_sealed(truth_file(name))
    return fingerprint(data) == published_hash(name) and open_sealed(data)["case"] == name


def remade(name: str, meshes: Path) -> float:
    """Make the recordings of a case again from its truth; returns the largest difference [m] from what is published.

    Parameters
    ----------
    name : str
    meshes : Path
        Folder of fine meshes; one that is not there is made.

    Raises
    ------
    ValueError
        If the fine mesh is not the one that the truth was made on.
    """
    data = open_sealed(read_sealed(truth_file(name)))
    truth = read_truth(data)
    mesh = truth_mesh(name, meshes)
    if mesh_fingerprint(mesh) != data["mesh"]["sha256"]:
        raise ValueError(f"case {name}: the fine mesh made here is another; the truth was made with {data['versions']}")
    body = body_of(mesh, str(RECIPES[name].resection))
    # the observed points are nodes of the fine mesh
    recorded = [np.array(data["observed"][wall]["point_m"]) for wall in WALLS]
    ventricles, cavity = (_nearest(body.mesh.points, points) for points in recorded)
    trial = Trial(truth.drawn, body, (ventricles, cavity))
    difference = 0.0
    for wall, nodes, seen in zip(WALLS, trial.nodes, trial.observed(truth.strength, truth.level), strict=True):
        points, displacement = read_recording(CASES / name / "recordings" / f"{wall}.csv")
        apart = max(np.abs(points - body.mesh.points[nodes]).max(), np.abs(displacement - seen).max())
        difference = max(difference, float(apart))
    return difference


def _nearest(nodes: Floats, points: Floats) -> Nodes:
    return np.linalg.norm(points[:, None] - nodes[None], axis=2).argmin(axis=1).astype(np.int64)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 1 if anything does not match."""
    parser = argparse.ArgumentParser(prog="python -m concealed.check", description=__doc__)
    parser.add_argument("--remake", nargs="+", default=[], choices=[*NAMES, "all"], metavar="NAME")
    parser.add_argument("--meshes", type=Path, default=MESHES, help="folder of fine meshes, outside the repository")
    given = parser.parse_args(arguments)
    sound = True
    for name in NAMES:
        same = intact(name)
        sound &= same
        print(f"{name}: {'the truth is the one whose hash was published' if same else 'HASH DIFFERS'}")
    for name in NAMES if "all" in given.remake else given.remake:
        difference = remade(name, given.meshes)
        sound &= difference <= SAME
        print(f"{name}: recordings made again differ by at most {1e6 * difference:.2f} micrometres", flush=True)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
