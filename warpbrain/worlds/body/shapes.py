"""What is not known of the shape of a mechanism that acts in one place, as columns about a fit.

A mechanism is looked for as a round patch or a ball. Blades are oblong, tumours are lobed, and oedema follows white
matter: some of what acts is beside the patch, over a larger one or over a smaller one. Where it moves the recordings
far that is more than their noise, and without these columns what is left of it is taken for a further mechanism.
"""

import math
from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import SHAPE_MODES, SHAPED_EFFECTS
from warpbrain.worlds.body.places import places_about

#: How far neighbours are from the middle, in radii: where a patch has half of its height.
_BESIDE = 0.5


def columns_of_other_shapes(at: Linearisation, effects: Sequence[Effect], coefficients: Sequence[Floats]) -> Floats:
    """Change of what is recorded (n, k) by each mode of shape of mechanisms, about a state with these coefficients.

    Each column moves a part of what acts to a neighbouring place or another radius, all together
    `belief("causes.shape")`. Zero of what is everywhere, is there or not, or has a course in time.
    """
    columns = np.zeros((len(at.sensors), SHAPED_EFFECTS, SHAPE_MODES))
    made = Effects(at)
    for number, (effect, z) in enumerate(zip(effects[:SHAPED_EFFECTS], coefficients, strict=False)):
        proposed = effect.proposed
        if not effect.is_placed or proposed.over_time is not None:
            continue
        assert proposed.elsewhere is not None and proposed.centre is not None and proposed.radius is not None
        here = proposed.elsewhere(proposed.centre, proposed.radius)
        others = places_about(at.system.model, proposed, _BESIDE * proposed.radius)
        size = effect.coefficients(z)
        moved = [
            each.columns @ ((size - proposal.mean) / proposal.sd)
            for each, proposal in zip(made.of([here, *others], columns_alone=True), [here, *others], strict=True)
        ]
        columns[:, number, : len(others)] = np.column_stack(moved[1:]) - moved[0][:, None]
    return belief("causes.shape") / math.sqrt(SHAPE_MODES) * columns.reshape(len(columns), -1)
