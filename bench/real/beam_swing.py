"""How the tip of the silicone beam swings about its rest: as recorded, and by the tangent stiffness of the tool.

    python -m bench.real.beam_swing FOLDER     # the .c3d files; needs ezc3d

Of the first mode about the state at rest, `K phi = w^2 M phi`, the motion of `warpbrain run --steps` has the frequency
`w / 2 pi` and, to first order, the damping `(beta + h) w / 2`: Rayleigh's, `beta` = 1 ms, and that of backward Euler
with steps `h` of 1 ms. `--to-rest` is the same motion with steps that double, which do not resolve a swing.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh

from bench.real.beam_cases import GRAVITY_FILES, WEIGHT_FILE
from bench.real.beam_motion import GRAVITY, read_release
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import BEAM, find_case
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.model import Damping
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Time step of a motion [s].
STEP = 1e-3


def swing_of(case: Case) -> tuple[float, float]:
    """Frequency [Hz] and damping, relative to critical, of the first mode about a case at rest.

    A force on nodes is a weight that hangs there: its mass swings along.
    """
    # the elements of `warpbrain run` where tissue hardly changes its volume
    model = replace(model_of(case), elements="tet10-mixed")
    system = System(model, "cpu")
    system.u.assign(EquilibriumSolver(system).solve(model.external_forces()).u)
    masses = np.asarray(model.node_masses).copy()
    for boundary in case.boundaries:
        if isinstance(boundary, Forced):
            members = np.flatnonzero(case.mesh.node_sets[boundary.nodes])
            masses[members] += np.linalg.norm(boundary.total) / GRAVITY / len(members)
    free = ~model.constrained.ravel()
    K = system.stiffness().tocsr()[free][:, free].tocsc()
    M = diags(np.repeat(masses, 3)[free]).tocsc()
    [squared] = eigsh(K, 1, M, sigma=0.0, return_eigenvectors=False)
    w = float(np.sqrt(squared))
    return w / (2.0 * np.pi), 0.5 * (Damping().stiffness + STEP) * w


def main() -> None:
    """Print both of each recording."""
    parser = argparse.ArgumentParser(description="the swing of the silicone beam")
    parser.add_argument("data", type=Path, help="folder with the .c3d files")
    folder = parser.parse_args().data
    for name, files in zip(BEAM, (GRAVITY_FILES, (WEIGHT_FILE,)), strict=True):
        frequency, damping = swing_of(find_case(name))
        print(f"{name:<14} computed  {frequency:.2f} Hz, {100.0 * damping:.1f} % of critical damping")
        for file in files:
            recorded = read_release(folder / file).swing()
            print(f"{'':<14} recorded  {recorded.frequency:.2f} Hz, {100.0 * recorded.damping:.1f} %  {file}")


if __name__ == "__main__":
    main()
