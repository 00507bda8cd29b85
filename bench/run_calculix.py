"""CalculiX: C3D4, *HYPERELASTIC, NEO HOOKE, one *STATIC increment; processor time of the whole process."""

import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from problem import BULK, MU, STRETCH, cube, faces, report

nodes, tetrahedra = cube()
bottom, top = faces(nodes)


def rows(ids: np.ndarray) -> str:
    text = [str(i + 1) for i in ids]
    return ",\n".join(", ".join(text[k : k + 8]) for k in range(0, len(text), 8))


deck = [
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
    f"{MU / 2:.15g}, {2 / BULK:.15g}",
    "*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE",
    "*STEP, NLGEOM",
    "*STATIC, DIRECT",
    "1.0, 1.0",
    "*BOUNDARY",
    "BOTTOM, 1, 3, 0.0",
    "TOP, 1, 2, 0.0",
    f"TOP, 3, 3, {STRETCH}",
    "*NODE PRINT, NSET=ALL",
    "U",
    "*END STEP",
]
version = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout.split()[-1]
with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "cube.inp").write_text("\n".join(deck) + "\n")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(["ccx", "-i", "cube"], cwd=folder, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "Job finished" not in run.stdout:
        sys.exit(f"CalculiX did not finish: {run.stdout[-500:]}")
    u = np.zeros_like(nodes)
    for line in (Path(folder) / "cube.dat").read_text().splitlines():
        fields = line.split()
        if len(fields) == 4 and fields[0].isdigit():
            u[int(fields[0]) - 1] = [float(v) for v in fields[1:]]
report(
    "CalculiX",
    version,
    "SPOOLES",
    u,
    solve=after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    newton=len(re.findall(r"iteration\s+\d+", run.stdout)),
    process_rss_mb=after.ru_maxrss / 1024.0,
)
