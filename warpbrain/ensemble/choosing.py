"""Which samples an ensemble has: draws of the tissues' joint prior, or the paper's sweep."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups, with_prior_draw
from warpbrain.ensemble.sample import Sample
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import law_of_curve
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.stability import UnstableLawError, require_stable
from warpbrain.simulation.model import Material

#: Standard deviations from the mean curve that the paper's sweep takes, for each tissue.
SWEEP = np.linspace(-2.0, 2.0, 17)


def drawn_samples(
    case: Case, count: int, seed: int, process: Process, on_sample: Callable[[int], None] | None = None
) -> list[Sample]:
    """Draws 0 to `count` - 1 of the joint prior of a case's tissues.

    A draw of which no stable law is found is a sample without materials. `InputError` if a tissue has no group, or one
    that the process has seen no study of.
    """
    require_groups(case, tuple(sorted(case.tissues)), process)
    samples = []
    for number in range(count):
        try:
            found = with_prior_draw(case, number, seed, process)
        except SolveError as error:
            samples.append(Sample(number, None, str(error).removeprefix(f"{case.path}: ")))
        else:
            laws = {label: tissue.known_law for label, tissue in found.case.tissues.items()}
            samples.append(Sample(number, _materials(case, laws)))
        if on_sample is not None:
            on_sample(number)
    return samples


def swept_samples(case: Case, process: Process) -> list[Sample]:
    """The paper's sweep: the laws of the curves `k` standard deviations from the mean, 17 `k` in [-2, 2] a tissue.

    One tissue makes 17 samples, two make the 289 pairs, the last tissue fastest. A law that is not stable is a sample
    without materials. `InputError` if a tissue has no group, or one that the process has seen no study of; for more
    than two tissues.
    """
    labels = tuple(sorted(case.tissues))
    require_groups(case, labels, process)
    if len(labels) > 2:
        raise InputError(f"{case.path}: the paper's sweep is over one or two tissues; this case has {len(labels)}")
    laws = {}
    for label in labels:
        tissue = case.tissues[label]
        laws[label] = [law_of_curve(process, tissue.prior, float(k), tissue.model).law() for k in SWEEP]
    samples = []
    for number, places in enumerate(product(range(len(SWEEP)), repeat=len(labels))):
        chosen = {label: laws[label][place] for label, place in zip(labels, places, strict=True)}
        deviations = {label: float(SWEEP[place]) for label, place in zip(labels, places, strict=True)}
        reason = _unstable(case, chosen)
        samples.append(Sample(number, None if reason else _materials(case, chosen), reason, deviations))
    return samples


def _unstable(case: Case, laws: Mapping[int, Law]) -> str:
    """Why a law is not stable; empty if all are."""
    for label, law in laws.items():
        try:
            require_stable(law, case.poisson, case.tissues[label].formulation)
        except UnstableLawError as error:
            return f"tissue {label}: {error}"
    return ""


def _materials(case: Case, laws: Mapping[int, Law]) -> dict[int, Material]:
    return {label: Material(law, case.poisson, case.tissues[label].formulation) for label, law in laws.items()}
