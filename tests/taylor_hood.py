"""Irregular meshes of a block that bends, and P2-P1 elements of scikit-fem on them: what elements are measured by."""

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import bmat
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay
from shapes import oriented
from skfem.helpers import ddot, div, sym_grad

from warpbrain.mesh import TetMesh

Floats = NDArray[np.float64]

#: Of the block: length, width and height [m], shear modulus [Pa] and weight [N/m3], with which it bends by 1e-3.
LENGTHS, SHEAR_MODULUS, WEIGHT = (2.0, 1.0, 1.0), 1.0, np.array([0.0, 0.0, -1e-4])


def block(cells: int, irregular: float = 0.25, seed: int = 0) -> TetMesh:
    """Delaunay tetrahedra of 2 cells x cells x cells points that were moved, on the sides of the block along these."""
    counts = np.array([2 * cells, cells, cells])
    axes = [np.linspace(0.0, length, n + 1) for length, n in zip(LENGTHS, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    inside = (points > 1e-9) & (points < np.array(LENGTHS) - 1e-9)
    points += irregular / cells * np.where(inside, np.random.default_rng(seed).uniform(-1.0, 1.0, points.shape), 0.0)
    tetrahedra = Delaunay(points).simplices
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    # of four points in one side there is a tetrahedron without volume
    return oriented(points, tetrahedra[np.abs(np.linalg.det(edges)) > 1e-6 / cells**3])


def clamped(points: Floats) -> NDArray[np.bool_]:
    """Components of nodes that are held (n, 3): those of one end."""
    return np.repeat((points[:, 0] < 1e-9)[:, None], 3, axis=1)


def taylor_hood_work(mesh: TetMesh, poisson: float) -> float:
    """Work [J] of the block's weight along the displacement of P2-P1 elements, linear elasticity.

    Of the bulk modulus `K = 2 mu (1 + nu) / (3 (1 - 2 nu))`; integrals exact, the pressure's matrix consistent.
    """
    bulk = 2.0 * SHEAR_MODULUS * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    grid = skfem.MeshTet(mesh.points.T.copy(), mesh.tetrahedra.T.astype(np.int64))
    u = skfem.Basis(grid, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)
    p = u.with_element(skfem.ElementTetP1())
    deviatoric = skfem.BilinearForm(
        lambda u, v, _: 2.0 * SHEAR_MODULUS * (ddot(sym_grad(u), sym_grad(v)) - div(u) * div(v) / 3.0)
    ).assemble(u)
    divergence = skfem.BilinearForm(lambda u, q, _: div(u) * q).assemble(u, p)
    mass = skfem.BilinearForm(lambda p, q, _: p * q).assemble(p)
    load = skfem.LinearForm(lambda v, _: sum(WEIGHT[i] * v[i] for i in range(3))).assemble(u)
    held = u.get_dofs(lambda x: x[0] < 1e-9).all()
    free = np.setdiff1d(np.arange(u.N + p.N), held)
    both = bmat([[deviatoric, divergence.T], [divergence, -mass / bulk]]).tocsc()[free][:, free]
    weight = np.concatenate([load, np.zeros(p.N)])
    return float(weight[free] @ splu(both).solve(weight[free]))
