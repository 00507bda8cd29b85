"""Mechanisms by another finite element code, FElupe, on the same mesh: its assembly and Newton's method, not ours.

FElupe's own live pressure; its solid body under stresses that are written here with NumPy, from the formulas and not
from our kernels, with differences of them for Newton's matrix. Of viscoelasticity the same time steps are taken, so
that agreement is to solver tolerance too; how far the steps are from the hereditary integral is another test's.
"""

from collections.abc import Callable
from dataclasses import replace

import felupe
import numpy as np
from bodies import model_of
from shapes import cube, distorted, octant
from verification_rows import Row

from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

MU, POISSON = 1000.0, 0.4
LAM = 2.0 * MU * POISSON / (1.0 - 2.0 * POISSON)
MATERIAL = Material(NeoHookean(MU), POISSON)
EXACT = EquilibriumOptions(tolerance=1e-11)
Stress = Callable[[np.ndarray], np.ndarray]


class Numerical:
    """A material of FElupe's from stresses (m, 3, 3) at deformation gradients (m, 3, 3)."""

    def __init__(self, stress: Stress) -> None:
        self.x = [np.eye(3), np.zeros(0)]
        self.stress = stress

    def gradient(self, x: list) -> list:
        P = self.stress(x[0][:, :, 0].transpose(2, 0, 1))
        return [P.transpose(1, 2, 0)[:, :, None], x[-1]]

    def hessian(self, x: list) -> list:
        F = x[0][:, :, 0].transpose(2, 0, 1)
        A = np.zeros((3, 3, 3, 3, 1, len(F)))
        h = 1e-6
        for k in range(3):
            for l in range(3):
                step = np.zeros((3, 3))
                step[k, l] = h
                A[:, :, k, l, 0] = ((self.stress(F + step) - self.stress(F - step)) / (2.0 * h)).transpose(1, 2, 0)
        return [A]


def neo_hookean(F: np.ndarray) -> np.ndarray:
    T = np.linalg.inv(F).transpose(0, 2, 1)
    return MU * (F - T) + LAM * np.log(np.linalg.det(F))[:, None, None] * T


def field_of(mesh: TetMesh) -> object:
    region = felupe.RegionTetra(felupe.Mesh(np.array(mesh.points), np.array(mesh.tetrahedra), "tetra"))
    return felupe.FieldContainer([felupe.Field(region, dim=3)])


def solve(field: object, items: list, model: Model, share: float = 1.0) -> np.ndarray:
    held = model.constrained.ravel()
    felupe.newtonraphson(
        items=items,
        x0=field,
        dof0=np.flatnonzero(held),
        dof1=np.flatnonzero(~held),
        ext0=share * model.prescribed.ravel()[held],
        tol=1e-11,
        maxiter=30,
        verbose=0,
    )
    return np.array(field[0].values)


def clamped(*acting: Mechanism, stretch: float = 0.0) -> Model:
    """A distorted cube with a fixed bottom; its top is lifted and pushed sideways, if at all."""
    mesh = distorted(cube(3), 0.04)
    low, high = cube(3).points[:, 2] == 0.0, cube(3).points[:, 2] == 1.0
    held = low | high if stretch else low
    constrained = np.repeat(held[:, None], 3, axis=1)
    prescribed = np.where(high[:, None] & held[:, None], [0.5 * stretch, 0.0, stretch], 0.0)
    return model_of(mesh, MATERIAL, constrained=constrained, prescribed=prescribed, mechanisms=acting)


def agree(verify: Row, what: str, found: np.ndarray, expected: np.ndarray) -> None:
    largest = np.linalg.norm(expected, axis=1).max()
    assert largest > 0.01
    by = "FElupe, the same mesh, formulas written again"
    verify(f"displacement of {what}", by, np.abs(found - expected).max() / largest, 1e-9)


def test_growth(verify: Row) -> None:
    """A ball in the body swells by up to 40 %: `P = s^2 P_e(F/s)`, another `s` in every element."""
    ball = Swelling(amount=0.4, centre=(0.5, 0.5, 0.6), radius=0.35)
    model = clamped(ball)
    s = np.cbrt(1.0 + ball.growth(model.mesh, 1.0))[:, None, None]
    field = field_of(model.mesh)
    expected = solve(field, [felupe.SolidBody(Numerical(lambda F: s**2 * neo_hookean(F / s)), field)], model)
    found = solve_equilibrium(System(model, "cpu"), EXACT).u
    agree(verify, "a body in which a ball swells (`swelling`)", found, expected)


def test_fibres(verify: Row) -> None:
    """Scattered fibres, some of them slack: `P += k1 E exp(k2 E^2) dE/dF`."""
    fibres = Fibres(direction=(0.3, 0.2, 1.0), stiffness=800.0, exponent=2.0, dispersion=0.1)
    model = clamped(fibres, stretch=0.2)
    a = np.array(fibres.direction) / np.linalg.norm(fibres.direction)

    def stress(F: np.ndarray) -> np.ndarray:
        Fa = F @ a
        E = np.maximum(0.0, 0.1 * (np.sum(F**2, axis=(1, 2)) - 3.0) + 0.7 * (np.sum(Fa**2, axis=1) - 1.0))
        slope = 2.0 * (0.1 * F + 0.7 * Fa[:, :, None] * a)
        return neo_hookean(F) + (800.0 * E * np.exp(2.0 * E**2))[:, None, None] * slope

    field = field_of(model.mesh)
    solid = felupe.SolidBody(Numerical(stress), field)
    for share in (0.5, 1.0):
        expected = solve(field, [solid], model, share)
    found = solve_equilibrium(System(model, "cpu"), EXACT).u
    agree(verify, "a stretched body with scattered `fibres`", found, expected)


def test_viscoelasticity(verify: Row) -> None:
    """Stretched within 0.4 s in four steps and held for 2 s in four more; forces on the top too."""
    moduli, times = np.array([2.0, 0.7]), np.array([0.3, 3.0])
    model = clamped(Viscoelasticity(moduli=tuple(moduli), times=tuple(times)), stretch=0.15)
    count = len(model.mesh.tetrahedra)
    q, S_before = np.zeros((2, count, 3, 3)), np.zeros((count, 3, 3))

    def isochoric(F: np.ndarray) -> np.ndarray:
        C = F.transpose(0, 2, 1) @ F
        third = np.trace(C, axis1=1, axis2=2)[:, None, None] / 3.0
        return MU * (np.linalg.det(F) ** (-2.0 / 3.0))[:, None, None] * (np.eye(3) - third * np.linalg.inv(C))

    def branches(F: np.ndarray, h: float) -> np.ndarray:
        decay, response = np.exp(-h / times), moduli * np.exp(-0.5 * h / times)
        return np.einsum("b,beij->beij", decay, q) + np.einsum("b,eij->beij", response, isochoric(F) - S_before)

    field = field_of(model.mesh)
    solver = EquilibriumSolver(System(model, "cpu"), EXACT)
    for term in solver.system.terms:
        term.forget()
    u = np.zeros(model.mesh.points.shape)
    high = model.prescribed[:, 2] > 0.0
    for h, share in [(0.1, 0.25), (0.1, 0.5), (0.1, 0.75), (0.1, 1.0), *[(0.5, 1.0)] * 4]:
        law = Numerical(lambda F, h=h: neo_hookean(F) + F @ branches(F, h).sum(axis=0))
        solid = felupe.SolidBody(law, field)
        expected = solve(field, [solid], model, share)
        forces = solid.assemble.vector(field).toarray().reshape(-1, 3)
        F = field.extract()[0][:, :, 0].transpose(2, 0, 1)
        q, S_before = branches(F, h), isochoric(F)
        found = solver.step(u, h, prescribed=share * model.prescribed)
        u = found.u
        agree(verify, "a stretched body with `viscoelasticity`, in eight steps", u, expected)
        top = forces[high].sum(axis=0)
        error = np.abs(found.internal[high].sum(axis=0) - top).max() / np.linalg.norm(top)
        claim = "force on a stretched body with `viscoelasticity`"
        verify(claim, "FElupe, the same mesh, formulas written again", error, 1e-8)


def test_live_pressure(verify: Row) -> None:
    """An octant of a thick sphere, inflated from radius 1 to 1.06: FElupe's `SolidBodyPressure` on the inner faces."""
    mesh = octant(3, 3, lambda s: 1.0 + s)
    points = mesh.points
    inner = np.linalg.norm(points, axis=1) < 1.0 + 1e-9
    mesh = replace(mesh, node_sets={"inner": inner})
    model = model_of(mesh, MATERIAL, constrained=points == 0.0, mechanisms=[Pressure(nodes="inner", value=200.0)])
    # FElupe has no boundary of tetrahedra: the element behind each face, with one point of integration on the face
    faces = boundary_faces(mesh.tetrahedra)
    faces = faces[inner[faces].all(axis=1)]
    cells = []
    for face in faces:
        [cell] = [t for t in mesh.tetrahedra if np.isin(face, t).all()]
        cells.append([*face[::-1], *np.setdiff1d(cell, face)])
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    centre = felupe.quadrature.Scheme(np.array([[1.0, 1.0, 0.0]]) / 3.0, np.ones(1))
    region = felupe.Region(felupe.Mesh(points, np.array(cells), "tetra"), felupe.Tetra(), centre)
    region.dV, region.normals = 0.5 * area[None], (normal / area[:, None]).T[:, None]
    field = field_of(mesh)
    loaded = felupe.FieldContainer([felupe.Field(region, dim=3)])
    solid = felupe.SolidBody(felupe.NeoHookeCompressible(mu=MU, lmbda=LAM), field)
    expected = solve(field, [solid, felupe.SolidBodyPressure(loaded, pressure=200.0)], model)
    agree(verify, "a thick sphere under live `pressure`", solve_equilibrium(System(model, "cpu"), EXACT).u, expected)
