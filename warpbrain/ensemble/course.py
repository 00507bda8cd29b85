"""What the samples of a batch do next: the decisions between two passes, over all slots at once."""

from __future__ import annotations

import abc
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.ensemble.batch import Batch, States
from warpbrain.simulation.model import Model

Floats = NDArray[np.float64]
Slots = NDArray[np.intp]


@dataclass(frozen=True)
class Verdict:
    """What is to become of the slots whose state is new."""

    go: Slots  # they begin a step
    back: Slots  # they go back to where their last step began
    done: Slots  # their samples have their answer
    failed: dict[int, str]  # their samples have none, and why


class Course(abc.ABC):
    """A course of time steps, the same for all samples, in which each has a time of its own.

    Attributes
    ----------
    tolerance : float
        Relative tolerance of the linear solves.
    linger : float
        Part of the solves of a pass that may go on in the next one. On an H200 none is best where all take steps of one
        length, and a quarter in a run to rest, where some need a hundred times the iterations of others.
    time : array
        Of the state of each slot [s].
    steps, cg_iterations : int array
        Steps taken, and iterations of all linear solves.
    residual : array
        Out-of-balance force relative to all nodal forces.
    """

    tolerance: float
    linger: float = 0.0

    def __init__(self, model: Model) -> None:
        self.model = model
        self._external = float(np.linalg.norm(model.external_forces()))

    @abc.abstractmethod
    def shapes(self) -> Floats:
        """Of what prescribed displacements are sums, shape (shapes, n, 3)."""

    def attach(self, batch: Batch) -> None:
        """Follow the slots of a batch."""
        self.batch = batch
        self.time, self.residual = np.zeros(batch.slots), np.zeros(batch.slots)
        self.steps, self.cg_iterations = np.zeros(batch.slots, dtype=int), np.zeros(batch.slots, dtype=int)
        # the state is one to start from, not one that a step has led to
        self._entering = np.zeros(batch.slots, dtype=bool)

    def begin(self, slots: Slots) -> None:
        """New samples have been placed."""
        self.time[slots] = 0.0
        self.steps[slots] = 0
        self.cg_iterations[slots] = 0
        self._entering[slots] = True

    def judge(self, states: States) -> Verdict:
        """Decide, and set what the batch needs to know of the steps that begin."""
        entering = states.ready & self._entering
        reached = states.ready & ~self._entering
        self._entering[entering] = False
        self.cg_iterations[reached] += states.cg_iterations[reached]
        scale = np.maximum(states.internal + self._external, np.finfo(float).tiny)
        self.residual[states.ready] = (states.unbalanced / scale)[states.ready]
        with np.errstate(invalid="ignore"):
            converged = states.cg_residual <= states.cg_goal
            good = reached & (states.min_J > 0.0) & np.isfinite(states.min_J) & converged
        verdict = self._decide(np.flatnonzero(good), np.flatnonzero(reached & ~good), states)
        go = np.concatenate([np.flatnonzero(entering), verdict.go])
        self._entering[verdict.back] = True
        self._prepare(go)
        return Verdict(np.sort(go), verdict.back, verdict.done, verdict.failed)

    @abc.abstractmethod
    def _decide(self, good: Slots, bad: Slots, states: States) -> Verdict:
        """The verdict over the slots that a step has led to a good state and to a bad one."""

    def _prepare(self, slots: Slots) -> None:
        """Set step lengths, load factors and prescribed displacements of the steps that begin."""
        due = self.time + self.batch.time_step
        for row, load in enumerate(self.model.loads):
            factors = {time: load.factor(time) for time in set(due[slots].tolist())}
            self.batch.load_factors[row, slots] = [factors[time] for time in due[slots].tolist()]

    def why(self, slot: int, states: States) -> str:
        """What is wrong with the state of a slot: the words of `warpbrain.simulation.dynamics.Simulator.check`."""
        end = self.time[slot] + self.batch.time_step[slot]
        when = f"{1000.0 * end:.4g} ms"
        min_J, residual, goal = states.min_J[slot], states.cg_residual[slot], states.cg_goal[slot]
        if min_J <= 0.0:
            J = self.batch.element_J(slot)
            e = int(np.argmin(J))
            mesh = self.model.mesh
            x, y, z = 1000.0 * mesh.points[mesh.tetrahedra[e]].mean(axis=0)
            return (
                f"element {e} at ({x:.1f}, {y:.1f}, {z:.1f}) mm, tissue {mesh.tissue[e]}, turned inside out by {when} "
                f"(J = {min_J:.3g}): what acts is too much for this tissue or this time step"
            )
        if not (np.isfinite(residual) and np.isfinite(min_J)):
            return f"the motion is not finite after {when}: conjugate gradients broke down"
        return (
            f"conjugate gradients did not converge in the step to {when}: residual {residual:.1e} after "
            f"{states.cg_iterations[slot]} iterations, goal {goal:.1e}"
        )
