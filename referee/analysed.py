"""What the optimal analyst would have said of each case, in the shape of the tool's diagnoses."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from referee.calibrate import FILE, known_of, true_of
from referee.decision import Posterior, decide
from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Diagnosis, Ranked, Tried
from referee.errors import InputError
from referee.outcomes import Outcome

#: Shares that the analyst is not asked for: it estimates no places and no amounts.
NOT_ASKED = ("centre", "amount", "best candidate right, the best fit's", "mechanism left out")


@dataclass(frozen=True)
class Analysis:
    """Of one case.

    Attributes
    ----------
    conditional : tuple of float
        How much each effect stands out given the others.
    draws : tuple of Diagnosis
        What the analyst would have said of residuals like those of the case.
    """

    conditional: tuple[float, ...]
    draws: tuple[Diagnosis, ...]


def read_analyses(folder: Path, labels: Mapping[str, Mapping[str, Any]]) -> dict[str, Analysis]:
    """What `analyse` wrote, by name of case; verdicts are of least expected loss by the tool's own table.

    Raises
    ------
    InputError
        If there is none of any case.
    """
    losses = known_of(FILE)["losses"]
    analyses = {}
    for name in labels:
        file = folder / f"{name}.json"
        if file.exists():
            read = json.loads(file.read_text(encoding="ascii"))
            draws = tuple(_diagnosis(draw, losses) for draw in read["draws"])
            analyses[name] = Analysis(tuple(read["conditional"]), draws)
    if not analyses:
        raise InputError(f"{folder}: no analysis of any case")
    return analyses


def with_conditionals(label: Mapping[str, Any], analysis: Analysis | None) -> Mapping[str, Any]:
    """A label of an earlier run with what it does not tell of each of two effects."""
    if analysis is None or all("conditional" in effect for effect in label["effects"]):
        return label
    each = zip(label["effects"], analysis.conditional, strict=True)
    return {**label, "effects": [{**effect, "conditional": d} for effect, d in each]}


def analysts(outcome: Outcome, analyses: Mapping[str, Analysis]) -> Iterator[Outcome]:
    """Outcomes of a case if the analyst had spoken."""
    if outcome.name in analyses and outcome.kind != "left out":
        for said in analyses[outcome.name].draws:
            yield replace(outcome, said=said)


def rightness(outcome: Outcome, analyses: Mapping[str, Analysis]) -> float | None:
    """How often the analyst's best set is the true one; None if it was not asked."""
    tops = [true_of(o, o.said.hypotheses[0]) for o in analysts(outcome, analyses)]
    return float(np.mean(tops)) if tops else None


def _diagnosis(draw: Mapping[str, Any], losses: Mapping[str, float]) -> Diagnosis:
    posterior: Posterior = {frozenset(causes): p for causes, p in draw["sets"]}
    said = decide(posterior, losses)
    group = said.causes if said.verdict == "group" else ()
    ranking = tuple(
        Ranked(" + ".join(causes), p, None, 0.0, not {UNKNOWN, NOT_PHYSICS} & set(causes))
        for causes, p in draw["sets"]
        if causes
    )
    return Diagnosis(
        verdict=said.verdict,
        p_value=float(draw["p_value"]),
        names=() if group else said.causes,
        probability=said.probability,
        group=group,
        ranking=ranking,
        parameters={},
        centre=None,
        heldout={},
        hypotheses=tuple(Tried(frozenset(causes), float(np.log(p)), p) for causes, p in draw["sets"]),
    )
