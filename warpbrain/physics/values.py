"""What a diagnosis says in numbers: parameters with unit and standard deviation, what is seen, what to measure next."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """A parameter of a mechanism after the fit.

    Attributes
    ----------
    name : str
    value, sd : float
        In the unit.
    unit : str
    """

    name: str
    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Smallest:
    """The smallest effect of a kind that these data show.

    Attributes
    ----------
    size : float
        In the unit: nine of ten raise an alarm.
    unit : str
    name : str
        Of the parameter.
    named : float
        The size of which half would be named; infinite if none would.
    """

    size: float
    unit: str
    name: str
    named: float = float("inf")


@dataclass(frozen=True)
class Measurement:
    """Something that could be measured next.

    Attributes
    ----------
    what : str
    expected_nats : float
        By which it would tell the two most probable causes apart, expected log Bayes factor.
    """

    what: str
    expected_nats: float
