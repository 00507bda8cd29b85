"""The silicone beam as shipped cases: its weight alone, and with a weight hung at its tip.

    python -m bench.real.beam_cases FOLDER                                 # writes into warpbrain/cases/data/beam
    python -m bench.real.beam_cases FOLDER --weight FILE.c3d GRAMS --out DIR    # a case of any other weight

FOLDER holds `beam.stl` and the `.c3d` files; needs ezc3d. Every number of a case is from these files, from the authors'
description of the rig, or from the releases under its own weight (`bench.real.beam_motion`), but for how even the
silicone is: nothing is from how a beam with a weight came to rest.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from bench.real.beam_motion import GRAVITY, SIZE, TIP, Release, read_release
from warpbrain.mesh import TetMesh, write_mesh

Floats = NDArray[np.float64]

DATA = Path(__file__).resolve().parents[2] / "warpbrain" / "cases" / "data" / "beam"
#: Cells along, across and up, each cut into six tetrahedra: 5 mm.
CELLS = (20, 6, 6)
#: Shear modulus [Pa]: `warpbrain estimate --case beam-gravity`, the weight of the beam alone.
MU = 82100.0
#: Standard deviation of a component [mm] of the tip, which was held by hand: two releases 0.4 mm apart across and
#: 0.1 mm down, and how much lower than undeformed is known to 0.3 mm. With a weight in the hand it was held 1.8 mm to
#: the side of that and turned by 4 degrees. Markers at the clamp are taken to be as accurate: with the weight one of
#: them, on the silicone beside the clamp, moves by 0.9 mm.
HELD, HELD_WITH_WEIGHT = 0.35, 0.6
GRAVITY_FILES = ("beam_gravity_V2_a.c3d", "beam_gravity_V2_b.c3d")
#: Its standard deviation there, relative: of a beam with a weight it is known. The weight of the beam is what tells it.
MU_ACCURACY = 0.043
#: Standard deviation of ln mu from place to place: a guess for silicone of one pour; 0.02 and 0.1 give like verdicts.
UNEVEN = 0.05
WEIGHT_FILE, WEIGHT_GRAMS = "beam_load52_V2_a.c3d", 52.0

_CASE = """\
# A silicone beam ({source}), MIT licence: BEAM.md beside this file says whose it is and what was changed.

[case]
name = "{name}"
title = "{title}"
origin = "measured"
units = "mm"
axes = "RAS"                   # x from the clamp to the tip, z up
gravity_axis = [0, 0, -1]
registration = {{ mm = 0.3, degrees = 0.3 }}   # three of the markers are on the clamp

[mesh]
file = "beam.vtu"

[tissue.1]
name = "Dragon Skin 10"
mu = {mu:.0f}.0                   # fitted to its weight alone: warpbrain estimate --case beam-gravity
{accuracy}formulation = "uncoupled"

[body]
density = 1070.0
poisson = 0.499
heterogeneity = {uneven}           # cast in one piece: nobody measured it; 0.25, brain's, is no silicone's

[[boundary]]
name = "clamp"
nodes = "clamp"
kind = "fixed"
{weight}
[[mechanism]]
kind = "gravity"
surroundings = "air"
"""
_WEIGHT = """
[[boundary]]
name = "weight"
nodes = "upper edge of the tip"
kind = "force"
total = [0, 0, {force:.5f}]    # {grams:g} g
mass = {mass:g}                   # kg, which swing with the tip
"""
_RECORDING = """
[[recording]]
name = "{name}"
kind = "points"
file = "{file}"
role = "{role}"
"""


def beam_mesh(surface: Path) -> TetMesh:
    """The box that the surface is, with the sets `clamp` and `upper edge of the tip`.

    Raises
    ------
    ValueError
        If the surface is not that box.
    """
    stl = meshio.read(surface)
    corners = 1e-3 * stl.points[stl.cells_dict["triangle"]].astype(np.float64)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    # its z is the length
    size = np.ptp(corners.reshape(-1, 3), axis=0)[[2, 1, 0]]
    if not (np.allclose(size, SIZE, atol=1e-6) and np.isclose(volume, SIZE.prod(), rtol=1e-4)):
        raise ValueError(f"{surface}: expected a box of {1e3 * SIZE} mm")
    points, tetrahedra = box(CELLS)
    sets = {"clamp": points[:, 0] < 1e-9, "upper edge of the tip": tip_edge(points)}
    return TetMesh(points, tetrahedra, node_sets=sets)


def tip_edge(points: Floats) -> NDArray[np.bool_]:
    """Which nodes (n,) of the box are on the upper edge of its tip, where weights hang."""
    return np.asarray((points[:, 0] > SIZE[0] - 1e-9) & (points[:, 2] > SIZE[2] - 1e-9))


def box(cells_along: tuple[int, int, int]) -> tuple[Floats, NDArray[np.int64]]:
    """Points and tetrahedra of the box: cells are cut along diagonals that neighbours mirror, so no side is weaker."""
    axes = [np.linspace(0.0, length, n + 1) for n, length in zip(cells_along, SIZE, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.stack(np.meshgrid(*[np.arange(n) for n in cells_along], indexing="ij"), axis=-1).reshape(-1, 3)
    stride = np.array([(cells_along[1] + 1) * (cells_along[2] + 1), cells_along[2] + 1, 1])
    mirrored = cells % 2
    found = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        steps = np.vstack([np.zeros(3, dtype=int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        # in a mirrored direction the cell is walked through from its other end
        corners = cells[:, None] + np.where(mirrored[:, None] == 1, 1 - steps, steps)
        found.append(corners @ stride)
    tetrahedra = np.concatenate(found)
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    inverted = np.linalg.det(edges) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return points, tetrahedra


def table(release: Release, sag: float, source: str, held: float = HELD) -> str:
    """Ways from the undeformed beam to rest: markers of the tip at the feet of their posts, and of the clamp."""
    ways = release.rested()
    ways[TIP, 2] -= sag
    deviations = np.full(6, held)
    lines = [
        f"# {source}, MIT licence: BEAM.md. Held {1e3 * sag:.2f} mm lower than undeformed, which is added",
        "x,y,z,ux,uy,uz,sigma,id",
    ]
    numbers = np.column_stack([1e3 * release.feet, 1e3 * ways, deviations])
    names = ["tip 1", "tip 2", "tip 3", "clamp 1", "clamp 2", "clamp 3"]
    lines += [",".join([*(f"{value:.3f}" for value in row), name]) for row, name in zip(numbers, names, strict=True)]
    return "\n".join(lines) + "\n"


def sag_of(releases: list[Release]) -> float:
    """How much lower than undeformed the tip was held [m]: a slow release only takes from the swing."""
    return min(release.swing().sag for release in releases)


def write_beam(folder: Path, name: str, title: str, grams: float, recordings: dict[str, tuple[str, str]]) -> None:
    """`name.toml` and its tables: of each file the role and the table's text, by file."""
    weight = _WEIGHT.format(force=-1e-3 * grams * GRAVITY, grams=grams, mass=1e-3 * grams) if grams else ""
    source, accuracy = ", ".join(recordings), f"accuracy = {MU_ACCURACY}\n" if grams else ""
    text = _CASE.format(name=name, title=title, source=source, mu=MU, accuracy=accuracy, uneven=UNEVEN, weight=weight)
    for number, (file, (role, content)) in enumerate(recordings.items()):
        csv = f"{Path(file).stem}.csv"
        (folder / csv).write_text(content, encoding="utf-8")
        text += _RECORDING.format(name=("markers", "markers, again")[number], file=csv, role=role)
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")


def main() -> None:
    """Write the shipped cases, or one of another weight."""
    parser = argparse.ArgumentParser(description="cases of the silicone beam")
    parser.add_argument("data", type=Path, help="folder with beam.stl and the .c3d files")
    parser.add_argument("--weight", nargs=2, metavar=("FILE", "GRAMS"), help="a recording with another weight")
    parser.add_argument("--out", type=Path, default=DATA)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    write_mesh(options.out / "beam.vtu", beam_mesh(options.data / "beam.stl"), unit="mm")
    alone = {file: read_release(options.data / file) for file in GRAVITY_FILES}
    sag = sag_of(list(alone.values()))
    print(f"the tip was held {1e3 * sag:.2f} mm lower than undeformed")
    if options.weight:
        file, grams = Path(options.weight[0]), float(options.weight[1])
        name = f"beam-{grams:g}g"
        content = {file.name: ("fit", table(read_release(file), sag, file.name, HELD_WITH_WEIGHT))}
        write_beam(options.out, name, f"Silicone beam under its weight and {grams:g} g at its tip", grams, content)
        return
    tables = {
        file: (role, table(release, sag, file))
        for (file, release), role in zip(alone.items(), ("fit", "check"), strict=True)
    }
    write_beam(options.out, "beam-gravity", "Silicone beam under its own weight", 0.0, tables)
    loaded = table(read_release(options.data / WEIGHT_FILE), sag, WEIGHT_FILE, HELD_WITH_WEIGHT)
    title = f"Silicone beam under its weight and {WEIGHT_GRAMS:g} g at its tip"
    write_beam(options.out, f"beam-{WEIGHT_GRAMS:g}g", title, WEIGHT_GRAMS, {WEIGHT_FILE: ("fit", loaded)})


if __name__ == "__main__":
    main()
