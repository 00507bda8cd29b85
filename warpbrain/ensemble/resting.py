"""The course to rest: time steps that grow as the motion slows, as `warpbrain.simulation.relaxation` takes them.

Each sample has a step of its own: one that must turn back or shorten its steps holds up none of the others.
"""

from __future__ import annotations

import numpy as np

from warpbrain.ensemble.batch import Batch, States
from warpbrain.ensemble.course import Course, Floats, Slots, Verdict
from warpbrain.kernels.precision import Precision
from warpbrain.simulation.held import require_held
from warpbrain.simulation.model import Model
from warpbrain.simulation.relaxation import LINEAR_TOLERANCE, RelaxationOptions, least_residual


class Resting(Course):
    """Dynamic relaxation.

    Parameters
    ----------
    model : Model
    options : RelaxationOptions
    precision : Precision
        Decides how near to balance rounding lets a sample come.

    Raises
    ------
    InputError
        If nothing holds the body, or a part of it.
    """

    def __init__(self, model: Model, options: RelaxationOptions, precision: Precision) -> None:
        super().__init__(model)
        require_held(model)
        self._options = options
        self.tolerance = LINEAR_TOLERANCE
        self.linger = 0.25
        self.goal = least_residual(options.tolerance, precision)
        self._moves = bool(np.any(model.prescribed))

    def shapes(self) -> Floats:
        """The prescribed displacements at their end."""
        prescribed = self.model.prescribed
        return prescribed[None] if self._moves else np.zeros((0, *prescribed.shape))

    def attach(self, batch: Batch) -> None:
        super().attach(batch)
        self._moved, self._share = np.zeros(batch.slots), np.ones(batch.slots)

    def begin(self, slots: Slots) -> None:
        super().begin(slots)
        self.batch.time_step[slots] = self._options.time_step
        self._moved[slots] = 0.0
        self._share[slots] = 1.0

    def _decide(self, good: Slots, bad: Slots, states: States) -> Verdict:
        options, h = self._options, self.batch.time_step
        failed, back = {}, []
        for slot in bad.tolist():
            reason = self.why(slot, states)
            # a prescribed displacement that distorts too much is shared among more steps, not hurried
            if self._moves and self._moved[slot] < 1.0:
                self._share[slot] *= 0.5
            else:
                h[slot] *= 0.25
            if h[slot] < 1e-3 * options.time_step or self._share[slot] < 1e-3:
                failed[slot] = f"the motion does not come to rest: {reason}"
            else:
                back.append(slot)
        self.time[good] += h[good]
        self.steps[good] += 1
        self._moved[good] = np.minimum(1.0, self._moved[good] + self._share[good])
        rests = (self.residual[good] <= self.goal) & (self._moved[good] >= 1.0)
        late = ~rests & (self.steps[good] >= options.max_steps)
        for slot in good[late].tolist():
            failed[slot] = (
                f"not at rest after {options.max_steps} steps, {self.time[slot]:.3g} s: relative out-of-balance force "
                f"{self.residual[slot]:.1e}, goal {self.goal:.1e}"
            )
        go = good[~rests & ~late]
        h[go] = np.minimum(2.0 * h[go], options.largest_step)
        return Verdict(go, np.array(back, dtype=np.intp), good[rests], failed)

    def _prepare(self, slots: Slots) -> None:
        super()._prepare(slots)
        if self._moves:
            self.batch.amounts[0, slots] = np.minimum(1.0, self._moved[slots] + self._share[slots])
