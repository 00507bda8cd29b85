"""FElupe: neo-Hookean solid body, Newton with SciPy's SuperLU."""

import time

import felupe
from problem import BULK, MU, STRETCH, cube, report, seconds
from scipy.sparse.linalg import spsolve

start = time.process_time()
nodes, tetrahedra = cube()
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


first = seconds(assemble, 1)
assembly = seconds(assemble)
start = time.process_time()
state = felupe.newtonraphson(items=[solid], dof0=dof0, dof1=dof1, ext0=moved, solver=spsolve, tol=1e-10, verbose=0)
report(
    "FElupe",
    felupe.__version__,
    "SuperLU (SciPy)",
    state.x[0].values,
    setup=setup,
    first_assembly=first,
    assembly=assembly,
    solve=time.process_time() - start,
    newton=int(state.iterations),
)
