"""Bodies whose displacement is chosen, held by the body force and the tractions that it needs, on irregular meshes.

Stresses are written here again in closed form, from the formulas and not from our kernels, for complex numbers: the
divergence of a stress is the imaginary part of the stress a tiny imaginary step away (Squire and Trapp, SIAM Review 40,
1998), without any error but rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from bodies import model_of
from manufactured import exact as wave
from manufactured import exact_gradient as wave_gradient
from manufactured import gradients, norm, quadrature
from numpy.typing import NDArray
from shapes import cube

from warpbrain.mesh import QuadraticMesh, TetMesh, surface_forces
from warpbrain.mesh.integrals import shape_values, volume_forces
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.mesh.surface import EDGES
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model, with_mechanisms
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
#: First Piola-Kirchhoff stress (..., 3, 3) [Pa] of deformation gradients (..., 3, 3) at points (..., 3), which may be
#: complex.
Stress = Callable[[NDArray, NDArray], NDArray]
#: Unit vectors (..., 3) at points.
Direction = Callable[[NDArray], NDArray]
#: Orders of the displacement's error in L2 and of its gradient's.
ORDERS = {"tet4": (2.0, 1.0), "tet4-averaged": (2.0, 1.0), "tet10": (3.0, 2.0)}
#: A homogeneous part, longest along z, and a wave on top of it. Volume changes by less than a quarter: under dead
#: forces of several times the shear modulus a nearly incompressible body is not stable (Rivlin's cube).
HOMOGENEOUS = np.array([[-0.06, 0.05, 0.0], [0.0, -0.06, 0.02], [0.03, 0.0, 0.20]])
WAVE = 0.15
_STEP = 1e-30


def irregular(level: int, cells: int = 3) -> TetMesh:
    """The unit cube with jittered nodes, every tetrahedron cut into eight `level` times; `top` is its face at z = 1."""
    mesh = cube(cells)
    x = mesh.points
    moved = 0.2 / cells * np.random.default_rng(5).uniform(-1.0, 1.0, x.shape)
    # nodes of a face stay in it
    x = np.where((x < 1e-9) | (x > 1.0 - 1e-9), x, x + moved)
    mesh = replace(mesh, points=x, node_sets={"top": x[:, 2] > 1.0 - 1e-9})
    for _ in range(level):
        mesh, _ = finer_mesh(mesh)
    return mesh


def displacement(X: NDArray) -> NDArray:
    """The chosen displacement at points (..., 3)."""
    return X @ HOMOGENEOUS.T + WAVE * wave(X)


def displacement_gradient(X: NDArray) -> NDArray:
    return HOMOGENEOUS + WAVE * wave_gradient(X)


def divergence(stress: Callable[[NDArray], NDArray], X: Floats) -> Floats:
    """`dP_ij/dX_j` at points (k, 3) of a stress (k, 3, 3) of points."""
    steps = 1j * _STEP * np.eye(3)
    return sum(stress(X + steps[j])[..., j].imag / _STEP for j in range(3))


@dataclass(frozen=True)
class Problem:
    """What acts beside body force and dead traction, and what stress that makes.

    Attributes
    ----------
    material : Material
        As a case would say it, before any mechanism.
    stress : Stress
        Of the material and all mechanisms that act in the volume.
    mechanisms : callable
        Of a mesh: what acts.
    press : callable
        Part of the traction (k, 3) on `top` that a mechanism brings, at points and deformation gradients.
    vectors : callable or None
        Directions of fibres at points, for the field `tracts` of elements.
    """

    material: Material
    stress: Stress
    mechanisms: Sequence[Mechanism] = ()
    press: Callable[[Floats, Floats], Floats] = field(default=lambda X, F: np.zeros(X.shape))
    vectors: Callable[[Floats], Floats] | None = None

    def at(self, X: NDArray) -> NDArray:
        return self.stress(np.eye(3) + displacement_gradient(X), X)

    def body_force(self, X: Floats) -> Floats:
        return -divergence(self.at, X)

    def traction(self, X: Floats) -> Floats:
        """On `top`, and nothing on the other faces, which are held."""
        on = X[:, 2] > 1.0 - 1e-9
        F = np.eye(3) + displacement_gradient(X)
        return on[:, None] * (self.at(X)[..., 2] - self.press(X, F))


@dataclass(frozen=True, kw_only=True)
class Held(Load):
    """Body force and dead traction of a problem, by the integrals that loads use."""

    problem: Problem
    quadratic: ClassVar[bool] = True

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        return volume_forces(mesh, self.problem.body_force) + surface_forces(mesh, self.problem.traction)


def boundary_held(points: Floats) -> NDArray[np.bool_]:
    """Nodes of all faces of the cube but the one at z = 1, with its rim."""
    low, high = points < 1e-9, points > 1.0 - 1e-9
    return low.any(axis=1) | high[:, :2].any(axis=1)


def model(problem: Problem, level: int, elements: str) -> Model:
    mesh = irregular(level)
    if problem.vectors is not None:
        mesh = replace(mesh, element_vectors={"tracts": problem.vectors(mesh.centres)})
    points = QuadraticMesh(mesh).points if elements == "tet10" else mesh.points
    constrained = np.repeat(boundary_held(points)[:, None], 3, axis=1)
    prescribed = np.where(constrained, displacement(points), 0.0)
    plain = model_of(
        mesh,
        problem.material,
        constrained=constrained,
        prescribed=prescribed,
        loads=(Held(problem=problem),),
        elements=elements,
    )
    return with_mechanisms(plain, problem.mechanisms)


def errors(problem: Problem, level: int, elements: str, device: str) -> Floats:
    """L2 norms (2,) of the error of the displacement and of its gradient."""
    made = model(problem, level, elements)
    # the search begins at the chosen displacement, which is near: what is asked is where the equilibrium is
    start = displacement((made.quadratic or made.mesh).points)
    u = EquilibriumSolver(System(made, device), EquilibriumOptions(tolerance=1e-9)).solve(start=start).u
    return errors_of(made, u, displacement, displacement_gradient)


def errors_of(
    made: Model, u: Floats, expected: Callable[[Floats], Floats], expected_gradient: Callable[[Floats], Floats]
) -> Floats:
    """L2 norms (2,) of how far a displacement and its gradient are from functions of points."""
    bary, weights = quadrature(4)
    mesh = made.mesh
    nodes = made.quadratic
    elements = mesh.tetrahedra if nodes is None else nodes.elements
    X = np.einsum("qa,eai->eqi", bary, mesh.points[elements[:, :4]])
    shapes = bary if nodes is None else shape_values(bary)
    slopes = shape_gradients(mesh.points, elements, bary)
    value = np.einsum("qa,eai->eqi", shapes, u[elements]) - expected(X)
    slope = np.einsum("eai,eqaj->eqij", u[elements], slopes) - expected_gradient(X)
    return np.array([norm(mesh, weights, value), norm(mesh, weights, slope)])


def shape_gradients(points: Floats, elements: NDArray[np.integer], bary: Floats) -> Floats:
    """Of the four or ten shape functions at barycentric points (q, 4), shape (m, q, 4 or 10, 3)."""
    g = gradients(points, elements[:, :4])
    if elements.shape[1] == 4:
        return np.repeat(g[:, None], len(bary), axis=1)
    corners = np.einsum("qa,eai->eqai", 4.0 * bary - 1.0, g)
    c, d = EDGES.T
    middles = 4.0 * (np.einsum("qk,eki->eqki", bary[:, c], g[:, d]) + np.einsum("qk,eki->eqki", bary[:, d], g[:, c]))
    return np.concatenate([corners, middles], axis=2)


def orders(coarse: Floats, fine: Floats) -> Floats:
    """Observed orders of errors on a mesh and on one of half the size."""
    return np.log2(coarse / fine)


# -- stresses, written again ----------------------------------------------------------------------------------------


def cofactors(F: NDArray) -> tuple[NDArray, NDArray]:
    """Determinants (...) and inverse transposes (..., 3, 3) by cofactors: LAPACK takes four times as long for 3 x 3."""
    a, b, c = (F[..., i, :] for i in range(3))
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    J = np.sum(a * cofactor[..., 0, :], axis=-1)
    return J, cofactor / J[..., None, None]


def scalars(values: NDArray) -> NDArray:
    """Values (...) as factors of tensors (..., 3, 3)."""
    return np.asarray(values)[..., None, None]


def coupled_neo_hookean(mu: float, poisson: float) -> Stress:
    lam = 2.0 * mu * poisson / (1.0 - 2.0 * poisson)

    def stress(F: NDArray, X: NDArray) -> NDArray:
        J, T = cofactors(F)
        return mu * (F - T) + lam * scalars(np.log(J)) * T

    return stress


def uncoupled_neo_hookean(mu: float, poisson: float) -> Stress:
    """`mu/2 (J^-2/3 I1 - 3) + K/2 (J - 1)^2`."""
    K = 2.0 * mu * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))

    def stress(F: NDArray, X: NDArray) -> NDArray:
        J, T = cofactors(F)
        third = np.einsum("...ij,...ij->...", F, F) / 3.0
        return mu * scalars(J ** (-2.0 / 3.0)) * (F - scalars(third) * T) + K * scalars((J - 1.0) * J) * T

    return stress


def uncoupled_mooney_rivlin(C1: float, C2: float, poisson: float) -> Stress:
    """`C1 (J^-2/3 I1 - 3) + C2 (J^-4/3 I2 - 3) + K/2 (J - 1)^2`."""
    K = 4.0 * (C1 + C2) * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))

    def stress(F: NDArray, X: NDArray) -> NDArray:
        J, T = cofactors(F)
        C = np.swapaxes(F, -1, -2) @ F
        I1 = np.trace(C, axis1=-2, axis2=-1)
        I2 = 0.5 * (I1**2 - np.einsum("...ij,...ji->...", C, C))
        first = F - scalars(I1 / 3.0) * T
        second = scalars(I1) * F - F @ C - scalars(2.0 / 3.0 * I2) * T
        isochoric = C1 * scalars(J ** (-2.0 / 3.0)) * first + C2 * scalars(J ** (-4.0 / 3.0)) * second
        return 2.0 * isochoric + K * scalars((J - 1.0) * J) * T

    return stress


def coupled_ogden(mu: float, poisson: float, alpha: int) -> Stress:
    """One term of a shear modulus `mu` and an even negative exponent: `F C^(alpha/2 - 1)` is a power of an inverse."""
    lam, c = 2.0 * mu * poisson / (1.0 - 2.0 * poisson), 2.0 * mu / alpha

    def stress(F: NDArray, X: NDArray) -> NDArray:
        J, T = cofactors(F)
        # C^-1
        power = np.linalg.matrix_power(np.swapaxes(T, -1, -2) @ T, 1 - alpha // 2)
        return c * (F @ power - T) + lam * scalars(np.log(J)) * T

    return stress


def fibre_stress(stiffness: float, exponent: float, dispersion: float, direction: Direction) -> Stress:
    """`k1 E exp(k2 E^2) dE/dF` of fibres that are stretched everywhere."""

    def stress(F: NDArray, X: NDArray) -> NDArray:
        a = direction(X)
        Fa = np.einsum("...ij,...j->...i", F, a)
        along = 1.0 - 3.0 * dispersion
        I1, I4 = np.einsum("...ij,...ij->...", F, F), np.einsum("...i,...i->...", Fa, Fa)
        E = dispersion * (I1 - 3.0) + along * (I4 - 1.0)
        assert np.all(E.real > 0.0)
        slope = 2.0 * (dispersion * F + along * Fa[..., :, None] * a[..., None, :])
        return scalars(stiffness * E * np.exp(exponent * E**2)) * slope

    return stress


def tension_stress(tension: float, direction: Direction) -> Stress:
    """`sigma F a (x) a`."""

    def stress(F: NDArray, X: NDArray) -> NDArray:
        a = direction(X)
        return tension * np.einsum("...ij,...j->...i", F, a)[..., :, None] * a[..., None, :]

    return stress


def both(first: Stress, second: Stress) -> Stress:
    return lambda F, X: first(F, X) + second(F, X)


def ball(centre: Sequence[float], radius: float) -> Callable[[NDArray], NDArray]:
    """`1/2 (1 + cos(pi r / 2 R))`, smooth within twice the radius."""

    def weight(X: NDArray) -> NDArray:
        away = X - np.array(centre)
        return 0.5 * (1.0 + np.cos(0.5 * np.pi * np.sqrt(np.sum(away * away, axis=-1)) / radius))

    return weight
