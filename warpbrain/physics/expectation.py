"""What is expected of a parameter before anything was observed."""

from __future__ import annotations

import abc
from dataclasses import dataclass


class Expectation(abc.ABC):
    """A distribution of one number, in the unit of its parameter."""

    @abc.abstractmethod
    def quantile(self, part: float) -> float:
        """The number below which a part of the distribution lies, 0 < part < 1."""

    @abc.abstractmethod
    def __str__(self) -> str: ...


@dataclass(frozen=True)
class Normal(Expectation):
    """`N(mean, sd^2)`."""

    mean: float
    sd: float

    def quantile(self, part: float) -> float:
        from scipy.special import ndtri

        return self.mean + self.sd * float(ndtri(part))

    def __str__(self) -> str:
        return f"normal, {self.mean:g} ± {self.sd:g}"


@dataclass(frozen=True)
class LogNormal(Expectation):
    """A number whose logarithm is normal: two thirds of it lie within a `factor` of the `median`."""

    median: float
    factor: float

    def quantile(self, part: float) -> float:
        from scipy.special import ndtri

        return self.median * self.factor ** float(ndtri(part))

    def __str__(self) -> str:
        return f"log-normal, {self.median:g} within a factor {self.factor:g}"


@dataclass(frozen=True)
class Uniform(Expectation):
    """Any number from `low` to `high` alike."""

    low: float
    high: float

    def quantile(self, part: float) -> float:
        return self.low + part * (self.high - self.low)

    def __str__(self) -> str:
        return f"uniform, {self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class LogUniform(Expectation):
    """Any order of magnitude from `low` to `high` alike."""

    low: float
    high: float

    def quantile(self, part: float) -> float:
        return self.low * (self.high / self.low) ** part

    def __str__(self) -> str:
        return f"log-uniform, {self.low:g} to {self.high:g}"
