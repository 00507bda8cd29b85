"""How large the unknown part of the mesh's error is: learned from the residuals of each case.

Beside the error that a finer mesh shows there is one that it does not: surfaces that are polygons, elements that are
still too few. It is a part of the displacement, alike among neighbours. How large a part depends on mesh, load and
where is recorded; taken for larger than it is, it hides what is missing. So it has the value that explains the
residuals best, with and without any smooth force beside it: what is missing must not be taken for an error of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.screening import log_unknown
from warpbrain.inference.beliefs import beliefs
from warpbrain.worlds.body.nuisances import Nuisances

Floats = NDArray[np.float64]

#: Parts of the displacement that are tried, all alike likely.
FRACTIONS = beliefs("mesh.unknown")


def likely_fraction(factor: Floats, nuisances: Nuisances, residual: Floats, smooth: Sequence[Floats]) -> float:
    """Root mean square of the fraction after the residuals.

    Parameters
    ----------
    factor : (n, n) array
        Of the noise.
    nuisances : Nuisances
        With any fraction.
    residual : (n,) array
        Of the linear model with all nuisances in the middle of their prior [m].
    smooth : sequence of (n, k) arrays
        Columns of any smooth force, of some lengths and sizes.
    """
    from scipy.special import logsumexp, softmax

    scores = []
    for fraction in FRACTIONS.tolist():
        explanation = Explanation(factor, nuisances.with_fraction(fraction).columns)
        white = explanation.whitened(residual)[:, None]
        beside = log_unknown([explanation.with_more(columns) for columns in smooth], white)
        scores.append(logsumexp([explanation.log_marginal(white)[0], beside[0]]))
    return float(np.sqrt(softmax(scores) @ FRACTIONS**2))
