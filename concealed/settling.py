"""Equilibrium of the truth: gravity and every effect together, followers included.

On quadratic tetrahedra: linear ones lock, and smaller ones show a part of that alone (`bench/cavity_elements.py`). A
diagnosis allows for what its own mesh loses, and what a truth has lost may seem missing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from concealed.body import Body, Floats
from concealed.effect import Effect
from concealed.tissue import Tissue
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

#: Density [kg/m3] of Table 4, and where 'down' was while the brain was imaged.
DENSITY = 1211.5
IMAGED_DOWN = (0.0, -1.0, 0.0)
#: Forces that follow are found again until no node moves by more than this [m], so many times at most.
STILL = 1e-6
#: Enough while strengths are being looked for [m].
NEARLY_STILL = 3e-5
ROUNDS = 30
#: Elements of truths; `concealed.face_loads` is written for these.
ELEMENTS = "tet10"
#: A pressure on the fine mesh takes 23 steps from rest.
OPTIONS = EquilibriumOptions(tolerance=1e-7, max_newton=30, max_total_newton=120)


class Settler:
    """Settles one body with one tissue; keeps what does not change from one strength to the next.

    Parameters
    ----------
    body : Body
    tissue : Tissue
    """

    def __init__(self, body: Body, tissue: Tissue) -> None:
        self.body = body
        self._tissue = tissue
        self._structure: tuple[bytes, ...] | None = None
        self._system: System | None = None
        self._last: Floats | None = None

    def settle(self, effects: Sequence[Effect], level: float, still: float = STILL) -> Floats:
        """Displacement of the nodes of `body.quadratic` [m], those of `body.mesh` first: shape (N, 3).

        Parameters
        ----------
        effects : sequence of Effect
        level : float
            True level of the fluid above the lowest node [m].
        still : float
            Forces that follow are found again until no node moves by more than this [m].

        Raises
        ------
        SolveError
            If there is no stable equilibrium.
        """
        body = self.body
        system = self._prepared(effects)
        gravity = Gravity(direction=IMAGED_DOWN, density=DENSITY, csf_level=level)
        for effect in effects:
            gravity = effect.gravity(body, gravity)
        nodes = body.quadratic.points
        weight = gravity.nodal_forces(body.quadratic)
        solver = EquilibriumSolver(system, OPTIONS)
        u = np.zeros_like(nodes) if self._last is None else self._last
        # where the walls are taken to be; Aitken's relaxation brings it to where they go
        guess, share, before = u, 1.0, np.zeros_like(u)
        for round_ in range(ROUNDS):
            points = nodes + guess
            forces = weight + sum((effect.forces(body, points) for effect in effects), np.zeros_like(points))
            reached = solver.solve(forces, start=u)
            # growth that has not been fitted together yet is unstable on the way; a truth at its end is not
            if reached.history and reached.history[-1].indefinite:
                raise SolveError("the equilibrium found is not stable")
            u = reached.u
            off = u - guess
            if not any(effect.follows for effect in effects) or np.abs(off).max() < still:
                self._last = u
                return u
            if round_ > 0:
                change = off - before
                share = float(np.clip(-share * np.vdot(before, change) / np.vdot(change, change), 0.2, 4.0))
            guess, before = guess + share * off, off
        raise SolveError("a force that follows the wall finds no balance")

    def _prepared(self, effects: Sequence[Effect]) -> System:
        body = self.body
        none = np.zeros(len(body.mesh.tetrahedra))
        stiffer = sum((effect.log_stiffness(body) for effect in effects), none)
        growth = sum((effect.growth(body) for effect in effects), none)
        held = np.repeat(body.mesh.node_sets["fixed"][:, None], 3, axis=1)
        for effect in effects:
            held = effect.held(body, held)
        structure = stiffer.tobytes(), growth.tobytes(), held.tobytes()
        if self._system is None or structure != self._structure:
            labels, materials = self._tissue.materials(body, stiffer, growth)
            mesh = TetMesh(body.mesh.points, body.mesh.tetrahedra, labels)
            self._system = System(Model(mesh, materials, DENSITY, held, elements=ELEMENTS))
            self._structure, self._last = structure, None
        return self._system
