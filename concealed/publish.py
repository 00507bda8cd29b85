"""What a stand-in publishes: `case.toml` with its declared level, recordings, and the hash of its truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from concealed.body import Floats
from concealed.observing import SIGMA, WALLS
from warpbrain.cases.building.pipeline import RECIPES

_CASE = """\
# Stand-in for clinical case {name}, not a patient: the patient's images are not public. The anatomy is the MNI template
# under a smooth individual deformation, scaled to the volume of the paper's Table 4; the recordings were made by a
# model that this file does not describe. See docs/stand-ins.md, docs/anatomy.md and ../MNI-NOTICE.txt.

[case]
name = "{name}"
title = "{side} temporal lobe resection, stand-in for clinical case {name}"
origin = "stand-in"
units = "mm"
axes = "RAS"
gravity_axis = [0, -1, 0]      # lying on the back

{tissue}
[body]
density = 1211.5
poisson = 0.45

[[boundary]]
name = "skull base"
nodes = "fixed"
kind = "fixed"

[[mechanism]]
kind = "resection"

[[mechanism]]
kind = "gravity"
csf_level = {level:.1f}              # mm above the lowest point, against gravity

[[recording]]
name = "ventricles"
kind = "points"
file = "recordings/ventricles.csv"
sigma = {sigma:g}                    # mm, one component
role = "fit"

[[recording]]
name = "cavity"
kind = "points"
file = "recordings/cavity.csv"
sigma = {sigma:g}
role = "fit"
"""
_TISSUE = {
    "case.toml": """\
[mesh]
file = "multi.vtu"

[tissue.1]
name = "grey matter"
model = "neo-hookean"
mu = 1370.0                    # the paper's reference for its multi-tissue phantom
prior = "hyperelastic/grey matter"

[tissue.2]
name = "white matter"
model = "neo-hookean"
mu = 1000.0
prior = "hyperelastic/white matter"
""",
    "case-single.toml": """\
[mesh]
file = "single.vtu"

[tissue.1]
name = "brain"
model = "neo-hookean"
mu = 1200.0                    # about the volume-weighted mean of grey (1370 Pa) and white matter (1000 Pa)
prior = "hyperelastic/brain"
""",
}
_WALL = {"ventricles": "wall of the lateral ventricles", "cavity": "margin of the resection"}


def publish(folder: Path, level: float, walls: Sequence[tuple[Floats, Floats]], fingerprint: str) -> None:
    """Write everything that is published of a stand-in, beside its meshes.

    Parameters
    ----------
    folder : Path
        Of the case; its name is the case's.
    level : float
        Declared level of the fluid [m].
    walls : sequence of (points, displacement)
        Of ventricles and cavity, each (k, 3) [m].
    fingerprint : str
        SHA-256 of the sealed truth.
    """
    name = folder.name
    for file, tissue in _TISSUE.items():
        text = _CASE.format(
            name=name,
            side=str(RECIPES[name].resection).capitalize(),
            tissue=tissue,
            level=1e3 * level,
            sigma=1e3 * SIGMA,
        )
        (folder / file).write_text(text, encoding="utf-8")
    (folder / "recordings").mkdir(exist_ok=True)
    for wall, (points, displacement) in zip(WALLS, walls, strict=True):
        text = recording_text(name, wall, points, displacement)
        (folder / "recordings" / f"{wall}.csv").write_text(text, encoding="utf-8")
    (folder / "truth.sha256").write_text(f"{fingerprint}  {name}.json\n", encoding="utf-8")


def recording_text(name: str, wall: str, points: Floats, displacement: Floats) -> str:
    """A recording as CSV: start and displacement [mm, RAS], to a tenth of a micrometre."""
    lines = [
        f"# stand-in for clinical case {name}, not a patient: {_WALL[wall]}, made by a model (docs/stand-ins.md)",
        "x,y,z,ux,uy,uz,id",
    ]
    for i, row in enumerate(np.round(1e3 * np.hstack([points, displacement]), 4)):
        lines.append(",".join(f"{value + 0.0:.4f}" for value in row) + f",{wall[0]}{i + 1:03d}")
    return "\n".join(lines) + "\n"


def read_recording(file: Path) -> tuple[Floats, Floats]:
    """Points and displacement (k, 3) [m] of a recording that was published."""
    rows = np.loadtxt(file, delimiter=",", skiprows=2, usecols=range(6))
    return 1e-3 * rows[:, :3], 1e-3 * rows[:, 3:]
