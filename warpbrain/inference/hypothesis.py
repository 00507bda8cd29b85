"""Sets of causes as hypotheses."""

from __future__ import annotations

from dataclasses import dataclass

from warpbrain.inference.causes import Kind


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
