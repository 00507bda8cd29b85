"""The 15 patients of RESECT as shipped cases: measured landmarks in the template brain, which is no patient's anatomy.

    python -m bench.real.resect_cases FOLDER     # the files CaseN-MRI-beforeUS.tag; writes into warpbrain/cases/data

Landmarks are pairs: in the preoperative MRI, and in the ultrasound before the dura was opened. The image is not there
to be meshed, so the mesh of the phantom stands around them: it is shared by all, and landmarks are shifted by the least
translation that puts each 3 mm or more below its outer surface. Displacements are as measured. The dura was closed: the
brain slides along the skull, which is the template closed over its sulci and fissures.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh, nodes_of, read_mesh_file
from warpbrain.recordings.location import locate

Floats = NDArray[np.float64]

DATA = Path(__file__).resolve().parents[2] / "warpbrain" / "cases" / "data" / "phantom"
#: Least depth of a landmark [mm] and spacing of the grid on which depths are known [mm].
DEPTH, SPACING = 3.0, 2.0
#: Clefts narrower than twice this [mm] are closed over by the skull.
CLOSING = 15.0
#: Of neuronavigation at the target, one component: 2 to 5 mm in all in the review of Gerard et al., Neurosurgery 62,
#: 2017, doi 10.1227/NEU.0000000000001439. Stated before any of these cases was diagnosed.
ACCURACY = "{ mm = 2.0, degrees = 2.0 }"

_CASE = """\
# Landmarks of patient {patient} of the RESECT database ({tag}), CC BY 4.0: RESECT.md beside this file says whose
# they are and what was changed. The mesh is the template brain, NOT this patient's anatomy: landmarks were shifted by
# {shift} mm so that they lie in it.

[case]
name = "{name}"
title = "RESECT patient {patient}, before resection: measured landmarks in the template brain, no patient's mesh"
origin = "measured"            # the landmarks; the anatomy is a template
units = "mm"
axes = "RAS"
registration = {accuracy}   # of neuronavigation: it is what these landmarks were recorded to correct

[mesh]
file = "{mesh}"

{tissues}
[body]
density = 1211.5
poisson = 0.45

[[boundary]]
name = "skull base"
nodes = "fixed"
kind = "fixed"

[[boundary]]                   # the dura was closed: the brain cannot leave the skull, and slides along it
name = "surface under the dura"
nodes = "resect/skull-{tissue}.csv"
kind = "sliding"

[[recording]]
name = "landmarks"
kind = "points"
file = "resect/{number:02d}.csv"
outside = "nearest"            # a ventricle of the patient may be tissue of the template, and the other way round
role = "fit"
"""
_TISSUES = {
    "single": '[tissue.1]\nname = "brain"\nmu = 333.28\nprior = "hyperelastic/brain"\n',
    "multi": '[tissue.1]\nname = "grey matter"\nmu = 1370.0\nprior = "hyperelastic/grey matter"\n\n'
    '[tissue.2]\nname = "white matter"\nmu = 1000.0\nprior = "hyperelastic/white matter"\n',
}


@dataclass(frozen=True)
class Landmarks:
    """Of one patient.

    Attributes
    ----------
    patient : int
        Number in the database.
    file : str
    before, after : (n, 3) array
        In MRI and in ultrasound [mm], RAS of the MRI.
    """

    patient: int
    file: str
    before: Floats
    after: Floats


def read_landmarks(folder: Path) -> list[Landmarks]:
    """All patients in the order of their numbers."""
    found = []
    for path in folder.glob("Case*-MRI-beforeUS.tag"):
        text = path.read_text(encoding="utf-8").split("Points =")[1]
        rows = np.array([line.split()[:6] for line in text.replace(";", " ").splitlines() if line.strip()], dtype=float)
        patient = re.match(r"Case(\d+)-", path.name)
        assert patient is not None
        found.append(Landmarks(int(patient[1]), path.name, rows[:, :3], rows[:, 3:]))
    return sorted(found, key=lambda one: one.patient)


class Envelope:
    """The outer surface of a body on a grid, its ventricles filled.

    Parameters
    ----------
    mesh : TetMesh
    """

    def __init__(self, mesh: TetMesh) -> None:
        from scipy.ndimage import binary_fill_holes, distance_transform_edt

        ends = zip(1e3 * mesh.points.min(axis=0), 1e3 * mesh.points.max(axis=0), strict=True)
        self._axes = [np.arange(low - 60.0, high + 60.0, SPACING) for low, high in ends]
        grid = np.stack(np.meshgrid(*self._axes, indexing="ij"), axis=-1)
        inside = locate(mesh.points, mesh.tetrahedra, 1e-3 * grid.reshape(-1, 3)).distance == 0.0
        filled = binary_fill_holes(inside.reshape(grid.shape[:3]))
        #: Depth [mm] of points (n, 3) [mm] below it, negative outside.
        self.depth = self._depth_in(filled)
        wide = SPACING * distance_transform_edt(~filled) <= CLOSING
        #: The same below a skull that is closed over clefts.
        self.below_skull = self._depth_in(SPACING * distance_transform_edt(wide) > CLOSING)

    def _depth_in(self, inside: NDArray[np.bool_]) -> Callable[[Floats], Floats]:
        from scipy.interpolate import RegularGridInterpolator
        from scipy.ndimage import distance_transform_edt

        signed = SPACING * (distance_transform_edt(inside) - distance_transform_edt(~inside))
        interpolate = RegularGridInterpolator(self._axes, signed, bounds_error=False, fill_value=-60.0)
        return lambda points: np.asarray(interpolate(points))


def write_skull(envelope: Envelope, tissue: str) -> None:
    """The node numbers, in the order of the mesh's file, of what lies against the skull and is not held by its base."""
    file = DATA / f"{tissue}-coarse.vtu"
    found = read_mesh_file(file, "mm", None)
    mesh = found.mesh
    outer = nodes_of(mesh.boundary, len(mesh.points)) & ~mesh.node_sets["ventricle"] & ~mesh.node_sets["fixed"]
    against = outer & (envelope.below_skull(1e3 * mesh.points) <= 1.5 * SPACING)
    numbers = "\n".join(map(str, found.node_numbers[against].tolist()))
    (DATA / "resect").mkdir(exist_ok=True)
    head = f"# nodes of {file.name} against the skull, a template's: bench/real/resect_cases.py\nnode\n"
    (DATA / "resect" / f"skull-{tissue}.csv").write_text(f"{head}{numbers}\n", encoding="utf-8")
    print(f"{tissue}: {against.sum()} of {outer.sum()} outer nodes against the skull")


def placed(before: Floats, envelope: Envelope) -> Floats:
    """The least translation (3,) [mm], in tenths, that puts all points (n, 3) as deep as they are to be."""
    from scipy.optimize import minimize

    def objective(t: Floats) -> float:
        return float(np.sum(np.maximum(0.0, DEPTH - envelope.depth(before + t)) ** 2) + 1e-3 * t @ t)

    starts = [np.zeros(3), *(20.0 * np.vstack([np.eye(3), -np.eye(3)]))]
    found = min((minimize(objective, start, method="Nelder-Mead") for start in starts), key=lambda one: one.fun)
    return np.asarray(np.round(found.x, 1))


def write(number: int, landmarks: Landmarks, shift: Floats) -> None:
    """The files of one patient."""
    name = f"resect-{number:02d}"
    lines = [
        f"# RESECT patient {landmarks.patient} ({landmarks.file}), CC BY 4.0; shifted into the template: RESECT.md"
    ]
    lines += ["x,y,z,ux,uy,uz,id"]
    moved = landmarks.after - landmarks.before
    for k, (x, u) in enumerate(zip(landmarks.before + shift, moved, strict=True), 1):
        lines.append(",".join([*(f"{value:.4f}" for value in (*x, *u)), f"{k}"]))
    (DATA / "resect" / f"{number:02d}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for tissue, end in (("multi", ""), ("single", "-single")):
        text = _CASE.format(
            patient=landmarks.patient,
            tag=landmarks.file,
            shift="({})".format(", ".join(f"{value:.1f}" for value in shift)),
            name=name,
            number=number,
            mesh=f"{tissue}-coarse.vtu",
            tissue=tissue,
            tissues=_TISSUES[tissue],
            accuracy=ACCURACY,
        )
        (DATA / f"{name}{end}.toml").write_text(text, encoding="utf-8")


def main() -> None:
    """All patients."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with CaseN-MRI-beforeUS.tag")
    envelope = Envelope(find_case("phantom", "single").mesh)
    for tissue in _TISSUES:
        write_skull(envelope, tissue)
    for number, landmarks in enumerate(read_landmarks(parser.parse_args().data), 1):
        shift = placed(landmarks.before, envelope)
        deep = envelope.depth(landmarks.before + shift)
        write(number, landmarks, shift)
        print(f"resect-{number:02d}: patient {landmarks.patient}, shifted by {shift} mm, {deep.min():.1f} mm or deeper")


if __name__ == "__main__":
    main()
