"""The total potential of a body under mechanisms, written with NumPy from the formulas: of the package only data.

Forces are its slope by complex steps (Squire and Trapp 1998), exact but for rounding.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism

Floats = NDArray[np.float64]

MU, POISSON, DENSITY = 1000.0, 0.4, 1000.0
#: Time step [s]: one has been made to a displacement, and another one ends.
STEP = 0.05


class TotalPotential:
    """The potential of a second time step from rest.

    Parameters
    ----------
    mesh : TetMesh
    acting : sequence of Mechanism
        Of all kinds but a load's own forces and a contact.
    before : (n, 3) array
        Displacement [m] at which the first step ended.
    """

    def __init__(self, mesh: TetMesh, acting: Sequence[Mechanism], before: Floats) -> None:
        self.mesh, self.tets, self.points = mesh, mesh.tetrahedra, mesh.points
        self.acting = list(acting)
        edges = (self.points[self.tets[:, 1:]] - self.points[self.tets[:, :1]]).transpose(0, 2, 1)
        inverse = np.linalg.inv(edges)
        self.gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.V = np.linalg.det(edges) / 6.0
        count = len(self.tets)
        self.w, self.c, self.Jg = np.ones(count), np.ones(count), np.ones(count)
        self.alpha, self.poisson = 2.0, POISSON
        for m in self.acting:
            where = self.members(m)
            if m.kind == "inclusion":
                self.w = self.w * np.where(where, m.ratio, 1.0)
            elif m.kind == "cavity":
                self.c = self.c * np.where(where, m.left, 1.0)
            elif m.kind == "swelling":
                self.Jg = self.Jg * np.where(where, 1.0 + m.amount, 1.0)
            elif m.kind == "asymmetry":
                self.alpha = m.exponent
            elif m.kind == "compressibility":
                self.poisson = m.poisson
        self.before = before
        self.fluids = [Fluid(self, m) for m in self.acting if m.kind == "drainage"]

    def members(self, m: Mechanism) -> NDArray[np.bool_]:
        name = getattr(m, "elements", "")
        return self.mesh.element_sets[name] if name else np.ones(len(self.tets), dtype=bool)

    def F(self, u: NDArray) -> NDArray:
        return np.eye(3) + np.einsum("...eai,eaj->...eij", u[..., self.tets, :], self.gradients)

    def __call__(self, u: NDArray) -> NDArray:
        """Energies [J] at displacements (..., n, 3)."""
        F = self.F(u)
        s = np.cbrt(self.Jg)[:, None, None]
        of_moduli = self.law(F / s)
        tension = np.zeros_like(of_moduli)
        total = np.zeros_like(of_moduli[..., 0])
        for m in self.acting:
            there = self.members(m)
            if m.kind == "fibres":
                of_moduli = of_moduli + there * fibres(m, F / s)
            elif m.kind == "viscoelasticity":
                of_moduli = of_moduli + viscous(m, F / s, self.F(self.before) / s)
            elif m.kind == "residual-stress":
                stretched = F / s @ unit(m.direction)
                tension = tension + there * 0.5 * m.tension * (np.sum(stretched**2, axis=-1) - 1.0)
            elif m.kind == "cavity":
                total = total - m.pressure * np.sum((there * self.V) * det(F), axis=-1)
            elif m.kind == "pressure":
                # on the whole surface
                total = total + m.value * np.sum(self.V * det(F), axis=-1)
            elif m.kind == "falx":
                total = total + membrane(m, self.mesh, u)
            elif m.kind == "gravity":
                nodal = np.zeros(len(self.points))
                np.add.at(nodal, self.tets, np.repeat((0.25 * DENSITY * self.c * self.V)[:, None], 4, axis=1))
                total = total - 9.81 * np.einsum("n,...nj,j->...", nodal, u, unit(m.direction))
        total = total + np.sum(self.V * self.Jg * self.c * (self.w * of_moduli + tension), axis=-1)
        return total + sum(fluid.energy(u) for fluid in self.fluids)

    def forces(self, u: Floats) -> Floats:
        """Slope (n, 3) [N]."""
        steps = 1e-30j * np.eye(u.size).reshape(u.size, *u.shape)
        return np.imag(self(u + steps)).reshape(u.shape) / 1e-30

    def law(self, F: NDArray) -> NDArray:
        """Ogden's law of one term, exponent 2 or an even one below zero, coupled."""
        C = F.swapaxes(-1, -2) @ F
        power = C if self.alpha == 2.0 else np.linalg.matrix_power(np.linalg.inv(C), int(-0.5 * self.alpha))
        log_J = np.log(det(F))
        lam = 2.0 * MU * self.poisson / (1.0 - 2.0 * self.poisson)
        first = 2.0 * MU / self.alpha**2 * (trace(power) - 3.0)
        return first - 2.0 * MU / self.alpha * log_J + 0.5 * lam * log_J**2


class Fluid:
    """Biot's fluid in the second step: `1/2 r . A^-1 r`, `A = S M + N + h H`, `r` the fluid beyond its room."""

    def __init__(self, body: TotalPotential, m: Mechanism) -> None:
        self.body, self.m, self.there = body, m, body.members(m)
        count = len(body.points)
        faces = body.mesh.boundary
        drained = np.zeros(count, dtype=bool)
        drained[faces[body.mesh.node_sets[m.drained][faces].all(axis=1)]] = True
        porous = np.zeros(count, dtype=bool)
        porous[body.tets[self.there]] = True
        self.free = np.flatnonzero(porous & ~drained)
        kept = np.zeros((count, count))
        mass = (1.0 + np.eye(4)) / 20.0
        for e in np.flatnonzero(self.there):
            at = np.ix_(body.tets[e], body.tets[e])
            kept[at] += body.V[e] * (m.storage * mass + (mass - 1.0 / 16.0) / (2.0 * MU * body.w[e]))
        b = self.room(body.before)
        p = np.zeros(count)
        first = kept + STEP * self.flow(np.zeros_like(body.before))
        p[self.free] = np.linalg.solve(first[np.ix_(self.free, self.free)], -b[self.free])
        self.held = (b + kept @ p)[self.free]
        second = kept + STEP * self.flow(body.before)
        self.compliance = np.linalg.inv(second[np.ix_(self.free, self.free)])

    def room(self, u: NDArray) -> NDArray:
        body = self.body
        taken = np.where(self.there, 0.25 * body.V * (det(body.F(u)) - 1.0), 0.0)
        gather = np.zeros((len(self.there), len(body.points)))
        np.add.at(gather, (np.arange(len(gather))[:, None], body.tets), 1.0)
        return taken @ gather

    def flow(self, u: Floats) -> Floats:
        body, found = self.body, np.zeros((len(self.body.points),) * 2)
        F = body.F(u)
        for e in np.flatnonzero(self.there):
            spatial = body.gradients[e] @ np.linalg.inv(F[e])
            found[np.ix_(body.tets[e], body.tets[e])] += (
                self.m.permeability * body.V[e] * np.linalg.det(F[e]) * spatial @ spatial.T
            )
        return found

    def energy(self, u: NDArray) -> NDArray:
        r = self.held - self.room(u)[..., self.free]
        return 0.5 * np.einsum("...i,ij,...j->...", r, self.compliance, r)


def fibres(m: Mechanism, F: NDArray) -> NDArray:
    d = m.dispersion
    stretched = F @ unit(m.direction)
    E = d * (np.sum(F**2, axis=(-1, -2)) - 3.0) + (1.0 - 3.0 * d) * (np.sum(stretched**2, axis=-1) - 1.0)
    E = np.where(E.real > 0.0, E, 0.0)
    return m.stiffness / (2.0 * m.exponent) * (np.exp(m.exponent * E**2) - 1.0)


def viscous(m: Mechanism, F: NDArray, before: Floats) -> NDArray:
    """Of two steps from rest: Holzapfel 2000, section 6.10, with Simo and Hughes' midpoint rule."""

    def isochoric(F: NDArray) -> NDArray:
        C = F.swapaxes(-1, -2) @ F
        factor = MU * det(F) ** (-2.0 / 3.0)
        return factor[..., None, None] * (np.eye(3) - trace(C)[..., None, None] / 3.0 * np.linalg.inv(C))

    strain = F.swapaxes(-1, -2) @ F - np.eye(3)
    psi = 0.5 * MU * (det(F) ** (-2.0 / 3.0) * np.sum(F**2, axis=(-1, -2)) - 3.0)
    total = np.zeros_like(psi)
    for beta, tau in zip(m.moduli, m.times, strict=True):
        response = beta * np.exp(-0.5 * STEP / tau)
        q = response * isochoric(before)
        kept = np.exp(-STEP / tau) * q - response * isochoric(before)
        total = total + response * psi + 0.5 * np.einsum("eij,...eij->...e", kept, strain)
    return total


def membrane(m: Mechanism, mesh: TetMesh, u: NDArray) -> NDArray:
    """Incompressible neo-Hookean membrane, from metric tensors of its triangles."""
    triples = np.concatenate([np.delete(mesh.tetrahedra, corner, axis=1) for corner in range(4)])
    faces = np.unique(np.sort(triples, axis=1), axis=0)
    faces = faces[mesh.node_sets[m.nodes][faces].all(axis=1)]

    def metric(x: NDArray) -> NDArray:
        edges = x[..., faces[:, 1:], :] - x[..., faces[:, :1], :]
        return np.einsum("...eai,...ebi->...eab", edges, edges)

    reference, now = metric(mesh.points), metric(mesh.points + u)
    size = np.linalg.det(reference)
    ratio = (now[..., 0, 0] * now[..., 1, 1] - now[..., 0, 1] ** 2) / size
    density = trace(np.linalg.inv(reference) @ now) + 1.0 / ratio - 3.0
    return np.sum(0.5 * np.sqrt(size) * m.thickness * m.stiffness / 6.0 * density, axis=-1)


def unit(direction: Sequence[float]) -> Floats:
    return np.array(direction) / np.linalg.norm(direction)


def trace(A: NDArray) -> NDArray:
    return np.einsum("...ii->...", A)


def det(A: NDArray) -> NDArray:
    """By cofactors: of complex matrices with tiny imaginary parts too."""
    a, b, c = A[..., 0, :], A[..., 1, :], A[..., 2, :]
    return np.sum(a * np.cross(b, c), axis=-1)
