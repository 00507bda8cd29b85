"""All samples of a list through the slots of one batch: a slot that becomes free takes the next sample."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.ensemble.batch import Batch
from warpbrain.ensemble.course import Course
from warpbrain.ensemble.sample import Outcome, Sample, failure
from warpbrain.simulation.system import System


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
        batch = Batch(
            system,
            queue,
            min(slots, len(queue)),
            tolerance=course.tolerance,
            shapes=course.shapes(),
            linger=course.linger,
        )
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
        states = batch.advance(go, np.concatenate([back, free]))
        verdict = course.judge(states)
        batch.restore(verdict.back.tolist())
        ended = _answers(batch, course, verdict.done.tolist(), number_in, states.min_J)
        for slot, reason in verdict.failed.items():
            taken = int(course.steps[slot]), int(course.cg_iterations[slot]), float(course.time[slot])
            ended.append(failure(int(number_in[slot]), reason, *taken))
        number_in[verdict.done] = -1
        number_in[list(verdict.failed)] = -1
        go, back = verdict.go, verdict.back
        if ended:
            yield sorted(ended, key=lambda outcome: outcome.number)


def _answers(
    batch: Batch, course: Course, slots: list[int], number_in: NDArray[np.int_], min_J: Floats
) -> list[Outcome]:
    """Outcomes of the samples in some slots, which have their answer."""
    if not slots:
        return []
    model = course.model
    found = []
    for slot, u, internal in zip(slots, batch.displacements(slots), batch.internal_forces(slots), strict=True):
        time = float(course.time[slot])
        found.append(
            Outcome(
                number=int(number_in[slot]),
                reason="",
                steps=int(course.steps[slot]),
                cg_iterations=int(course.cg_iterations[slot]),
                time=time,
                residual=float(course.residual[slot]),
                min_J=float(min_J[slot]),
                u=u,
                reactions=model.reactions(internal, model.external_forces(time)),
            )
        )
    return found
