"""How to estimate, and who is told how it gets on."""

from collections.abc import Callable
from dataclasses import dataclass, field

from warpbrain.errors import InputError
from warpbrain.estimation.finer_mesh import Discretisation
from warpbrain.estimation.fit import GaussNewtonStep
from warpbrain.estimation.likelihood import Likelihood


@dataclass(frozen=True)
class Listener:
    """Who is told how an estimation or a diagnosis gets on."""

    stage: Callable[[str], None] = lambda _text: None  # in a few words, when something new begins
    step: Callable[[GaussNewtonStep], None] = lambda _step: None  # of an estimation's Gauss-Newton
    progress: Callable[[float], None] = lambda _part: None  # part that is done of an estimation's stage, from 0 to 1


@dataclass(frozen=True)
class EstimationOptions:
    """How to estimate.

    Attributes
    ----------
    likelihood : Likelihood
    discretisation : Discretisation or None
        None: the mesh is taken for exact, and the estimate holds for this mesh only.
    registration : bool
        Whether a rigid error of registration is estimated along, as large as `registration_of` the case; otherwise
        positions are taken as they were recorded.
    samples : int
        Draws that check Laplace's approximation, an equilibrium each.
    chain : int
        Equilibria of the chain that replaces it where it fails.
    seed : int
        Of those draws.
    tolerance : float
        Of Gauss-Newton, see `GaussNewton`.
    """

    likelihood: Likelihood = field(default_factory=Likelihood)
    discretisation: Discretisation | None = field(default_factory=Discretisation)
    registration: bool = True
    samples: int = 40
    chain: int = 300
    seed: int = 0
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if not isinstance(self.registration, bool):
            raise InputError("registration: expected True or False: how accurate it is, is said by the case")
        for name, least in (("samples", 25), ("chain", 10), ("seed", 0)):
            if getattr(self, name) < least:
                raise InputError(f"{name} = {getattr(self, name)}: expected a whole number of at least {least}")
