"""What is true of a case beside what the tool said of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from referee.diagnoses import UNKNOWN, Diagnosis, Ranked, read_diagnosis
from referee.runs import DIAGNOSIS, read_runs, read_seen


@dataclass(frozen=True)
class ScoredSet:
    """A set of cases that was diagnosed.

    Attributes
    ----------
    cases, labels, diagnoses : Path
        Folders of case folders, of sealed labels and of what `run` wrote.
    commitments : Path
        Published hashes of the labels.
    """

    cases: Path
    labels: Path
    commitments: Path
    diagnoses: Path


@dataclass(frozen=True)
class Outcome:
    """One case.

    Attributes
    ----------
    name : str
    label : mapping
        What is true; see `referee.labels.label_of`.
    said : Diagnosis
    seen : float or None
        How much the effects stand out for the tool, see `referee.seen_by_tool`; None if it was not found out.
    seen_given : tuple of float
        The same of each of two where the size of the other is not known; nothing if it was not found out.
    left_out : str
        Mechanism that the tool's dictionary was without.
    """

    name: str
    label: Mapping[str, Any]
    said: Diagnosis
    seen: float | None = None
    seen_given: tuple[float, ...] = ()
    left_out: str = ""

    @property
    def kind(self) -> str:
        """none, effect, two, outside or trap; left out: an effect whose mechanism the dictionary was without."""
        kind = str(self.label["kind"])
        return "left out" if kind == "effect" and self.truth == self.left_out else kind

    @property
    def truth(self) -> str:
        """Name of what acts, of the first of two; nothing if nothing is missing."""
        return str(self.label["names"][0]) if self.label["names"] else ""

    @property
    def effect(self) -> Mapping[str, Any]:
        """The first effect."""
        first: Mapping[str, Any] = self.label["effects"][0]
        return first

    @property
    def d(self) -> float:
        """How much the effects stand out, by the referee's measure."""
        return float(self.label["detectability"])

    @property
    def given(self) -> tuple[float, ...]:
        """How much each effect stands out where those of the others are not known; nothing if the label is older."""
        effects = self.label["effects"]
        return tuple(float(e["conditional"]) for e in effects) if all("conditional" in e for e in effects) else ()

    @property
    def upper(self) -> float:
        """The same by the measure of run 1, which knows noise, a rigid motion and the stiffness of tissues alone."""
        return float(self.label.get("upper", self.label["detectability"]))

    @property
    def d_of_tool(self) -> float | None:
        """Of the true mechanism at its typical size, by the tool."""
        return next((row.detectability for row in self.said.ranking if row.name == self.truth), None)

    def right(self, name: str) -> bool:
        """Whether a name is that of something that acts."""
        also = [other for effect in self.label["effects"] for other in effect["also"]]
        return self.kind not in ("trap", "left out") and name in (*self.label["names"], *also)

    def holds(self, row: Ranked) -> bool:
        """Whether a candidate is true: all its parts act; the unknown outside the dictionary; no physics in a trap."""
        if row.alternative:
            return self.kind == "trap"
        if row.name == UNKNOWN:
            return self.kind in ("outside", "left out")
        return all(self.right(part) for part in row.parts)

    @property
    def top(self) -> bool:
        """Whether the best candidate is right."""
        return self.right(self.said.first)

    @property
    def covered(self) -> bool:
        """Whether something in the 90 % label set is true."""
        return any(self.holds(row) for row in self.said.label_set)

    @property
    def named(self) -> bool:
        """Whether it gives one name, and that is right."""
        return self.said.spoken and all(self.right(name) for name in self.said.names)

    @property
    def held(self) -> bool:
        """Whether it gives the right name, alone or in a group; outside the dictionary that of the unknown."""
        nameless = self.kind in ("outside", "left out")
        right = {name for name in self.said.said if self.right(name) or (nameless and name == UNKNOWN)}
        return self.named or (self.said.verdict == "group" and bool(right))

    @property
    def centre_error(self) -> float | None:
        """Distance [m] from the middle of a local effect; None if there is none or none is told."""
        if not self.label["effects"] or self.effect["where_m"] is None or self.said.centre is None:
            return None
        return float(np.linalg.norm(np.subtract(self.effect["where_m"], self.said.centre)))

    @property
    def amount(self) -> tuple[float, bool | None] | None:
        """Relative error of the estimated amount, and whether it is within two standard deviations.

        Relative to the size of the effect: the depth that fluid has drained by, not its level; the logarithm of a
        ratio. None if the name is not right, or the amount is not told.
        """
        if not self.named or self.kind != "effect" or self.effect["amount"] is None:
            return None
        estimate = self.said.parameters.get(self.effect["parameter"])
        if estimate is None:
            return None
        value, sd = estimate
        true = float(self.effect["amount"])
        if self.effect["parameter"] == "ratio":
            if value <= 0.0:
                return None
            sd = None if sd is None else sd / value
            value, true = float(np.log(value)), float(np.log(true))
        error = abs(value - true)
        return error / float(self.effect["size"]), None if sd is None else error <= 2.0 * sd

    @property
    def cut(self) -> float | None:
        """Part of the held-out error above the noise that is gone once the effect is in the model.

        Mean squares, less that of the noise which the referee put on the `check` points.
        """
        declared, explained = (self.said.heldout.get(stage) for stage in ("declared", "explained"))
        if declared is None or explained is None:
            return None
        floor = float(self.label["check_noise_m"]) ** 2
        before, after = (np.sqrt(max(value**2 - floor, 0.0)) for value in (declared, explained))
        return float(1.0 - after / before) if before > 0.0 else None


def read_outcomes(labels: Mapping[str, Mapping[str, Any]], diagnoses: Path) -> tuple[list[Outcome], list[str]]:
    """Outcomes of all cases of which there is a diagnosis, and the names of those of which there is none."""
    outcomes, missing = [], []
    seen = read_seen(diagnoses)
    left_out = {row["case"]: row.get("left_out") or "" for row in read_runs(diagnoses)}
    for name, label in labels.items():
        file = diagnoses / name / DIAGNOSIS
        if file.exists():
            whole, *given = seen.get(name) or [None]
            said = read_diagnosis(file)
            outcomes.append(Outcome(name, label, said, whole, tuple(given), left_out.get(name, "")))
        elif not any(left_out.values()) or name in left_out:
            missing.append(name)
    return outcomes, missing
