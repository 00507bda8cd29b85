"""A diagnosis as JSON: the contract of `diagnosis.json`, docs/diagnosis.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from warpbrain.diagnosis.held_out import distance
from warpbrain.diagnosis.result import Diagnosis, Ranked
from warpbrain.diagnosis.sentences import confusion_sentences, effect_sentence, sentence_of_kind
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import Decision
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import smallest_in_words
from warpbrain.physics.values import Smallest, Value
from warpbrain.report.files import plain
from warpbrain.report.fingerprints import fingerprints
from warpbrain.report.summary import machine
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen import result as of_specimen
from warpbrain.worlds.specimen import sentences as specimen_sentences
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: States of a case in the order in which they are shown, and their names for people.
STATES = {"declared": "as declared", "refitted": "tissue refitted", "explained": "with what is named"}


def describe(found: Diagnosis | SpecimenDiagnosis, options: DiagnosisOptions, device: str) -> dict[str, Any]:
    """Everything that is known of a diagnosis, lengths in metres, stresses in Pa, other units beside the values."""
    other = ("mesh_error", "without_nuisances") if isinstance(found, SpecimenDiagnosis) else ("ends",)
    asked = {name: value for name, value in asdict(options).items() if name not in other}
    particular = _of_specimen(found, options.alpha) if isinstance(found, SpecimenDiagnosis) else _of_body(found)
    named, first = particular["mechanisms"], next(iter((*found.named, *found.ranking)), None)
    return plain(
        {
            "verdict": found.verdict,
            "sentence": found.sentence,
            "p_value": found.p_value,
            "p_left": found.p_left,
            "mechanism": named[0]["mechanism"] if named else None,
            "probability": first and first.probability,
            "parameters": _values(found.named[0].values) if named else {},
            "group": found.group,
            "doubts": found.doubts,
            **particular,
            "next_measurement": [asdict(one) for one in found.next_measurement],
            "assumptions": found.assumptions,
            "remarks": found.remarks,
            "case": {"name": found.case.name, "title": found.case.title, "origin": found.case.origin},
            "inputs_sha256": fingerprints(found.case),
            "options": asked | {"candidates": "all" if options.candidates is None else options.candidates},
            "seconds": found.seconds,
            "device": device,
            "versions": machine(),
        }
    )


def _decision(decision: Decision) -> dict[str, Any]:
    return {"verdict": decision.verdict, "causes": decision.causes}


def _values(values: Sequence[Value]) -> dict[str, Any]:
    return {one.name: {"value": one.value, "sd": one.sd, "unit": one.unit} for one in values}


def _smallest(kind: str, one: Smallest) -> dict[str, Any]:
    return {"size": one.size, "unit": one.unit, "parameter": one.name, "says": smallest_in_words(kind, one)}


def _improvement(improvement: tuple[float, float, float] | None) -> dict[str, Any] | None:
    return None if improvement is None else {"part": improvement[0], "interval_95": improvement[1:]}


def _of_body(found: Diagnosis) -> dict[str, Any]:
    axis, where, onset, traits = found.case.gravity_axis, found.map, found.when, found.unknown
    best = found.named[0] if found.named else None
    place = best if best is not None and best.centre is not None else where if where.significant else None
    probability = {"local_p": where.local_p, "global_p": where.global_p}
    return {
        "hypotheses": [asdict(one) | {"kinds": [kind.value for kind in one.kinds]} for one in found.combinations],
        "by_posterior": _decision(found.by_posterior),
        "where": place and _ball(place) | {"region": best.region if best is not None else ""} | probability,
        "mechanisms": [
            {
                "mechanism": one.kind,
                "says": effect_sentence(one, axis),
                "probability": one.probability,
                "parameters": _values(one.values),
                "where": _place(one),
                "region": one.region,
            }
            for one in found.named
        ],
        "unknown": traits
        and {
            "net_force_n": traits.force,
            "net_force_sd_n": traits.force_sd,
            "net_moment_nm": traits.moment,
            "net_moment_sd_nm": traits.moment_sd,
            "from_outside": traits.outside,
            "net_force_hidden": traits.hidden,
            "turning": traits.turning,
            "surface_over_depth_nats": traits.surface_nats,
            "centre_m": traits.centre,
        },
        "when": onset
        and {
            "seconds": [onset.first, onset.last],
            "probability": onset.probability,
            "course": onset.course,
            "intervals": [{"seconds": [a, b], "probability": p} for a, b, p in onset.intervals],
            "sizes": None if onset.sizes is None else asdict(onset.sizes),
        },
        "ranking": [
            _cause(one.kind, one.rejected_because, says=effect_sentence(one, axis), physics=one.physics,
                   heldout_rmse_change=one.heldout_rmse_change, where=_place(one), **_numbers(one))
            for one in found.ranking
        ]
        + [
            _cause(kind, why, says=sentence_of_kind(kind), physics=kind in mechanisms(), heldout_rmse_change=None,
                   where=None)
            for kind, why in found.rejected.items()
        ],
        "smallest_detectable": {
            kind: _smallest(kind, one) | {"named_from": one.named} for kind, one in found.smallest.items()
        },
        "confusion": {"says": confusion_sentences(found.confusion), "rows": found.confusion.rows},
        "fit": _fit(found),
        "map": {
            "threshold": where.threshold,
            "largest": where.scores.max(),
            "patch_m": where.length,
            "blind_above_n": where.blind_above,
            "places": len(where.sites),
            "significant": where.significant,
        },
        "equilibria": found.base.states.solves,
    }  # fmt: skip


def _cause(name: str, why: str = "", **known: Any) -> dict[str, Any]:
    """A row of a ranking; of a cause that was not tried, and why, nothing else is known."""
    nothing = {"mechanism": name, "says": "", "physics": True, "log_evidence": None, "probability": 0.0}
    return nothing | {"detectability": None, "estimate": {}, "region": "", "rejected_because": why} | known


def _numbers(one: Ranked | of_specimen.Ranked) -> dict[str, Any]:
    return {
        "log_evidence": one.log_evidence,
        "probability": one.probability,
        "detectability": one.detectability,
        "estimate": _values(one.values),
        "region": one.region,
    }


def _place(one: Ranked) -> dict[str, Any] | None:
    return None if one.centre is None else _ball(one)


def _ball(place: Any) -> dict[str, Any]:
    return {"centre_m": place.centre, "radius_m": place.radius}


def _fit(found: Diagnosis) -> dict[str, Any]:
    fit, noise, sensors = found.fit, found.base.noise, found.base.at.sensors
    rows = {"declared": fit.declared, "refitted": fit.refitted, "explained": fit.explained}
    moved = sensors.is_displacement
    return {
        "rmse_m": {name: pair and pair[0] for name, pair in rows.items()},
        "heldout_rmse_m": {name: pair and pair[1] for name, pair in rows.items()},
        "check_rmse_m": dict(zip(rows, fit.check, strict=False)) if fit.check else None,
        "ceiling_heldout_rmse_m": fit.ceiling,
        "noise_m": noise[moved].mean() if moved.any() else None,
        "noise_rmse_m": distance(sensors, noise) if moved.any() else None,
        "improvement": _improvement(fit.improvement),
        "placebo_p": fit.placebo_p,
        "placebo_heldout_rmse_m": fit.placebo,
        "confirmations": [
            {"mechanism" if key == "name" else key: value for key, value in asdict(one).items()}
            for one in found.confirmations
        ],
    }


def _of_specimen(found: SpecimenDiagnosis, alpha: float) -> dict[str, Any]:
    where, scores = found.where, {name: found.scores.get(name) for name in STATES}
    return {
        "mechanisms": [_ranked_of_specimen(one) for one in found.named],
        "where": where
        and {"test": where.test, "mode": where.mode, "segment": where.segment, "strain": where.strain},
        "when": {"seconds": where.time} if where is not None and where.time is not None else None,
        "ranking": [_ranked_of_specimen(one) for one in found.ranking]
        + [_cause(name, why, heldout_rmse_change_pa=None) for name, why in found.rejected.items()],
        "combinations": [asdict(one) for one in found.combinations],
        "before_checks": _decision(found.by_posterior),
        "smallest_detectable": {name: _smallest(name, one) for name, one in found.smallest.items()},
        "fit": {
            "rmse_pa": {name: one and one.fitted for name, one in scores.items()},
            "heldout_rmse_pa": {name: one and one.heldout for name, one in scores.items()},
            "check_rmse_pa": {name: one and one.check for name, one in scores.items()},
            "rows": "all that were recorded",
            "held_out": "each test in turn" if found.by_test else "each quarter of the only test in turn",
            "improvement": _improvement(found.improvement),
            "confirmations": [
                {
                    "mechanism": one.name,
                    "log_evidence": one.log_evidence,
                    "heldout_log_density": one.heldout_log_density,
                    "heldout_gain": _improvement(one.gain),
                    "placebo_p": one.placebo_p,
                    "why_not": one.why_not(alpha),
                }
                for one in found.confirmations
            ],
        },
        "tests": [
            {"name": test.name, "mode": test.mode, "specimen": test.specimen, "role": "fit" if test.fitted else "check",
             "rows": len(test.strain), "largest_stress_pa": test.peak, "pa_per_unit": test.unit}
            for test in found.protocol.tests
        ],
    }  # fmt: skip


def _ranked_of_specimen(one: of_specimen.Ranked) -> dict[str, Any]:
    why = "" if math.isfinite(one.log_evidence) else "no fit with it stands"
    words = {"says": specimen_sentences.effect_sentence(one), "physics": one.kind is Kind.PHYSICS}
    return _cause(one.name, why, **words, heldout_rmse_change_pa=one.change, **_numbers(one))
