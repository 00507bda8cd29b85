"""In which unit the errors of a diagnosis are: lengths of a body, stresses of a specimen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from warpbrain.report.files import MILLIMETRES


@dataclass(frozen=True)
class Unit:
    """How errors are shown.

    Attributes
    ----------
    name : str
    factor : float
        From what is saved.
    suffix : str
        Of the keys of `diagnosis.json`.
    error : str
        What of one recorded row is squared.
    """

    name: str
    factor: float
    suffix: str
    error: str


def unit_of(summary: Mapping[str, Any]) -> Unit:
    """That of the errors of a diagnosis."""
    if "rmse_m" in summary["fit"]:
        return Unit("mm", MILLIMETRES, "m", "distance in space")
    return Unit("Pa", 1.0, "pa", "error of the stress")
