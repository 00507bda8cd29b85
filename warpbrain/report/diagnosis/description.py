"""A diagnosis as JSON: the contract of `diagnosis.json`, docs/diagnosis.md."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from warpbrain.diagnosis.checking import distance
from warpbrain.diagnosis.result import Diagnosis, confusion_sentences, effect_sentence, sentence_of_kind
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import smallest_in_words
from warpbrain.physics.words import Smallest, Value
from warpbrain.report.files import fingerprints, picked, plain
from warpbrain.report.summary import machine
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.result import SpecimenDiagnosis, specimen_effect_sentence
from warpbrain.worlds.verdict import Ranked

#: States of a case in the order in which they are shown, and their names for people.
STATES = {"declared": "as declared", "refitted": "tissue refitted", "explained": "with what is named"}


def describe(diagnosis: Diagnosis | SpecimenDiagnosis, options: DiagnosisOptions, device: str) -> dict[str, Any]:
    """Everything that is known of a diagnosis, lengths in metres, stresses in Pa, other units beside the values."""
    inapplicable = ("mesh_error", "without_nuisances") if isinstance(diagnosis, SpecimenDiagnosis) else ("ends",)
    chosen = {name: value for name, value in asdict(options).items() if name not in inapplicable}
    particular = (
        _of_specimen(diagnosis, options.alpha) if isinstance(diagnosis, SpecimenDiagnosis) else _of_body(diagnosis)
    )
    named, first = particular["mechanisms"], next(iter((*diagnosis.named, *diagnosis.ranking)), None)
    return plain(
        {
            "verdict": diagnosis.verdict,
            "sentence": diagnosis.sentence,
            "p_value": diagnosis.p_value,
            "p_left": diagnosis.p_left,
            "mechanism": named[0]["mechanism"] if named else None,
            "probability": first and first.probability,
            "parameters": _values(diagnosis.named[0].values) if named else {},
            "group": diagnosis.group,
            "doubts": diagnosis.doubts,
            **particular,
            "next_measurement": [asdict(measurement) for measurement in diagnosis.next_measurement],
            "assumptions": diagnosis.assumptions,
            "remarks": diagnosis.remarks,
            "case": picked(diagnosis.case, "name", "title", "origin"),
            "inputs_sha256": fingerprints(diagnosis.case),
            "options": chosen | {"candidates": "all" if options.candidates is None else options.candidates},
            "seconds": diagnosis.seconds,
            "device": device,
            "versions": machine(),
        }
    )


def _values(values: Sequence[Value]) -> dict[str, Any]:
    return {value.name: picked(value, "value", "sd", "unit") for value in values}


def _smallest(kind: str, smallest: Smallest) -> dict[str, Any]:
    return {
        "size": smallest.size,
        "unit": smallest.unit,
        "parameter": smallest.name,
        "says": smallest_in_words(kind, smallest),
    }


def _improvement(improvement: tuple[float, float, float] | None) -> dict[str, Any] | None:
    return None if improvement is None else {"part": improvement[0], "interval_95": improvement[1:]}


def _of_body(diagnosis: Diagnosis) -> dict[str, Any]:
    where, onset, best = diagnosis.map, diagnosis.when, diagnosis.named[0] if diagnosis.named else None
    place = _place(best) or (picked(where, centre_m="centre", radius_m="radius") if where.significant else None)
    ranking = [
        _cause(
            ranked.kind,
            _words(diagnosis, ranked),
            picked(ranked, "physics", "heldout_rmse_change", "rejected_because"),
            ranked,
        )
        | {"where": _place(ranked)}
        for ranked in diagnosis.ranking
    ]
    rejected = [
        _cause(kind, sentence_of_kind(kind), {"physics": kind in mechanisms(), "rejected_because": why})
        | {"where": None, "heldout_rmse_change": None}
        for kind, why in diagnosis.rejected.items()
    ]
    named = [
        {
            "mechanism": ranked.kind,
            "says": _words(diagnosis, ranked),
            "parameters": _values(ranked.values),
            "where": _place(ranked),
        }
        | picked(ranked, "probability", "region")
        for ranked in diagnosis.named
    ]
    return {
        "hypotheses": [
            asdict(combination) | {"kinds": [kind.value for kind in combination.kinds]}
            for combination in diagnosis.combinations
        ],
        "log_evidence_of_nothing": diagnosis.search.nothing.hypothesis.log_evidence,
        "by_posterior": picked(diagnosis.by_posterior, "verdict", "causes"),
        "where": place and place | {"region": best.region if best is not None else ""}
        | {"local_p": where.local_p, "global_p": where.global_p},
        "mechanisms": named,
        "unknown": diagnosis.unknown and picked(
            diagnosis.unknown, "turning", net_force_n="force", net_force_sd_n="force_sd", net_moment_nm="moment",
            net_moment_sd_nm="moment_sd", from_outside="outside", net_force_hidden="hidden",
            surface_over_depth_nats="surface_nats", centre_m="centre", resistance_in_time="resistance",
        ) | {"source": picked(
            diagnosis.unknown.source, "turns", centre_m="centre", length_m="length", of_stress="is_stress",
            net_force_n="force", net_force_sd_n="force_sd", heldout_rmse_without_m="without", heldout_rmse_m="error",
        )},
        "when": onset and {
            "seconds": [onset.first, onset.last],
            "probability": onset.probability,
            "course": onset.course,
            "intervals": [{"seconds": [a, b], "probability": p} for a, b, p in onset.intervals],
            "sizes": None if onset.sizes is None else asdict(onset.sizes),
        },
        "ranking": ranking + rejected,
        "smallest_detectable": {
            kind: _smallest(kind, smallest) | {"named_from": smallest.named}
            for kind, smallest in diagnosis.smallest.items()
        },
        "confusion": {"says": confusion_sentences(diagnosis.confusion), "rows": diagnosis.confusion.rows},
        "fit": _fit(diagnosis),
        "map": {"largest": where.scores.max(), "places": len(where.sites)}
        | picked(where, "threshold", "significant", patch_m="length", blind_above_n="blind_above"),
        "equilibria": diagnosis.base.states.solves,
    }  # fmt: skip


def _words(diagnosis: Diagnosis, ranked: Ranked) -> str:
    return effect_sentence(ranked, diagnosis.case.gravity_axis)


def _cause(name: str, words: str, known: Mapping[str, Any], ranked: Ranked | None = None) -> dict[str, Any]:
    """A row of a ranking; of a cause that was not tried there are no numbers."""
    numbers = picked(ranked, "log_evidence", "probability", "detectability", "region")
    nothing = {"log_evidence": None, "probability": 0.0, "detectability": None, "region": ""}
    estimate = {} if ranked is None else _values(ranked.values)
    return {"mechanism": name, "says": words, "estimate": estimate, **(numbers or nothing), **known}


def _place(ranked: Ranked | None) -> dict[str, Any] | None:
    return None if ranked is None or ranked.centre is None else picked(ranked, centre_m="centre", radius_m="radius")


def _fit(diagnosis: Diagnosis) -> dict[str, Any]:
    fit, noise, sensors = diagnosis.fit, diagnosis.base.noise, diagnosis.base.at.sensors
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
            {"mechanism" if key == "name" else key: value for key, value in asdict(confirmation).items()}
            for confirmation in diagnosis.confirmations
        ],
    }


def _of_specimen(diagnosis: SpecimenDiagnosis, alpha: float) -> dict[str, Any]:
    where, scores = diagnosis.where, {name: diagnosis.scores.get(name) for name in STATES}
    rejected = [
        _cause(name, "", {"physics": True, "rejected_because": why, "heldout_rmse_change_pa": None})
        for name, why in diagnosis.rejected.items()
    ]
    confirmations = [
        {
            "mechanism": confirmation.name,
            "heldout_gain": _improvement(confirmation.gain),
            "why_not": confirmation.why_not(alpha),
        }
        | picked(confirmation, "log_evidence", "heldout_log_density", "placebo_p")
        for confirmation in diagnosis.confirmations
    ]
    return {
        "mechanisms": [_ranked_of_specimen(ranked) for ranked in diagnosis.named],
        "where": picked(where, "test", "mode", "segment", "strain"),
        "when": {"seconds": where.time} if where is not None and where.time is not None else None,
        "ranking": [_ranked_of_specimen(ranked) for ranked in diagnosis.ranking] + rejected,
        "combinations": [
            picked(combination, "causes", "log_evidence", "probability", "fitted")
            for combination in diagnosis.combinations
        ],
        "before_checks": picked(diagnosis.by_posterior, "verdict", "causes"),
        "smallest_detectable": {name: _smallest(name, smallest) for name, smallest in diagnosis.smallest.items()},
        "fit": {
            "rmse_pa": {name: score and score.fitted for name, score in scores.items()},
            "heldout_rmse_pa": {name: score and score.heldout for name, score in scores.items()},
            "check_rmse_pa": {name: score and score.check for name, score in scores.items()},
            "rows": "all that were recorded",
            "held_out": "each test in turn" if diagnosis.by_test else "each quarter of the only test in turn",
            "improvement": _improvement(diagnosis.improvement),
            "confirmations": confirmations,
        },
        "tests": [
            {"role": "fit" if test.fitted else "check", "rows": len(test.strain)}
            | picked(test, "name", "mode", "specimen", largest_stress_pa="peak", pa_per_unit="unit")
            for test in diagnosis.protocol.tests
        ],
    }


def _ranked_of_specimen(ranked: Ranked) -> dict[str, Any]:
    known = picked(ranked, "physics", "rejected_because", heldout_rmse_change_pa="heldout_rmse_change")
    return _cause(ranked.kind, specimen_effect_sentence(ranked), known, ranked)
