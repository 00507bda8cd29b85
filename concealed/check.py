"""Check the stand-ins: ``python -m concealed.check`` compares every sealed truth with its published hash.

``--remake FILE`` opens a truth, finds the motion of its observed points again from what acted, and compares. Truths
of the cases that ship and of the first nine sealed sets were found on linear tetrahedra: they differ by millimetres.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from concealed.body import body_of
from concealed.observing import WALLS
from concealed.places import MESHES, published_hash, truth_file
from concealed.published import NAMES
from concealed.record import read_truth
from concealed.sealing import fingerprint, open_sealed, read_sealed
from concealed.trial import Trial
from concealed.truth_mesh import truth_mesh
from warpbrain.cases.building.pipeline import RECIPES

#: Motion that is found again differs by no more than this [m].
SAME = 5e-6
#: Distance of an observed point of a truth from its node at most [m]: coordinates are rounded to nanometres.
ROUNDING = 2e-9


def intact(name: str) -> bool:
    """The sealed truth of a case is the one whose hash was published."""
    data = read_sealed(truth_file(name))
    return fingerprint(data) == published_hash(name) and open_sealed(data)["case"] == name


def remade(file: Path, meshes: Path) -> float:
    """Find the motion of the observed points of a truth again; returns the largest difference [m] from what it holds.

    Parameters
    ----------
    file : Path
        Of the sealed truth.
    meshes : Path
        Folder of fine meshes; one that is not there is made.

    Raises
    ------
    ValueError
        If the fine mesh is not the one that the truth was found on, but for the numbers of nodes, which differ between
        processors.
    """
    data = open_sealed(read_sealed(file))
    truth = read_truth(data)
    mesh = truth_mesh(truth.name, meshes)
    body = body_of(mesh, str(RECIPES[truth.name].resection))
    # the observed points are nodes of the fine mesh
    recorded = [data["observed"][wall] for wall in WALLS]
    distances, nodes = zip(*(cKDTree(body.mesh.points).query(wall["point_m"]) for wall in recorded), strict=True)
    if len(mesh.points) != data["mesh"]["made_nodes"] or max(map(np.max, distances)) > ROUNDING:
        raise ValueError(f"{file}: the fine mesh made here is another; the truth was made with {data['versions']}")
    motion = Trial(truth.drawn, body, nodes).exact(truth.strength, truth.level)
    differences = (u - np.array(wall["displacement_m"]) for u, wall in zip(motion, recorded, strict=True))
    return max(float(np.abs(difference).max()) for difference in differences)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; 1 if anything does not match."""
    parser = argparse.ArgumentParser(prog="python -m concealed.check", description=__doc__)
    parser.add_argument("--remake", nargs="+", default=[], type=Path, metavar="FILE", help="of sealed truths")
    parser.add_argument("--meshes", type=Path, default=MESHES, help="folder of fine meshes, outside the repository")
    given = parser.parse_args(arguments)
    sound = True
    for name in NAMES:
        same = intact(name)
        sound &= same
        print(f"{name}: {'the truth is the one whose hash was published' if same else 'HASH DIFFERS'}")
    for file in given.remake:
        try:
            difference = remade(file, given.meshes)
        except (OSError, ValueError) as error:
            parser.error(str(error))
        sound &= difference <= SAME
        print(f"{file}: motion found again differs by at most {1e6 * difference:.2f} micrometres", flush=True)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
