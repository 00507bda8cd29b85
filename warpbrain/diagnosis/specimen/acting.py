"""What a candidate does to the tests of a specimen, and how it may act: the faces that every candidate has here.

Registered mechanisms (`warpbrain.physics.mechanisms`) act through the material. Candidates that are no mechanism of
`run` (softening by earlier loading, end friction, another shape of the law, a drifting zero, unlike specimens) scale
the simulated stress or add to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpbrain.physics.mechanism import Mechanism

if TYPE_CHECKING:
    from warpbrain.diagnosis.specimen.protocol import Protocol

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Unit:
    """The simulated stress of unit modulus and what nuisances and candidates are made of.

    Attributes
    ----------
    protocol : Protocol
    mu : float
        Shear modulus of the case's law [Pa].
    base : (n,) array
        Stress [Pa] of the case's own law, elastic, ends as the case has them.
    glued : (n,) array
        Factor of the shape with its ends as the case has them: 1 where they are lubricated.
    sticking : callable
        Gives the same (n,) if they are glued.
    """

    protocol: Protocol
    mu: float
    base: Floats
    glued: Floats
    sticking: Callable[[], Floats]


@dataclass(frozen=True, eq=False)
class Acting:
    """What a candidate does.

    Attributes
    ----------
    mechanisms : tuple of Mechanism
        Of the registry.
    factor : (n,) array or None
        On the stress.
    scaled, added : (n,) array or None
        Added to the stress: before it is scaled by the modulus, and after [Pa].
    """

    mechanisms: tuple[Mechanism, ...] = ()
    factor: Floats | None = None
    scaled: Floats | None = None
    added: Floats | None = None


@dataclass(frozen=True, eq=False)
class Assumption:
    """One way in which a candidate may act.

    Attributes
    ----------
    kind : str
    physics : bool
        Whether it is physics of the tissue, not of the test.
    sentence : str
    names, units : tuple of str
        Of what `values` says.
    mean, sd : (k,) array
        Of the coefficients beforehand; normal.
    act : callable
        From coefficients (k,) and the stress of unit modulus to what it does.
    values : callable
        From coefficients to the numbers that users know.
    runs : bool
        Whether `warpbrain run` can simulate it.
    region : str
        In which way it acts, in words.
    """

    kind: str
    physics: bool
    sentence: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Floats
    sd: Floats
    act: Callable[[Floats, Unit], Acting]
    values: Callable[[Floats], tuple[float, ...]]
    runs: bool = False
    region: str = ""
    #: Standard deviations of the coefficients from which fits begin; those that are not said are 0.
    starts: tuple[tuple[float, ...], ...] = field(default=((),))
