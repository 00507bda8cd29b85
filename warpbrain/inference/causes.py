"""What may have caused residuals: mechanisms, unknown fields, or what is no physics, alike; and sets of causes."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from warpbrain.arrays import Floats


class Kind(Enum):
    """Of which kind a cause is; verdicts differ among them."""

    PHYSICS = "physics"
    UNKNOWN = "unknown"
    NOT_PHYSICS = "not physics"


@dataclass(frozen=True, eq=False)
class Place:
    """A cause at one place, level, node set or course."""

    columns: Floats  # (n, k), what a unit of size of each coefficient changes of each row
    #: (n,): expected change of each row, whatever the size, such as the weight at a level of the fluid; zero if not
    #: given.
    mean: Floats | None = None
    label: str = ""  # which of several things a cause is here


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause.

    Coefficients are normal with the standard deviation `s`, which is one of a few sizes: a scale mixture, by which the
    prior penalises a small cause no more than a large one.
    """

    name: str
    places: tuple[Place, ...]
    log_prior: float  # logarithm of the odds that it acts, before anything was recorded
    #: (s,): standard deviations of the coefficients, in units of the columns.
    sizes: Floats = field(default_factory=lambda: np.ones(1))
    kind: Kind = Kind.PHYSICS
    shares: Floats | None = None  # (p,), probability of each place; all are equally probable if not given

    def __post_init__(self) -> None:
        if self.shares is not None and len(self.shares) != len(self.places):
            raise ValueError(f"{self.name}: {len(self.shares)} shares of {len(self.places)} places")

    @property
    def log_weights(self) -> Floats:
        """Logarithm of the probability of each place and size, (p, s)."""
        count = len(self.places)
        shares = np.full(count, 1.0 / count) if self.shares is None else self.shares
        return np.repeat(np.log(shares)[:, None], len(self.sizes), axis=1) - np.log(len(self.sizes))


@dataclass(frozen=True)
class Member:
    """A cause of a hypothesis by its number, the number of its place and that of its size."""

    cause: int
    place: int
    size: int


@dataclass(frozen=True)
class Configuration:
    """Causes with places and sizes at a scale of the noise."""

    members: tuple[Member, ...]
    scale: float
    log_density: float  # of it and the rows
    #: Of a single cause, the log of the part that its place has in the evidence, all sizes and scales together.
    log_share: float = 0.0


@dataclass(frozen=True)
class Hypothesis:
    """A set of causes."""

    causes: tuple[str, ...]
    kinds: tuple[Kind, ...]  # of each of them
    log_evidence: float  # log density of the rows, summed over places, sizes and scales
    log_prior: float  # sum of the log odds of its causes
    best: Configuration  # the most probable one
    #: Of a single cause, the most probable ones at other places, the best first.
    elsewhere: tuple[Configuration, ...] = ()

    def of_kind(self, kind: Kind) -> tuple[str, ...]:
        """Its causes of a kind."""
        return tuple(cause for cause, other in zip(self.causes, self.kinds, strict=True) if other is kind)
