"""What the tool said of a case: its `diagnosis.json`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from referee.errors import InputError

#: Every verdict there is.
VERDICTS = ("nothing missing", "named", "group", "named + rest", "unknown", "not physics", "cannot say")
#: Those that claim that physics is missing.
ALARMS = ("named", "group", "named + rest", "unknown")
#: Those that say which.
NAMING = ("named", "group", "named + rest")
#: Probability of a label set.
TOGETHER = 0.9
#: A force without a name.
UNKNOWN = "unknown"
#: What is no physics, whichever of it.
NOT_PHYSICS = "not physics"
_UNITS = {"": 1.0, "1": 1.0, "%": 0.01, "mm": 1e-3, "m": 1.0, "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "N": 1.0, "s": 1.0} | {
    "1/Pa": 1.0,
    "kg/m3": 1.0,
    "1/(Pa s)": 1.0,
    "m4/(N s)": 1.0,
}


@dataclass(frozen=True)
class Ranked:
    """A candidate.

    Attributes
    ----------
    name : str
    probability : float
    detectability : float or None
        At its typical size.
    log_evidence : float or None
        Against nothing missing; None if it was not tried.
    physics : bool
    """

    name: str
    probability: float
    detectability: float | None
    log_evidence: float | None
    physics: bool

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of what acts together."""
        return tuple(part.strip() for part in self.name.split("+"))

    @property
    def alternative(self) -> bool:
        """Whether it is no physics."""
        return not self.physics and self.name != UNKNOWN

    def acts(self, tried: Tried) -> bool:
        """Whether it acts in a set of causes."""
        return NOT_PHYSICS in tried.causes if self.alternative else tried.causes.issuperset(self.parts)


@dataclass(frozen=True)
class Tried:
    """A set of causes that was tried.

    Attributes
    ----------
    causes : frozenset of str
        Names of physics, `UNKNOWN`, and `NOT_PHYSICS` whichever of it; the empty set is that nothing acts.
    log_density : float
        Log evidence and log prior together.
    probability : float
    """

    causes: frozenset[str]
    log_density: float
    probability: float = 0.0

    @property
    def physics(self) -> frozenset[str]:
        """What has a name."""
        return self.causes - {UNKNOWN, NOT_PHYSICS}


@dataclass(frozen=True)
class Diagnosis:
    """What the tool said.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`.
    p_value : float
        Of nothing missing.
    names : tuple of str
        What it names: several if it says that several act.
    probability : float or None
        That all acts that it names.
    group : tuple of str
        What it cannot tell apart.
    ranking : tuple of Ranked
        Best first.
    parameters : dict of str to (value, sd)
        In SI units; sd is None if there is none.
    centre : (x, y, z) or None
        [m]
    heldout : dict of str to float
        Error at what was not fitted [m]: declared, refitted, explained, as far as it is told.
    hypotheses : tuple of Tried
        Sets of causes that are told, the most probable first.
    """

    verdict: str
    p_value: float
    names: tuple[str, ...]
    probability: float | None
    group: tuple[str, ...]
    ranking: tuple[Ranked, ...]
    parameters: dict[str, tuple[float, float | None]]
    centre: tuple[float, float, float] | None
    heldout: dict[str, float]
    hypotheses: tuple[Tried, ...] = ()

    @property
    def alarm(self) -> bool:
        """Whether it claims that physics is missing."""
        return self.verdict in ALARMS

    @property
    def spoken(self) -> bool:
        """Whether it says one name, not a group."""
        return self.verdict in ("named", "named + rest") and bool(self.names)

    @property
    def said(self) -> set[str]:
        """Every name that it gives."""
        return {*self.names, *self.group} if self.verdict in NAMING else set()

    @property
    def tried(self) -> tuple[Ranked, ...]:
        """Candidates that there is evidence of."""
        return tuple(row for row in self.ranking if row.log_evidence is not None)

    @property
    def label_set(self) -> tuple[Ranked, ...]:
        """The fewest candidates, in their order, one of which acts with a probability of 0.9 if anything does."""
        left = [tried for tried in self.hypotheses if tried.causes]
        total = sum(tried.probability for tried in left)
        for count, row in enumerate(self.ranking, start=1):
            left = [tried for tried in left if not row.acts(tried)]
            if sum(tried.probability for tried in left) <= (1.0 - TOGETHER) * total:
                return self.ranking[:count]
        return self.ranking

    @property
    def first(self) -> str:
        """The best candidate; nothing if it says that nothing is missing."""
        if self.verdict == "nothing missing" or not self.ranking:
            return ""
        return self.ranking[0].name


def read_diagnosis(file: Path) -> Diagnosis:
    """Read a `diagnosis.json`; `InputError` naming file and key if it is not one."""
    try:
        data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: {error}") from None
    try:
        return _diagnosis(data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{file}: {type(error).__name__} {error}: not what a diagnosis says") from None


def _diagnosis(data: dict[str, Any]) -> Diagnosis:
    verdict = " + ".join(part.strip() for part in data["verdict"].lower().replace("_", " ").split("+"))
    if verdict not in VERDICTS:
        raise ValueError(f"verdict '{data['verdict']}'")
    # all that are named, the first of which stands alone as well
    mechanism = [one["mechanism"] for one in data.get("mechanisms") or ()] or data.get("mechanism") or []
    names = [mechanism] if isinstance(mechanism, str) else mechanism
    names = tuple(part.strip() for name in names for part in name.split("+"))
    where = data.get("where") or {}
    centre = where.get("centre_m")
    hypotheses = tuple(_tried(row) for row in data.get("hypotheses") or ())
    return Diagnosis(
        verdict=verdict,
        p_value=float(data["p_value"]),
        names=names,
        probability=_joint(names, hypotheses) if hypotheses and len(names) > 1 else data.get("probability"),
        group=tuple(data.get("group") or ()),
        ranking=tuple(
            Ranked(
                name=row["mechanism"],
                probability=float(row["probability"]),
                detectability=row.get("detectability"),
                log_evidence=row.get("log_evidence"),
                physics=bool(row.get("physics", True)),
            )
            for row in data["ranking"]
        ),
        parameters={name: _parameter(said) for name, said in (data.get("parameters") or {}).items()},
        centre=None if centre is None else (float(centre[0]), float(centre[1]), float(centre[2])),
        heldout=_heldout(data.get("fit") or {}),
        hypotheses=hypotheses,
    )


def _joint(names: tuple[str, ...], hypotheses: tuple[Tried, ...]) -> float:
    """Probability that all of these act: that of each alone is said of each, and is more."""
    return sum(tried.probability for tried in hypotheses if tried.causes.issuperset(names))


def _tried(row: dict[str, Any]) -> Tried:
    kinds = {"physics": None, UNKNOWN: UNKNOWN, NOT_PHYSICS: NOT_PHYSICS}
    causes = frozenset(kinds[kind] or name for name, kind in zip(row["causes"], row["kinds"], strict=True))
    return Tried(causes, float(row["log_evidence"]) + float(row["log_prior"]), float(row["probability"]))


def _parameter(said: dict[str, Any]) -> tuple[float, float | None]:
    si = _UNITS[said.get("unit") or ""]
    value, sd = said["value"], said.get("sd")
    # of several branches the sum counts
    value = sum(value) if isinstance(value, list) else value
    if isinstance(sd, list):
        sd = sum(s**2 for s in sd) ** 0.5
    return si * float(value), None if sd is None else si * float(sd)


def _heldout(fit: dict[str, Any]) -> dict[str, float]:
    """Error at what was not fitted, told by stage or by quantity."""
    errors = {}
    for stage in ("declared", "refitted", "explained"):
        by_stage, by_quantity = fit.get(stage), fit.get("heldout_rmse_m")
        value = by_stage.get("heldout_rmse_m") if isinstance(by_stage, dict) else None
        if value is None and isinstance(by_quantity, dict):
            value = by_quantity.get(stage)
        if value is not None:
            errors[stage] = float(value)
    return errors
