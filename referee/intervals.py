"""Exact intervals of shares (Clopper and Pearson 1934)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scipy.stats import beta


@dataclass(frozen=True)
class Share:
    """How many of how many.

    Attributes
    ----------
    hits, of : int
    """

    hits: int
    of: int

    @property
    def value(self) -> float | None:
        """The share; None of nothing."""
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float]:
        """Two-sided 95 % interval of Clopper and Pearson; from 0 to 1 of nothing."""
        k, n = self.hits, self.of
        low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
        high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
        return low, high

    def described(self) -> dict[str, object]:
        """For a file."""
        return {"hits": self.hits, "of": self.of, "share": self.value, "interval": list(self.interval)}

    def __str__(self) -> str:
        if not self.of:
            return "0 of 0"
        low, high = self.interval
        return f"{self.hits} of {self.of} = {100 * self.hits / self.of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def share(flags: Iterable[bool]) -> Share:
    """Share of what is true in an iterable."""
    values = list(flags)
    return Share(sum(values), len(values))
