"""FElupe: neo-Hookean solid body, Newton with SciPy's SuperLU or, with `pardiso`, with Intel's Pardiso."""

import sys
import time

import felupe
import numpy as np
from problem import ASSEMBLIES, BULK, MU, STRETCH, TOLERANCE, cube, imbalance, report, seconds
from scipy.sparse.linalg import spsolve

solver, name = spsolve, "SuperLU (SciPy)"
if "pardiso" in sys.argv:
    from pardiso import NAME as name
    from pardiso import spsolve as solver

nodes, tetrahedra = cube()
start = time.process_time()
field = felupe.FieldContainer([felupe.Field(felupe.RegionTetra(felupe.Mesh(nodes, tetrahedra, "tetra")), dim=3)])
solid = felupe.SolidBody(felupe.NeoHooke(mu=MU, bulk=BULK), field)
boundaries = {
    "bottom": felupe.Boundary(field[0], fz=0),
    "top": felupe.Boundary(field[0], fz=1, skip=(0, 0, 1)),
    "move": felupe.Boundary(field[0], fz=1, skip=(1, 1, 0), value=STRETCH),
}
dof0, dof1 = felupe.dof.partition(field, boundaries)
moved = felupe.dof.apply(field, boundaries, dof0)
setup = time.process_time() - start


def assemble() -> None:
    solid.assemble.vector(field)
    solid.assemble.matrix(field)


def check(dx, x, f, xtol, ftol, dof1, dof0, items):
    reached = imbalance(f, dof1)
    return np.linalg.norm(dx), reached, reached <= ftol


figures = {"assembly": seconds(assemble)} if ASSEMBLIES else {}
start = time.process_time()
state = felupe.newtonraphson(
    items=[solid], dof0=dof0, dof1=dof1, ext0=moved, solver=solver, check=check, tol=TOLERANCE, verbose=0
)
report(
    "FElupe",
    felupe.__version__,
    name,
    state.x[0].values,
    setup=setup,
    solve=time.process_time() - start,
    newton=int(state.iterations),
    **figures,
)
