"""A test of a few seconds whose answer is known: whether a device computes what it should.

A block whose whole surface is moved as one homogeneous deformation must deform so inside, whatever its mesh (the patch
test: Irons and Razzaque 1972). Assembly, Newton's method and the linear solver all have to be right for that.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.mesh import boundary_faces, nodes_of
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

#: Largest error of a displacement that passes, of the largest displacement: Newton stops at 1e-8 of the forces.
TOLERANCE = 1e-6
#: Stretched by 10 %, squeezed, and sheared.
_GRADIENT = np.array([[1.10, 0.05, 0.0], [0.0, 0.97, 0.0], [0.0, 0.02, 1.0]])


@dataclass(frozen=True)
class SelfTest:
    """What came of it on one device, by its alias."""

    device: str
    #: That had to find their place.
    nodes: int
    #: Largest error of a displacement, of the largest displacement; NaN if there was no equilibrium.
    error: float
    #: Seconds that loading (the first time compiling) the kernels and all the rest took.
    kernels_s: float
    solve_s: float
    #: Empty if it passed.
    problem: str = ""


def self_test(device: str) -> SelfTest:
    """Run the test on a device, by its alias."""
    begun = time.perf_counter()
    mesh = find_case("beam-gravity").mesh
    surface = nodes_of(boundary_faces(mesh.tetrahedra), len(mesh.points))
    exact = mesh.points @ (_GRADIENT - np.eye(3)).T
    model = Model(
        mesh,
        {label: Material(NeoHookean(1000.0)) for label in mesh.labels},
        constrained=np.repeat(surface[:, None], 3, axis=1),
        prescribed=np.where(surface[:, None], exact, 0.0),
    )
    system = System(model, device)
    kernels = system.load_kernels()
    error, problem = np.nan, ""
    try:
        u = solve_equilibrium(system).u
        error = float(np.abs(u - exact).max() / np.abs(exact).max())
    except SolveError as failed:
        problem = str(failed)
    else:
        if not error <= TOLERANCE:
            problem = f"displacements are wrong by {error:.1e} of the largest; expected {TOLERANCE:.0e} at most"
    seconds = time.perf_counter() - begun - kernels
    return SelfTest(device, int(np.count_nonzero(~surface)), error, kernels, seconds, problem)
