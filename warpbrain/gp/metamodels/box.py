"""Where the parameters of a meta-model are searched."""

from __future__ import annotations

from dataclasses import dataclass

#: How far exponents are searched: the paper's two settings.
SEARCHES = ("low", "high")


@dataclass(frozen=True)
class Box:
    """Bounds of the parameters, each of one sign, and where a search in them starts.

    Attributes
    ----------
    lower, upper : tuple of float
        Of each parameter; infinite where there is no bound.
    start : tuple of float
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    start: tuple[float, ...]
