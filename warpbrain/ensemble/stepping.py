"""All samples of a list through the slots of one batch: a slot that becomes free takes the next sample."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from warpbrain.ensemble.batch import Batch
from warpbrain.ensemble.course import Course
from warpbrain.ensemble.sample import Outcome, Sample, failure
from warpbrain.simulation.system import System


def step_samples(system: System, course: Course, samples: Sequence[Sample], slots: int) -> Iterator[list[Outcome]]:
    """Compute samples, at most `slots` at a time.

    The outcome of a sample is the same to the last bit whatever the others are, and however many there are at a time.

    Parameters
    ----------
    system : System
        Of the course's model.
    course : Course
    samples : sequence of Sample
        In any order; samples of like stiffness go together.
    slots : int

    Yields
    ------
    list of Outcome
        Of the samples that have ended together.
    """
    impossible = [failure(sample.number, sample.reason) for sample in samples if sample.materials is None]
    if impossible:
        yield impossible
    queue = sorted((s for s in samples if s.materials is not None), key=lambda s: (s.stiffness, s.number))
    if not queue:
        return
    slots = min(slots, len(queue))
    batch = Batch(system, queue, slots, tolerance=course.tolerance, shapes=course.shapes())
    course.attach(batch)
    number_in = np.full(slots, -1)
    waiting = [sample.number for sample in queue]
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
        ended = [
            _outcome(batch, course, int(slot), int(number_in[slot]), float(states.min_J[slot])) for slot in verdict.done
        ]
        for slot, reason in verdict.failed.items():
            taken = int(course.steps[slot]), int(course.cg_iterations[slot]), float(course.time[slot])
            ended.append(failure(int(number_in[slot]), reason, *taken))
        number_in[verdict.done] = -1
        number_in[list(verdict.failed)] = -1
        go, back = verdict.go, verdict.back
        if ended:
            yield sorted(ended, key=lambda outcome: outcome.number)


def _outcome(batch: Batch, course: Course, slot: int, number: int, min_J: float) -> Outcome:
    model, time = course.model, float(course.time[slot])
    reactions = batch.internal_forces(slot) - model.external_forces(time)
    return Outcome(
        number=number,
        reason="",
        steps=int(course.steps[slot]),
        cg_iterations=int(course.cg_iterations[slot]),
        time=time,
        residual=float(course.residual[slot]),
        min_J=min_J,
        u=batch.displacement(slot),
        reactions=np.where(model.constrained, reactions, 0.0),
    )
