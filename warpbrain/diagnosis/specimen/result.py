"""What a diagnosis of a specimen found, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import Measurement, Ranked
from warpbrain.diagnosis.specimen.confirming import Confirmation
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.diagnosis.specimen.stage import Stage
from warpbrain.worlds.body.values import Smallest

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Segment:
    """Where in the tests a mechanism shows most.

    Attributes
    ----------
    test, mode : str
    segment : {"loading", "unloading", "hold"}
    strain : (float, float)
        Range of stretch or shear.
    time : (float, float) or None
        [s]
    """

    test: str
    mode: str
    segment: str
    strain: tuple[float, float]
    time: tuple[float, float] | None


@dataclass(frozen=True)
class Score:
    """Errors of one hypothesis, root mean squares [Pa].

    Attributes
    ----------
    fitted : float
        Of tests that it was fitted to.
    heldout : float or None
        Of tests that were held out in turn; None where nothing was fitted at all.
    check : dict of str to float
        Of each test with role `check`.
    """

    fitted: float
    heldout: float | None
    check: dict[str, float]


@dataclass(frozen=True, eq=False)
class SpecimenDiagnosis:
    """All of it.

    Attributes
    ----------
    case : Case
    protocol : Protocol
    verdict, sentence : str
        As of `warpbrain.diagnosis.result`.
    p_value : float
        Of nothing missing.
    named : tuple of Ranked
        In the order in which they were found; the last fit's values.
    group : tuple of str
    ranking : tuple of Ranked
        Of the first stage.
    rejected : dict of str to str
    stages : tuple of Stage
    where : Segment or None
    next_measurement : tuple of Measurement
    smallest : dict of str to Smallest
    scores : dict of str to Score
        ``"declared"``, ``"refitted"`` and, if something was added, ``"explained"``.
    stresses : dict of str to (n,) array
        Of the same, at all rows [Pa]; and ``"heldout refitted"``, ``"heldout explained"``.
    improvement : (part, low, high) or None
        Of the refitted case's held-out error that is gone.
    confirmations : tuple of Confirmation
        Of each kind of physics that was added.
    explained : Case or None
    assumptions, remarks : tuple of str
    by_test : bool
        Whether whole tests were held out.
    seconds : dict of str to float
    """

    case: Case
    protocol: Protocol
    verdict: str
    sentence: str
    p_value: float
    named: tuple[Ranked, ...]
    group: tuple[str, ...]
    ranking: tuple[Ranked, ...]
    rejected: dict[str, str]
    stages: tuple[Stage, ...]
    where: Segment | None
    next_measurement: tuple[Measurement, ...]
    smallest: dict[str, Smallest]
    scores: dict[str, Score]
    stresses: dict[str, Floats]
    improvement: tuple[float, float, float] | None
    confirmations: tuple[Confirmation, ...]
    explained: Case | None
    assumptions: tuple[str, ...]
    remarks: tuple[str, ...]
    by_test: bool
    seconds: dict[str, float]
