"""What the samples of a batch do next: the decisions between two passes, over all slots at once.

A motion is a number of equal time steps, as `warpbrain run --steps` takes them. To rest steps grow as the motion slows,
as `warpbrain.simulation.relaxation` takes them: each sample has a step of its own, and one that must turn back or
shorten its steps holds up none of the others.
"""

import abc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.ensemble.batch import Batch, States
from warpbrain.ensemble.sample import Outcome, Sample, failure
from warpbrain.kernels.linear import LinearResult
from warpbrain.kernels.module import Precision
from warpbrain.simulation.dynamics import STEP_TOLERANCE, fault_of_step
from warpbrain.simulation.model import Model, require_held
from warpbrain.simulation.relaxation import LINEAR_TOLERANCE, RelaxationOptions, least_residual
from warpbrain.simulation.system import System

Slots = NDArray[np.intp]


@dataclass(frozen=True)
class Verdict:
    """What is to become of the slots whose state is new."""

    go: Slots  # they begin a step
    back: Slots  # they go back to where their last step began
    done: Slots  # their samples have their answer
    failed: dict[int, str]  # their samples have none, and why


class Course(abc.ABC):
    """A course of time steps, the same for all samples, in which each has a time of its own."""

    tolerance: float  # of the linear solves, relative
    #: Part of the solves of a pass that may go on in the next one, where a solve is many launches. On an H200 none is
    #: best where all take steps of one length, and a quarter in a run to rest, where some need a hundred times the
    #: iterations of others.
    linger: float = 0.0
    #: Whether all steps have one length: then the matrix of the next one is made while the host decides.
    even: bool = False

    def __init__(self, model: Model) -> None:
        self.model = model
        self._external = float(np.linalg.norm(model.external_forces()))

    @abc.abstractmethod
    def shapes(self) -> Floats:
        """Of what prescribed displacements are sums, shape (shapes, n, 3)."""

    def batch_of(self, system: System, samples: Sequence[Sample], slots: int) -> Batch:
        """A batch for this course."""
        shapes = self.shapes()
        return Batch(
            system, samples, slots, tolerance=self.tolerance, shapes=shapes, linger=self.linger, even=self.even
        )

    def attach(self, batch: Batch) -> None:
        """Follow the slots of a batch."""
        self.batch = batch
        # of the state of each slot, the residual relative to all nodal forces; iterations are of all linear solves
        self.time, self.residual = np.zeros(batch.slots), np.zeros(batch.slots)
        self.steps, self.cg_iterations = np.zeros(batch.slots, dtype=int), np.zeros(batch.slots, dtype=int)
        # the state is one to start from, not one that a step has led to
        self._entering = np.zeros(batch.slots, dtype=bool)

    def goes_on(self, slots: Slots) -> bool:
        """Whether a step may follow on those that slots begin."""
        return True

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
        times, which = np.unique((self.time + self.batch.time_step)[slots], return_inverse=True)
        for row, load in enumerate(self.model.loads):
            self.batch.load_factors[row, slots] = np.array([load.factor(time) for time in times.tolist()])[which]

    def support(self, slots: Sequence[int]) -> Floats:
        """What holds the constrained components of some slots [N], shape (slots, held, 3)."""
        held = self.batch.held
        times, which = np.unique(self.time[list(slots)], return_inverse=True)
        at = [self.model.external_forces(time)[held] for time in times.tolist()]
        external = np.reshape(at, (len(times), len(held), 3))[which]
        return self.model.reactions(self.batch.held_forces(slots), external, held)

    def why(self, slot: int, states: States) -> str:
        """What is wrong with the state of a slot."""
        batch, end = self.batch, self.time[slot] + self.batch.time_step[slot]
        numbers = (int(states.cg_iterations[slot]), float(states.cg_residual[slot]), float(states.cg_goal[slot]))
        linear = LinearResult(*numbers, curvature=np.nan)
        return fault_of_step(end, states.min_J[slot], linear, lambda: batch.system.least_of(batch.element_J(slot)))


class Moving(Course):
    """So many equal steps [s] of backward Euler."""

    even = True
    tolerance = STEP_TOLERANCE

    def __init__(self, model: Model, steps: int, time_step: float = 0.001) -> None:
        super().__init__(model)
        self._count, self._h = steps, time_step

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

    def goes_on(self, slots: Slots) -> bool:
        return bool(np.any(self._entering) or np.any(self.steps[slots] + 1 < self._count))

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


class Resting(Course):
    """Dynamic relaxation, as near to balance as rounding lets it; `InputError` if nothing holds a part of the body."""

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


def step_samples(system: System, course: Course, samples: Sequence[Sample], slots: int) -> Iterator[list[Outcome]]:
    """Compute samples, at most `slots` at a time.

    The outcome of a sample is the same to the last bit whatever the others are, and however many there are at a time;
    those of like stiffness go together. Yields the outcomes of samples that have ended together.
    """
    impossible = [failure(sample.number, sample.reason) for sample in samples if sample.materials is None]
    if impossible:
        yield impossible
    queue = sorted((s for s in samples if s.materials is not None), key=lambda s: (s.stiffness, s.number))
    if queue:
        batch = course.batch_of(system, queue, min(slots, len(queue)))
        yield from step_batch(batch, course, [sample.number for sample in queue])


def step_batch(batch: Batch, course: Course, numbers: Sequence[int]) -> Iterator[list[Outcome]]:
    """Compute samples of a batch, by their numbers and in this order; see `step_samples`."""
    course.attach(batch)
    number_in = np.full(batch.slots, -1)
    waiting = list(numbers)
    go = back = np.zeros(0, dtype=np.intp)
    while waiting or np.any(number_in >= 0):
        free = np.flatnonzero(number_in < 0)[: len(waiting)]
        number_in[free] = waiting[: len(free)]
        del waiting[: len(free)]
        batch.place(dict(zip(free.tolist(), number_in[free].tolist(), strict=True)))
        course.begin(free)
        states = batch.advance(go, np.concatenate([back, free]), on=course.goes_on(go))
        verdict = course.judge(states)
        batch.restore(verdict.back.tolist())
        ended, done = [], verdict.done.tolist()
        if done:
            known = (number_in, course.steps, course.cg_iterations, course.time, course.residual, states.min_J)
            fields = batch.displacements(done), course.support(done)
            for number, steps, iterations, time, residual, least, u, support in zip(
                *(of[done].tolist() for of in known), *fields, strict=True
            ):
                ended.append(Outcome(number, "", steps, iterations, time, residual, least, u, batch.held, support))
        for slot, reason in verdict.failed.items():
            taken = int(course.steps[slot]), int(course.cg_iterations[slot]), float(course.time[slot])
            ended.append(failure(int(number_in[slot]), reason, *taken))
        number_in[verdict.done] = -1
        number_in[list(verdict.failed)] = -1
        go, back = verdict.go, verdict.back
        if ended:
            yield sorted(ended, key=lambda outcome: outcome.number)
