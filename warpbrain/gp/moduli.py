"""What a generative model says of the shear modulus of a group, through the laws of its curves and of its draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.gp.metamodels.fit import Fit
from warpbrain.gp.metamodels.stability import unstable
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import draw_many, law_of_curve, rejection_rate

#: Curves whose laws are told: this many standard deviations from the mean.
CURVES = (-2.0, 0.0, 2.0)


@dataclass(frozen=True)
class Moduli:
    """Of one group, with one law.

    Attributes
    ----------
    group, law : str
    fits : tuple of Fit
        Of the curves that lie `CURVES` standard deviations from the mean.
    unstable : tuple of str
        Why each of these is unstable; empty where it is not.
    median, low, high : float
        Of the shear modulus at rest [Pa] of stable draws: 50 %, 2.5 % and 97.5 % lie below.
    median_error : float
        Relative standard error of the median: the number of draws is finite.
    draws : int
    rejection_rate : float
        Part of the attempts that gave an unstable law.
    """

    group: str
    law: str
    fits: tuple[Fit, ...]
    unstable: tuple[str, ...]
    median: float
    low: float
    high: float
    median_error: float
    draws: int
    rejection_rate: float


def moduli(model: Process, group: str, law: str, draws: int = 1000, seed: int = 0, poisson: float = 0.45) -> Moduli:
    """Fit a law to the curves of a group, and to draws of it.

    Parameters
    ----------
    model : Process
    group, law : str
    draws, seed : int
    poisson : float
        With which laws are to be stable.

    Raises
    ------
    InputError
        If the model has seen no study of the group, or there is no such law.
    SolveError
        If no stable law is drawn.

    Examples
    --------
    >>> from warpbrain.gp.trained import trained
    >>> found = moduli(trained(), "hyperelastic/brain", "neo-hookean", draws=40)
    >>> found.low < found.median < found.high
    True
    """
    fits = tuple(law_of_curve(model, group, k, law) for k in CURVES)
    drawn = list(draw_many(model, [group], law, draws, seed, poisson))
    values = np.array([draw.shear_moduli[0] for draw in drawn])
    low, median, high = np.quantile(values, [0.025, 0.5, 0.975]).tolist()
    # of a normal distribution's median, in logarithms
    error = float(np.sqrt(0.5 * np.pi / draws) * np.log(values).std())
    return Moduli(
        group,
        law,
        fits,
        tuple(unstable(fitted, poisson) for fitted in fits),
        median,
        low,
        high,
        error,
        draws,
        rejection_rate(drawn),
    )
