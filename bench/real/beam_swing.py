"""How the silicone beam swings about its rest: as recorded, and by `warpbrain run --to-rest --time-step SECONDS`.

    python -m bench.real.beam_swing FOLDER     # the .c3d files; needs ezc3d

Elements are `tet4-averaged`, the only ones that do not lock and can be viscoelastic, with the modulus with which they
come to the rest of `tet10-mixed`. Two branches of stress that relaxes (`viscoelasticity`, moduli `b_i` relative to that
at rest, times `t_i`) are fitted to the first release under the beam's own weight, by the poles of the first mode,

    s^2 + w0^2 (1 + sum_i b_i s t_i / (1 + s t_i) + beta s (1 + sum_i b_i)) = 0

`w0` of the elastic motion, `beta` = 1 ms Rayleigh's damping. Branches act in plain tetrahedra, which are stiffer: their
moduli are divided by what the frequency of a first motion says. All else is predicted. With branches, which are of
second order, poles of steps are not quite those of the body: they are extrapolated from two steps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import least_squares

import warpbrain as wb
from bench.real.beam_cases import GRAVITY_FILES, MU, WEIGHT_FILE
from bench.real.beam_motion import read_release
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import BEAM, find_case
from warpbrain.simulation.model import Damping

Floats = NDArray[np.float64]

#: Of `--time-step` [s]: a thirtieth of the shorter period.
STEP = 4e-3
LINEAR = "tet4-averaged"
#: Logarithms of the moduli and times [s] of two branches from which they are fitted.
START = np.log([0.1, 0.1, 1.0, 0.03])


def sinks(case: Case, elements: str | None = None) -> float:
    """How far the tip sinks until rest [m], in the mean of its upper edge."""
    done = wb.run(case, elements=elements, device="cpu")
    return float(-done.u[done.mesh.node_sets["upper edge of the tip"], 2].mean())


def swing(case: Case, step: float = STEP) -> Floats:
    """Frequency [Hz] and damping relative to critical of a motion to rest."""
    solution = wb.run(case, to_rest=True, time_step=step, elements=LINEAR, device="cpu").followed.solution
    return np.array([solution["swing"]["frequency_Hz"], solution["swing"]["damping"]])


def extrapolated(case: Case) -> Floats:
    """The same, extrapolated to no step: the error of half a step is half as large."""
    return 2.0 * swing(case, 0.5 * STEP) - swing(case)


def release_of(frequency: float, moduli: Floats, times: Floats) -> Floats:
    """Frequency [Hz], damping relative to critical, creep as a part of the whole way, and its time [s], of a release.

    `frequency`: of the first mode, elastic. `moduli` (k,), `times` (k,) [s]: of the branches.
    """
    squared = (2.0 * np.pi * frequency) ** 2
    relaxing = Polynomial([1.0])
    for time in times:
        relaxing *= Polynomial([1.0, time])
    damped = squared * Damping().stiffness * (1.0 + moduli.sum())
    poles_of = relaxing * Polynomial([squared, damped, 1.0])
    for modulus, time in zip(moduli, times, strict=True):
        poles_of += squared * modulus * Polynomial([0.0, time]) * (relaxing // Polynomial([1.0, time]))
    poles = poles_of.roots()
    fastest = poles[np.argmax(poles.imag)]
    slow = poles[np.argmin(np.abs(poles))].real
    # the part of the step response that the slowest pole has
    creep = -squared * relaxing(slow) / (slow * poles_of.deriv()(slow))
    return np.array([abs(fastest) / (2.0 * np.pi), -fastest.real / abs(fastest), creep, -1.0 / slow])


def fitted_branches(frequency: float, recorded: Floats) -> tuple[Floats, Floats]:
    """Moduli (2,) and times (2,) [s] with which a release is as recorded (4,); see `release_of`."""

    def misfit(logarithms: Floats) -> Floats:
        return release_of(frequency, *np.exp(logarithms).reshape(2, 2)) / recorded - 1.0

    moduli, times = np.exp(least_squares(misfit, START).x).reshape(2, 2)
    return moduli, times


def in_words(moduli: Floats, times: Floats) -> str:
    """Branches as `--with` has them."""
    return "viscoelasticity:" + ",".join(
        f"{key}={'/'.join(f'{value:.3g}' for value in values)}"
        for key, values in (("moduli", moduli), ("times", times))
    )


def row(name: str, values: Floats) -> str:
    """In words."""
    creeps = f", creeps by {100.0 * values[2]:.1f} % in {values[3]:.2f} s" if len(values) > 2 else ""
    return f"  {name:<24} {values[0]:.3f} Hz, {100.0 * values[1]:.2f} % of critical damping{creeps}"


def main() -> None:
    """Print both of each recording."""
    parser = argparse.ArgumentParser(description="the swing of the silicone beam")
    parser.add_argument("data", type=Path, help="folder with the .c3d files")
    folder = parser.parse_args().data
    mu, viscous = 0.0, ""
    for name, files in zip(BEAM, (GRAVITY_FILES, (WEIGHT_FILE,)), strict=True):
        case = find_case(name)
        print(name, flush=True)
        swings = [read_release(folder / file).swing() for file in files]
        recorded = [np.array([one.frequency, one.damping, one.creep, one.creep_time]) for one in swings]
        for file, values in zip(files, recorded, strict=True):
            print(row(file, values), flush=True)
        # the way is nearly as one over the modulus
        mu = mu or MU * sinks(case, LINEAR) / sinks(case)
        case = case.with_shear_moduli({1: mu})
        elastic = swing(case)
        print(row("elastic", elastic), flush=True)
        if not viscous:
            moduli, times = fitted_branches(elastic[0], recorded[0])
            first = extrapolated(assume(case, in_words(moduli, times)))
            stiffer = (first[0] ** 2 - elastic[0] ** 2) / (recorded[0][0] ** 2 - elastic[0] ** 2)
            print(row(f"branches {stiffer:.3f} times as stiff", first), flush=True)
            viscous = in_words(moduli / stiffer, times)
        print(row("viscoelastic", extrapolated(assume(case, viscous))), flush=True)
    print(f"--elements {LINEAR} --mu {mu:.0f} --with {viscous}")


if __name__ == "__main__":
    main()
