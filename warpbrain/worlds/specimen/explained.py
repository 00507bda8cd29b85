"""The case with what was named, ready for `warpbrain run`: fitted again with nothing that a run cannot simulate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.worlds.specimen.fit import Fit, Fitting


def explained_case(fitting: Fitting, fit: Fit) -> Case | None:
    """The case of a fit; None if a run can simulate nothing of what it assumes, or no fit stands."""
    runs = [k for k, one in enumerate(fit.assumed) if one.effect.runs]
    if not runs:
        return None
    assumed = tuple(fit.assumed[k] for k in runs)
    forward = fit.forward.of(shape_of_law=False)
    begin = np.concatenate([np.zeros(len(forward.nuisances)), *(fit.z[fit.part(k)] for k in runs)])
    found = fitting.fit(forward, assumed, np.zeros((len(fit.stress), 0)), begin, fit.scale)
    if found is None:
        return None
    case = forward.case
    scale = float(np.exp(found.forward.nuisances.logarithmic[0, 0] * found.z[0]))
    [(label, tissue)] = case.tissues.items()
    law = tissue.known_law.scaled_to(scale * tissue.known_law.shear_modulus)
    return replace(
        case,
        name=f"{case.name}-explained",
        title=f"{case.title}, with {'-and-'.join(one.effect.name for one in assumed)}",
        tissues={label: replace(tissue, law=law)},
        mechanisms=(*case.mechanisms, *found.forward.mechanisms(assumed, found.z)),
    )
