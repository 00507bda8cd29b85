"""scikit-fem: residual and tangent forms by hand, Newton with SciPy's SuperLU or, with `pardiso`, Intel's Pardiso."""

import sys
import time

import numpy as np
import skfem
from problem import ASSEMBLIES, BULK, MU, STRETCH, TOLERANCE, cube, faces, imbalance, report, seconds
from skfem.helpers import ddot, det, grad, inv, transpose

solver, name = skfem.solver_direct_scipy(), "SuperLU (SciPy)"
if "pardiso" in sys.argv:
    from pardiso import NAME as name
    from pardiso import spsolve as solver

nodes, tetrahedra = cube()
start = time.process_time()
bottom, top = faces(nodes)
basis = skfem.Basis(
    skfem.MeshTet(nodes.T.copy(), tetrahedra.T.copy()), skfem.ElementVector(skfem.ElementTetP1()), intorder=0
)
setup = time.process_time() - start


@skfem.LinearForm
def residual(v, w):
    F = grad(w["u"]) + np.eye(3)[:, :, None, None]
    J, H = det(F), transpose(inv(F))
    P = MU * J ** (-2 / 3) * (F - ddot(F, F) / 3 * H) + BULK * (J - 1) * J * H
    return ddot(P, grad(v))


@skfem.BilinearForm
def tangent(du, v, w):
    F = grad(w["u"]) + np.eye(3)[:, :, None, None]
    J, H, dF = det(F), transpose(inv(F)), grad(du)
    I1, trace = ddot(F, F), ddot(H, dF)
    dH = -np.einsum("il...,kl...,kj...->ij...", H, dF, H)
    c = MU * J ** (-2 / 3)
    dP = c * (dF - 2 / 3 * (trace * F + ddot(F, dF) * H) + 2 / 9 * I1 * trace * H - I1 / 3 * dH)
    dP = dP + BULK * ((2 * J - 1) * J * trace * H + (J - 1) * J * dH)
    return ddot(dP, grad(v))


def assemble(u):
    w = basis.interpolate(u)
    return residual.assemble(basis, u=w), tangent.assemble(basis, u=w)


u = basis.zeros()
figures = {"assembly": seconds(lambda: assemble(u), 3)} if ASSEMBLIES else {}
start = time.process_time()
fixed = basis.nodal_dofs[:, np.r_[bottom, top]].ravel()
free = basis.complement_dofs(fixed)
step = basis.zeros()
step[basis.nodal_dofs[2, top]] = STRETCH
f, K = assemble(u)
for newton in range(1, 30):  # noqa: B007  (reported below)
    u = u + skfem.solve(*skfem.condense(K, -f, D=fixed, x=step), solver=solver)
    step[:] = 0.0
    f, K = assemble(u)
    if imbalance(f, free) <= TOLERANCE:
        break
report(
    "scikit-fem",
    skfem.__version__,
    name,
    u[basis.nodal_dofs].T,
    setup=setup,
    solve=time.process_time() - start,
    newton=newton,
    **figures,
)
