"""A diagnosis as JSON: the contract of `diagnosis.json`, docs/diagnosis.md."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from warpbrain.diagnosis.held_out import distance
from warpbrain.diagnosis.onset import Onset
from warpbrain.diagnosis.options import DiagnosisOptions
from warpbrain.diagnosis.result import Diagnosis, Ranked
from warpbrain.diagnosis.sentences import confusion_sentences, effect_sentence, sentence_of_kind
from warpbrain.diagnosis.traits import Traits
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import smallest_in_words
from warpbrain.report.diagnosis.common import describe_cause, describe_common, describe_decision, describe_values


def describe_diagnosis(found: Diagnosis, options: DiagnosisOptions, device: str) -> dict[str, Any]:
    """Everything that is known of a diagnosis, lengths in metres and other units beside the values."""
    best = found.named[0] if found.named else None
    particular = {
        "hypotheses": [asdict(one) | {"kinds": [kind.value for kind in one.kinds]} for one in found.combinations],
        "by_posterior": describe_decision(found.by_posterior),
        "where": _where(found, best),
        "mechanisms": [_named(one, found.case.gravity_axis) for one in found.named],
        "unknown": _unknown(found.unknown),
        "when": _when(found.when),
        "ranking": [_ranked(ranked, found.case.gravity_axis) for ranked in found.ranking]
        + [_rejected(kind, why) for kind, why in found.rejected.items()],
        "smallest_detectable": {
            kind: {
                "size": one.size,
                "unit": one.unit,
                "parameter": one.name,
                "named_from": one.named,
                "says": smallest_in_words(kind, one),
            }
            for kind, one in found.smallest.items()
        },
        "confusion": {"says": list(confusion_sentences(found.confusion)), "rows": found.confusion.rows},
        "fit": _fit(found),
        "map": {
            "threshold": found.map.threshold,
            "largest": float(found.map.scores.max()),
            "patch_m": found.map.length,
            "blind_above_n": found.map.blind_above,
            "places": len(found.map.sites),
            "significant": found.map.significant,
        },
        "equilibria": found.base.states.solves,
    }
    asked = {name: value for name, value in asdict(options).items() if name != "ends"}
    names = [one.kind for one in found.named]
    return describe_common(found, found.sentence, names, asked, device, particular)


def _named(one: Ranked, gravity_axis: tuple[float, float, float] | None) -> dict[str, Any]:
    return {
        "mechanism": one.kind,
        "says": effect_sentence(one, gravity_axis),
        "probability": one.probability,
        "parameters": describe_values(one.values),
        "where": _ball(one),
        "region": one.region,
    }


def _unknown(traits: Traits | None) -> dict[str, Any] | None:
    if traits is None:
        return None
    return {
        "net_force_n": traits.force,
        "net_force_sd_n": traits.force_sd,
        "net_moment_nm": traits.moment,
        "net_moment_sd_nm": traits.moment_sd,
        "from_outside": traits.outside,
        "net_force_hidden": traits.hidden,
        "turning": traits.turning,
        "surface_over_depth_nats": traits.surface_nats,
        "centre_m": traits.centre,
    }


def _where(found: Diagnosis, best: Ranked | None) -> dict[str, Any] | None:
    place = best if best is not None and best.centre is not None else found.map if found.map.significant else None
    if place is None:
        return None
    return {
        "centre_m": place.centre,
        "radius_m": place.radius,
        "region": best.region if best is not None else "",
        "local_p": found.map.local_p,
        "global_p": found.map.global_p,
    }


def _when(onset: Onset | None) -> dict[str, Any] | None:
    if onset is None:
        return None
    return {
        "seconds": [onset.first, onset.last],
        "probability": onset.probability,
        "course": onset.course,
        "intervals": [{"seconds": [a, b], "probability": p} for a, b, p in onset.intervals],
        "sizes": None if onset.sizes is None else asdict(onset.sizes),
    }


def _ranked(ranked: Ranked, gravity_axis: tuple[float, float, float] | None) -> dict[str, Any]:
    return describe_cause(
        ranked.kind,
        ranked.rejected_because,
        says=effect_sentence(ranked, gravity_axis),
        physics=ranked.physics,
        log_evidence=ranked.log_evidence,
        probability=ranked.probability,
        heldout_rmse_change=ranked.heldout_rmse_change,
        detectability=ranked.detectability,
        estimate=describe_values(ranked.values),
        where=_ball(ranked),
        region=ranked.region,
    )


def _rejected(kind: str, why: str) -> dict[str, Any]:
    physics = kind in mechanisms()
    return describe_cause(kind, why, says=sentence_of_kind(kind), physics=physics, heldout_rmse_change=None, where=None)


def _ball(ranked: Ranked) -> dict[str, Any] | None:
    return None if ranked.centre is None else {"centre_m": ranked.centre, "radius_m": ranked.radius}


def _fit(found: Diagnosis) -> dict[str, Any]:
    fit, noise, sensors = found.fit, found.base.noise, found.base.at.sensors
    rows = {"declared": fit.declared, "refitted": fit.refitted, "explained": fit.explained}
    check = dict(zip(rows, fit.check, strict=False)) if fit.check else None
    improvement = fit.improvement
    return {
        "rmse_m": {name: None if pair is None else pair[0] for name, pair in rows.items()},
        "heldout_rmse_m": {name: None if pair is None else pair[1] for name, pair in rows.items()},
        "check_rmse_m": check,
        "ceiling_heldout_rmse_m": fit.ceiling,
        "noise_m": float(noise[sensors.is_displacement].mean()) if sensors.is_displacement.any() else None,
        "noise_rmse_m": distance(sensors, noise) if sensors.is_displacement.any() else None,
        "improvement": None
        if improvement is None
        else {"part": improvement[0], "interval_95": [improvement[1], improvement[2]]},
        "placebo_p": fit.placebo_p,
        "placebo_heldout_rmse_m": None if fit.placebo is None else list(fit.placebo),
        "confirmations": [
            {"mechanism" if key == "name" else key: value for key, value in asdict(one).items()}
            for one in found.confirmations
        ],
    }
