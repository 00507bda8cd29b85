"""CalculiX: C3D4, *HYPERELASTIC, NEO HOOKE, one *STATIC increment; processor time of processes from deck to result.

Set-up is that of a second process with `*NO ANALYSIS`, which reads and checks the same deck; the rest is the solve,
files that are written included.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from problem import BULK, MU, STRETCH, cube, faces, internal_forces, report
from process import whole_process

#: Unit of stress: CalculiX takes an out-of-balance force below 1e-6 for zero, which must be far below what is asked.
UNIT = 1e9
#: Its criterion: largest out-of-balance force over the average force. With this one the norm that all stop by is at
#: most `TOLERANCE`, which `report` sees to.
RESIDUAL = 4e-8

nodes, tetrahedra = cube()
bottom, top = faces(nodes)


def rows(ids: np.ndarray) -> str:
    text = [str(i + 1) for i in ids]
    return ",\n".join(", ".join(text[k : k + 8]) for k in range(0, len(text), 8))


def deck(*procedure: str) -> str:
    lines = [
        "*NODE, NSET=ALL",
        *(f"{i + 1}, {x:.15g}, {y:.15g}, {z:.15g}" for i, (x, y, z) in enumerate(nodes)),
        "*ELEMENT, TYPE=C3D4, ELSET=BODY",
        *(f"{e + 1}, {a + 1}, {b + 1}, {c + 1}, {d + 1}" for e, (a, b, c, d) in enumerate(tetrahedra)),
        "*NSET, NSET=BOTTOM",
        rows(bottom),
        "*NSET, NSET=TOP",
        rows(top),
        "*MATERIAL, NAME=TISSUE",
        "*HYPERELASTIC, NEO HOOKE",
        f"{UNIT * MU / 2:.15g}, {2 / (UNIT * BULK):.15g}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE",
        "*STEP, NLGEOM",
        *procedure,
        "*CONTROLS, PARAMETERS=FIELD",
        f"{RESIDUAL:g}",
        "*BOUNDARY",
        "BOTTOM, 1, 3, 0.0",
        "TOP, 1, 2, 0.0",
        f"TOP, 3, 3, {STRETCH}",
        "*NODE PRINT, NSET=ALL",
        "U",
        "*END STEP",
    ]
    return "\n".join(lines) + "\n"


version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "cube.inp").write_text(deck("*STATIC, DIRECT", "1.0, 1.0"))
    (Path(folder) / "read.inp").write_text(deck("*NO ANALYSIS"))
    _, _, reading = whole_process(["ccx", "-i", "read"], cwd=folder)
    said, _, process = whole_process(["ccx", "-i", "cube"], cwd=folder)
    if "Job finished" not in said:
        sys.exit(f"CalculiX did not finish: {said[-500:]}")
    u = np.zeros_like(nodes)
    for line in (Path(folder) / "cube.dat").read_text().splitlines():
        fields = line.split()
        if len(fields) == 4 and fields[0].isdigit():
            u[int(fields[0]) - 1] = [float(v) for v in fields[1:]]
# its displacements have seven digits, its own largest out-of-balance force bounds the norm
largest = float(re.findall(r"largest residual force=\s*(\S+)", said)[-1]) / UNIT
bound = np.sqrt(3.0 * (len(nodes) - len(bottom) - len(top))) * largest
report(
    "CalculiX",
    version,
    "SPOOLES",
    u,
    setup=reading["seconds"],
    solve=process["seconds"] - reading["seconds"],
    process=process["seconds"],
    peak_rss_mb=process["peak_rss_mb"],
    newton=len(re.findall(r"iteration\s+\d+", said)),
    imbalance=bound / float(np.linalg.norm(internal_forces(nodes, tetrahedra, u))),
)
