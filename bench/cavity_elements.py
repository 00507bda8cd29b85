"""How far the wall of a cavity moves under a load on it, on elements of each kind.

    python bench/cavity_elements.py 0614      # writes results/cavity_elements.csv; two minutes a case

The loads of `mesh_errors.py`, with a Poisson ratio in the middle of those that truths of stand-ins have. Quadratic
elements with a continuous pressure (`tet10-mixed`) lock least and are the measure; linear ones of half the size say how
much of their error a finer mesh of linear elements keeps.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from mesh_errors import CAVITY, displacement, on_the_wall

from warpbrain.atomic import whole_file
from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.simulation.mesh_error import FinerCase
from warpbrain.simulation.model import ELEMENTS

RESULTS = Path(__file__).resolve().parent / "results"
COLUMNS = ("case", "load", "elements", "size", "wall_mm")
POISSON = 0.47


def measured(name: str) -> list[dict[str, str]]:
    """Rows of the table by `COLUMNS`."""
    whole = replace(find_case(name), recordings=(), poisson=POISSON)
    resection = tuple(mechanism for mechanism in whole.mechanisms if isinstance(mechanism, Resection))
    wall = np.flatnonzero(whole.mesh.node_sets[CAVITY][whole.remaining[1]])
    rows = []
    for load, mechanisms in on_the_wall(whole, resection).items():
        case = replace(whole, mechanisms=mechanisms)
        sizes = [("1", case, elements) for elements in ELEMENTS] + [("1/2", FinerCase(case).case, "tet4")]
        for size, solved, elements in sizes:
            try:
                moved = f"{1e3 * root_mean_square(displacement(solved, elements)[wall]):.3f}"
            except SolveError:
                moved = "no equilibrium"
            rows.append(dict(zip(COLUMNS, (name, load, elements, size, moved), strict=True)))
            print(" ".join(rows[-1].values()), flush=True)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", metavar="NAME")
    rows = [row for name in parser.parse_args().names for row in measured(name)]
    with whole_file(RESULTS / "cavity_elements.csv") as file, file.open("w", encoding="utf-8") as text:
        table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
