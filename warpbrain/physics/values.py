"""What a diagnosis says in numbers: parameters with unit and standard deviation, what is seen, what to measure next."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """A parameter of a mechanism after the fit."""

    name: str
    value: float  # in the unit
    sd: float
    unit: str


@dataclass(frozen=True)
class Smallest:
    """The smallest effect of a kind that these data show."""

    size: float  # in the unit: nine of ten raise an alarm
    unit: str
    name: str  # of the parameter
    named: float = float("inf")  # the size of which half would be named; infinite if none would


@dataclass(frozen=True)
class Measurement:
    """Something that could be measured next."""

    what: str
    expected_nats: float  # by which it would tell the two most probable causes apart, expected log Bayes factor
