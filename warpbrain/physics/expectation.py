"""What is expected of a parameter before anything was observed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Expectation:
    """A distribution of one number, normal or uniform in it or in its logarithm, in the unit of its parameter."""

    words: str
    start: float  # median of a normal one, lower end of a uniform one
    width: float  # standard deviation, or distance of the ends; of a logarithm as a factor
    is_normal: bool
    is_logarithmic: bool = False

    def quantile(self, part: float) -> float:
        """The number below which a part of the distribution lies, 0 <= part <= 1."""
        if self.is_normal:
            from scipy.special import ndtri

            part = float(ndtri(part))
        return self.start * self.width**part if self.is_logarithmic else self.start + self.width * part

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest number that is expected at all; infinite of a normal distribution."""
        return self.quantile(0.0), self.quantile(1.0)

    def __str__(self) -> str:
        return self.words

    @classmethod
    def normal(cls, mean: float, sd: float) -> Expectation:
        """`N(mean, sd^2)`."""
        return cls(f"normal, {mean:g} ± {sd:g}", mean, sd, True)

    @classmethod
    def log_normal(cls, median: float, factor: float) -> Expectation:
        """A number whose logarithm is normal: two thirds of it lie within a `factor` of the `median`."""
        return cls(f"log-normal, {median:g} within a factor {factor:g}", median, factor, True, True)

    @classmethod
    def uniform(cls, low: float, high: float) -> Expectation:
        """Any number from `low` to `high` alike."""
        return cls(f"uniform, {low:g} to {high:g}", low, high - low, False)

    @classmethod
    def log_uniform(cls, low: float, high: float) -> Expectation:
        """Any order of magnitude from `low` to `high` alike."""
        return cls(f"log-uniform, {low:g} to {high:g}", low, high / low, False, True)
