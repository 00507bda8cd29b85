"""How the tip of the silicone beam swings about its rest and creeps: as recorded, and by the tool's stiffness and laws.

    python -m bench.real.beam_swing FOLDER     # the .c3d files; needs ezc3d

The first mode about the state at rest, `K phi = w0^2 M phi`, moves as `warpbrain run --steps` moves it. Of branches of
stress that relax (`viscoelasticity`, moduli `b_i` relative to that at rest, times `t_i`) its poles are the roots of

    s^2 + w0^2 (1 + (beta + h) s + sum_i b_i s t_i / (1 + s t_i)) = 0

`beta` = 1 ms is Rayleigh's damping, `h` = 1 ms to first order that of steps of backward Euler; the step changes the
frequency by 0.1 %. Two branches are fitted to the first release under the beam's own weight, all else is
predicted. `--to-rest` is the same motion with steps that double, which do not resolve a swing.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import least_squares
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

Floats = NDArray[np.float64]

#: Time step of a motion [s].
STEP = 1e-3
#: Logarithms of the moduli and times [s] of two branches from which they are fitted.
START = np.log([0.1, 0.1, 1.0, 0.03])


def first_mode(case: Case) -> float:
    """Frequency [Hz] of the first mode about a case at rest, elastic and undamped.

    A force on nodes is a weight that hangs there: its mass goes up and down with them.
    """
    # the elements of `warpbrain run` where tissue hardly changes its volume
    model = replace(model_of(case), elements="tet10-mixed")
    system = System(model, "cpu")
    system.u.assign(EquilibriumSolver(system).solve(model.external_forces()).u)
    masses = np.repeat(model.node_masses[:, None], 3, axis=1)
    for boundary in case.boundaries:
        if isinstance(boundary, Forced):
            members = np.flatnonzero(case.mesh.node_sets[boundary.nodes])
            masses[members, 2] += np.linalg.norm(boundary.total) / GRAVITY / len(members)
    free = ~model.constrained.ravel()
    K = system.stiffness().tocsr()[free][:, free].tocsc()
    M = diags(masses.ravel()[free]).tocsc()
    [squared] = eigsh(K, 1, M, sigma=0.0, return_eigenvectors=False)
    return float(np.sqrt(squared)) / (2.0 * np.pi)


def release_of(frequency: float, moduli: Floats, times: Floats) -> Floats:
    """Frequency [Hz], damping relative to critical, creep as a part of the whole way, and its time [s], of a release.

    `frequency`: of the first mode, elastic. `moduli` (k,), `times` (k,) [s]: of the branches.
    """
    squared = (2.0 * np.pi * frequency) ** 2
    relaxing = Polynomial([1.0])
    for time in times:
        relaxing *= Polynomial([1.0, time])
    poles_of = relaxing * Polynomial([squared, squared * (Damping().stiffness + STEP), 1.0])
    for modulus, time in zip(moduli, times, strict=True):
        poles_of += squared * modulus * Polynomial([0.0, time]) * (relaxing // Polynomial([1.0, time]))
    poles = poles_of.roots()
    swing = poles[np.argmax(poles.imag)]
    slow = poles[np.argmin(np.abs(poles))].real if len(times) else -np.inf
    # the part of the step response that the slowest pole has
    creep = -squared * relaxing(slow) / (slow * poles_of.deriv()(slow)) if len(times) else 0.0
    return np.array([abs(swing) / (2.0 * np.pi), -swing.real / abs(swing), creep, -1.0 / slow])


def fitted_branches(frequency: float, recorded: Floats) -> tuple[Floats, Floats]:
    """Moduli (2,) and times (2,) [s] with which a release is as recorded (4,); see `release_of`."""

    def misfit(logarithms: Floats) -> Floats:
        return release_of(frequency, *np.exp(logarithms).reshape(2, 2)) / recorded - 1.0

    moduli, times = np.exp(least_squares(misfit, START).x).reshape(2, 2)
    return moduli, times


def row(values: Floats) -> str:
    """In words."""
    frequency, damping, creep, time = values
    creeps = f"creeps by {100.0 * creep:.1f} % in {time:.2f} s" if creep else "does not creep"
    return f"{frequency:.2f} Hz, {100.0 * damping:.1f} % of critical damping, {creeps}"


def main() -> None:
    """Print both of each recording."""
    parser = argparse.ArgumentParser(description="the swing of the silicone beam")
    parser.add_argument("data", type=Path, help="folder with the .c3d files")
    folder = parser.parse_args().data
    branches: tuple[Floats, Floats] | None = None
    for name, files in zip(BEAM, (GRAVITY_FILES, (WEIGHT_FILE,)), strict=True):
        frequency = first_mode(find_case(name))
        swings = [read_release(folder / file).swing() for file in files]
        recorded = [np.array([swing.frequency, swing.damping, swing.creep, swing.creep_time]) for swing in swings]
        branches = branches or fitted_branches(frequency, recorded[0])
        print(f"{name}\n  elastic       {row(release_of(frequency, np.empty(0), np.empty(0)))}")
        print(f"  viscoelastic  {row(release_of(frequency, *branches))}")
        for file, values in zip(files, recorded, strict=True):
            print(f"  recorded      {row(values)}  {file}")
    moduli, times = ("/".join(f"{value:.3g}" for value in values) for values in branches)
    print(f"--with viscoelasticity:moduli={moduli},times={times}")


if __name__ == "__main__":
    main()
