"""The course of a motion: a number of equal time steps, as `warpbrain run --steps` takes them."""

from __future__ import annotations

import numpy as np

from warpbrain.ensemble.batch import Batch, States
from warpbrain.ensemble.course import Course, Floats, Slots, Verdict
from warpbrain.simulation.model import Model


class Moving(Course):
    """Equal steps of backward Euler.

    Parameters
    ----------
    model : Model
    steps : int
    time_step : float
        [s]
    tolerance : float
        Relative, of the linear solves.
    """

    def __init__(self, model: Model, steps: int, time_step: float = 0.001, tolerance: float = 1e-6) -> None:
        super().__init__(model)
        self._count, self._h, self.tolerance = steps, time_step, tolerance

    def shapes(self) -> Floats:
        """The displacements without a history; and for each history, the three directions at its nodes."""
        shapes = [self.model.prescribed.copy()]
        for motion in self.model.motions:
            # a later history takes a node from an earlier one
            for shape in shapes:
                shape[motion.nodes] = 0.0
            for axis in range(3):
                direction = np.zeros_like(self.model.prescribed)
                direction[motion.nodes, axis] = 1.0
                shapes.append(direction)
        return np.array(shapes) if any(np.any(shape) for shape in shapes) else np.zeros((0, *shapes[0].shape))

    def attach(self, batch: Batch) -> None:
        super().attach(batch)
        batch.time_step[:] = self._h

    def _decide(self, good: Slots, bad: Slots, states: States) -> Verdict:
        failed = {int(slot): self.why(int(slot), states) for slot in bad}
        self.time[good] += self._h
        self.steps[good] += 1
        arrived = self.steps[good] >= self._count
        return Verdict(good[~arrived], bad[:0], good[arrived], failed)

    def _prepare(self, slots: Slots) -> None:
        super()._prepare(slots)
        if not len(self.batch.amounts):
            return
        # a displacement without a history of its own is reached evenly over the run
        self.batch.amounts[0, slots] = (self.steps[slots] + 1) / self._count
        due = self.time[slots] + self._h
        for number, motion in enumerate(self.model.motions):
            rows = slice(1 + 3 * number, 4 + 3 * number)
            self.batch.amounts[rows, slots] = np.array([motion.at(time) for time in due.tolist()]).T
