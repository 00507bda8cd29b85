"""Labels and diagnoses written by hand."""

import json

from referee.diagnoses import read_diagnosis
from referee.labels import seal
from referee.outcomes import Outcome
from referee.sealed import write_commitments


def label(case, kind="none", names=(), d=0.0, **effect):
    """What is true of a case."""
    unknown = {
        "where_m": None,
        "also": [],
        "amount": None,
        "parameter": "",
        "size": 1.0,
        "detectability": d,
        "conditional": d,
    }
    first = {"kind": names[0], **unknown} if names else {}
    return {
        "case": case,
        "kind": kind,
        "names": list(names),
        "effects": [{**first, **effect}] if names and kind != "trap" else [],
        "detectability": d,
        "rms_effect_m": 1e-3,
        "check_noise_m": 3e-4,
        "attempts": [],
    }


def diagnosis(verdict="nothing missing", mechanism=None, probability=None, **more):
    """What the tool says."""
    return {
        "verdict": verdict,
        "sentence": "",
        "p_value": 0.5,
        "mechanism": mechanism,
        "probability": probability,
        "parameters": {},
        "where": None,
        "ranking": [{"mechanism": mechanism or "none", "probability": probability or 1.0, "detectability": 4.0}],
        "group": [],
        "fit": {},
        **more,
    }


def outcome(folder, true, said):
    """The two together."""
    file = folder / true["case"] / "diagnosis.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(said))
    return Outcome(true["case"], true, read_diagnosis(file))


def sealed_labels(folder, *labels):
    """Seal labels, and list their hashes."""
    for true in labels:
        seal(folder, true)
    write_commitments(folder)
