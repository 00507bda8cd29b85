"""What the diagnosis of a body and that of a specimen are described by alike, as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from warpbrain.inference.decide import Decision
from warpbrain.physics.values import Value
from warpbrain.report.fingerprints import fingerprints
from warpbrain.report.summary import machine

if TYPE_CHECKING:
    # either is loaded where it is diagnosed
    from warpbrain.diagnosis.result import Diagnosis
    from warpbrain.worlds.specimen.result import SpecimenDiagnosis


def describe_common(
    found: Diagnosis | SpecimenDiagnosis,
    sentence: str,
    names: Sequence[str],
    options: Mapping[str, Any],
    device: str,
    particular: Mapping[str, Any],
) -> dict[str, Any]:
    """Everything of a diagnosis, with what only a body or only a specimen has; names are those of mechanisms."""
    best = found.named[0] if found.named else None
    return {
        "verdict": found.verdict,
        "sentence": sentence,
        "p_value": found.p_value,
        "p_left": found.p_left,
        "mechanism": names[0] if names else None,
        "probability": best.probability if best else (found.ranking[0].probability if found.ranking else None),
        "parameters": describe_values(best.values) if best else {},
        "group": list(found.group),
        "doubts": list(found.doubts),
        **particular,
        "next_measurement": [asdict(one) for one in found.next_measurement],
        "assumptions": list(found.assumptions),
        "remarks": list(found.remarks),
        "case": {"name": found.case.name, "title": found.case.title, "origin": found.case.origin},
        "inputs_sha256": fingerprints(found.case),
        "options": {**options, "candidates": "all" if options["candidates"] is None else list(options["candidates"])},
        "seconds": dict(found.seconds),
        "device": device,
        "versions": machine(),
    }


def describe_cause(name: str, why: str = "", **known: Any) -> dict[str, Any]:
    """One row of a ranking; of a cause that was not tried, and why, nothing else is known."""
    nothing = {"mechanism": name, "physics": True, "log_evidence": None, "probability": 0.0, "detectability": None}
    return nothing | {"estimate": {}, "region": "", "rejected_because": why} | known


def describe_decision(decision: Decision) -> dict[str, Any]:
    """A verdict with its causes."""
    return {"verdict": decision.verdict, "causes": list(decision.causes)}


def describe_values(values: Sequence[Value]) -> dict[str, Any]:
    """Parameters by name."""
    return {one.name: {"value": one.value, "sd": one.sd, "unit": one.unit} for one in values}
