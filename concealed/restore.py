"""Restore stand-ins whose truths were opened: ``python -m concealed.restore FOLDER`` writes the case of each.

A sealed truth has the displacement of the observed points without noise, so its recordings can be made again without
the fine mesh. The error of registration turns the head about the middle of that mesh; the middle of the mesh that ships
is taken instead, which shifts a whole recording by hundredths of a millimetre. Opened cases are data for development:
nothing that is measured on them is proof.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np

from concealed.observing import WALLS
from concealed.places import CASES, ROOT
from concealed.publish import publish
from concealed.record import read_truth
from concealed.sealing import fingerprint, open_sealed, read_sealed
from warpbrain.mesh import read_mesh

#: Files of a case that are the same in every stand-in of it.
SHARED = ("multi.vtu", "single.vtu", "meshes.json")


def opened() -> dict[str, Path]:
    """Files of sealed truths that were opened after the diagnosis, by name: number of the set, name of the truth."""
    files = {}
    for folder in sorted((ROOT / "bench" / "results").glob("stand_ins_sealed*")):
        for file in sorted(folder.rglob("*.json.gz")):
            own = file.parent.name if file.parent != folder else file.name.removesuffix(".json.gz")
            files[f"{folder.name.removeprefix('stand_ins_sealed').lstrip('_') or '1'}-{own}"] = file
    return files


def restore(truth: Path, folder: Path) -> Path:
    """Write the case of a sealed truth.

    Parameters
    ----------
    truth : Path
        File of the sealed truth.
    folder : Path
        In which the folder of the case is made.

    Returns
    -------
    Path
        Folder of the case.

    Raises
    ------
    ValueError
        If the file holds no sealed truth.
    """
    sealed = read_sealed(truth)
    data = open_sealed(sealed)
    case = folder / str(data["case"])
    case.mkdir(parents=True, exist_ok=True)
    for name in SHARED:
        shutil.copy(CASES / case.name / name, case / name)
    nodes = read_mesh(case / "multi.vtu", unit="mm").points
    observed = [data["observed"][wall] for wall in WALLS]
    points, exact = (np.vstack([wall[key] for wall in observed]) for key in ("point_m", "displacement_m"))
    opened_truth = read_truth(data)
    seen = opened_truth.drawn.blur.seen(points, exact, 0.5 * (nodes.min(axis=0) + nodes.max(axis=0)))
    first = len(observed[0]["point_m"])
    walls = [(points[:first], seen[:first]), (points[first:], seen[first:])]
    publish(case, opened_truth.declared_level, walls, fingerprint(sealed))
    return case


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m concealed.restore", description=str(__doc__).split("\n\n")[0])
    parser.add_argument("folder", type=Path, help="where a folder of each is made; its truth stays where it is")
    folder = parser.parse_args().folder
    for name, truth in opened().items():
        effects = ", ".join(effect["kind"] for effect in open_sealed(read_sealed(truth))["effects"])
        print(f"{restore(truth, folder / name)}: {effects}", flush=True)


if __name__ == "__main__":
    main()
