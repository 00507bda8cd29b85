"""The case with what was named, ready for `warpbrain run`: fitted again with nothing that a run cannot simulate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.fitting import Fitting, SpecimenFit
from warpbrain.diagnosis.specimen.folds import Folds
from warpbrain.diagnosis.specimen.forward import Hypothesis
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity


def explained_case(fitting: Fitting, fit: SpecimenFit, folds: Folds) -> Case | None:
    """The case of a fit; None if a run can simulate nothing of what it assumes, or no fit stands."""
    forward = fitting.forward
    runs = tuple(one for one in fit.hypothesis.assumptions if one.runs)
    if not runs:
        return None
    hypothesis = Hypothesis(runs, shape_of_law=False)
    first = len(forward.nuisances(fit.hypothesis))
    own = []
    for one in fit.hypothesis.assumptions:
        if one.runs:
            own.append(fit.z[first : first + len(one.mean)])
        first += len(one.mean)
    begin = np.concatenate([np.zeros(len(forward.nuisances(hypothesis))), *own])
    found = fitting.fit(hypothesis, folds.fitted, [begin], fit.kappa)
    if found is None:
        return None
    scale = float(np.exp(forward.nuisances(hypothesis).logarithmic[0, 0] * found.z[0]))
    [(label, tissue)] = forward.case.tissues.items()
    law = tissue.known_law.scaled_to(scale * tissue.known_law.shear_modulus)
    named = "-and-".join(dict.fromkeys(one.kind for one in runs))
    return replace(
        forward.case,
        name=f"{forward.case.name}-explained",
        title=f"{forward.case.title}, with {named}",
        tissues={label: replace(tissue, law=law)},
        mechanisms=(*forward.case.mechanisms, *_merged(forward.mechanisms(hypothesis, found.z))),
    )


def _merged(mechanisms: tuple[Mechanism, ...]) -> tuple[Mechanism, ...]:
    """Branches of several series in one."""
    branches = [one for one in mechanisms if isinstance(one, Viscoelasticity)]
    others = tuple(one for one in mechanisms if not isinstance(one, Viscoelasticity))
    if not branches:
        return others
    order = sorted(((t, m) for one in branches for m, t in zip(one.moduli, one.times, strict=True)))
    return (*others, Viscoelasticity(moduli=tuple(m for _, m in order), times=tuple(t for t, _ in order)))
