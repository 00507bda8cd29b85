"""The silicone beam under weights that nobody recorded, for diagnoses that are not told of them.

    python -m bench.real.beam_weights DIR                  # a case folder each in DIR
    warpbrain diagnose --case DIR/tip-35

Computed on another mesh than cases have, with a modulus, a registration and noise drawn as `beam-52g` declares; the
cases declare no weight. With `-both` they do not declare gravity either.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench.real.beam_cases import HELD_WITH_WEIGHT, MU_ACCURACY, box, tip_edge
from bench.real.beam_motion import GRAVITY
from warpbrain.cases.boundary import Fixed, Forced
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.cases.writing import write_case
from warpbrain.mesh import TetMesh
from warpbrain.recordings.location import locate
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: Cells of the mesh that it is computed on.
CELLS = (16, 5, 5)
#: Registration that cases declare [m], [degrees].
SHIFT, TURN = 3e-4, 0.3
#: Nodes of a side that a force elsewhere is shared by, within this of its place [m].
_WITHIN = 0.0085


@dataclass(frozen=True)
class Hung:
    """A force [g] in a direction at a point of the surface (axis normal to it), at the tip's upper edge by default."""

    name: str
    grams: float
    seed: int
    place: tuple[float, float, float] | None = None
    normal: int = 2
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)


HUNG = (
    Hung("tip-20", 20.0, 1),
    Hung("tip-35", 35.0, 2),
    Hung("tip-80", 80.0, 3),
    Hung("tip-110", 110.0, 4),
    Hung("tip-0", 0.0, 5),
    Hung("middle-100", 100.0, 6, (0.05, 0.015, 0.0)),
    Hung("quarter-60", 60.0, 7, (0.074, 0.015, 0.03)),
    Hung("side-60", 60.0, 8, (0.06, 0.0, 0.015), 1, (0.0, 1.0, 0.0)),
)


def loaded_nodes(points: Floats, hung: Hung) -> NDArray[np.bool_]:
    """Nodes (n,) that share the force."""
    if hung.place is None:
        return tip_edge(points)
    near = np.linalg.norm(points - np.array(hung.place), axis=1) < _WITHIN
    return near & (np.abs(points[:, hung.normal] - hung.place[hung.normal]) < 1e-9)


def recorded(case: Case, hung: Hung) -> Floats:
    """Displacement (k, 3) [m] of the markers of a case, with noise."""
    random = np.random.default_rng(hung.seed)
    stiffness = float(np.exp(MU_ACCURACY * random.normal()))
    points, tetrahedra = box(CELLS)
    mesh = TetMesh(points, tetrahedra, node_sets={"clamp": points[:, 0] < 1e-9, "loaded": loaded_nodes(points, hung)})
    total = 1e-3 * hung.grams * GRAVITY * np.array(hung.direction)
    force = [Forced(name="weight", nodes="loaded", total=tuple(total.tolist()))] if hung.grams else []
    boundaries = (*(one for one in case.boundaries if isinstance(one, Fixed)), *force)
    tissues = {k: replace(one, law=replace(one.law, mu=stiffness * one.law.mu)) for k, one in case.tissues.items()}
    model = model_of(replace(case, mesh=mesh, tissues=tissues, boundaries=boundaries))
    model = replace(model, elements="tet10-mixed")
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u[: len(points)]
    markers = case.recordings[0].points
    turned = Rotation.from_rotvec(np.deg2rad(TURN) * random.normal(size=3))
    middle = points.mean(axis=0)
    moved = turned.apply(markers + locate(points, tetrahedra, markers).interpolate(u) - middle) + middle
    moved += SHIFT * random.normal(size=3)
    return np.asarray(moved - markers + 1e-3 * HELD_WITH_WEIGHT * random.normal(size=markers.shape))


def main() -> None:
    """Write the cases."""
    parser = argparse.ArgumentParser(description="cases of the silicone beam with simulated weights")
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    case = find_case("beam-52g")
    bare = replace(case, boundaries=tuple(one for one in case.boundaries if isinstance(one, Fixed)))
    for hung in HUNG:
        recording = replace(case.recordings[0], displacement=recorded(case, hung))
        told = replace(bare, name=hung.name, title="Silicone beam", recordings=(recording,))
        write_case(options.out / hung.name, told)
        write_case(options.out / f"{hung.name}-both", replace(told, name=f"{hung.name}-both", mechanisms=()))


if __name__ == "__main__":
    main()
