"""Parameters of a mechanism as a user knows them: with a unit and a standard deviation."""

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
