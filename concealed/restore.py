"""Restore stand-ins whose truths were opened: ``python -m concealed.restore FOLDER`` writes the case of each.

What is kept of a stand-in is its sealed truth, with the exact motion of the observed points. Its recordings are made
again of that without the fine mesh, whose middle the rotation of a badly registered head is about: that of the mesh
that ships stands for it, which moves a recording as a whole by hundredths of a millimetre. Opened cases are data for
development: nothing that is measured on them is proof.
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
    """Sealed truths that were opened after their diagnoses, by the name of each: its set, and its own in that."""
    found = {}
    for folder in sorted((ROOT / "bench" / "results").glob("stand_ins_sealed*")):
        for file in sorted(folder.rglob("*.json.gz")):
            own = file.parent.name if file.parent != folder else file.name.removesuffix(".json.gz")
            found[f"{folder.name.removeprefix('stand_ins_sealed').lstrip('_') or '1'}-{own}"] = file
    return found


def restore(truth: Path, folder: Path) -> Path:
    """Write the case of a sealed truth into a folder of its name within another one, which is returned."""
    sealed = read_sealed(truth)
    data = open_sealed(sealed)
    case = folder / str(data["case"])
    case.mkdir(parents=True, exist_ok=True)
    for name in SHARED:
        shutil.copy(CASES / case.name / name, case / name)
    box = read_mesh(case / "multi.vtu", unit="mm").points
    observed = [data["observed"][wall] for wall in WALLS]
    points, exact = (np.vstack([wall[key] for wall in observed]) for key in ("point_m", "displacement_m"))
    made = read_truth(data)
    blur, middle = made.drawn.blur, 0.5 * (box.min(axis=0) + box.max(axis=0))
    seen = blur.misaligned(points, exact, middle) + blur.noise(points)
    first = len(observed[0]["point_m"])
    walls = [(points[:first], seen[:first]), (points[first:], seen[first:])]
    publish(case, made.declared_level, walls, fingerprint(sealed))
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
