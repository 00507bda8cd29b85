"""How much what acts stands out for the tool: the true change of all that was recorded, by the tool's covariance."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from referee.detectability import conditional
from referee.errors import InputError
from referee.runs import SEEN, read_seen

Floats = NDArray[np.float64]

#: What the tool writes of a case.
POINTS, COVARIANCE = "points.csv", "covariance.npz"
#: Of each recording the key of the label, how many numbers tell of a vector of it, and its factor to mm or N.
_RECORDED = {
    "points": ("clean_effect_m", 3, 1000.0),
    "ventricle wall": ("clean_effect_on_wall_m", 1, 1000.0),
    "force": ("clean_effect_n", 3, 1.0),
}


def write_seen(labels: Mapping[str, Mapping[str, Any]], diagnoses: Path) -> dict[str, list[float]]:
    """Write `d` of every case with effects and a diagnosis, by name of case: of all, then of each of several given the
    others.

    What is known stays: covariances are large, and of no use once `d` is known.
    """
    known = read_seen(diagnoses) | {
        name: stands_out(label, diagnoses / name)
        for name, label in labels.items()
        if label["effects"] and (diagnoses / name / COVARIANCE).exists()
    }
    (diagnoses / SEEN).write_text(json.dumps(known, indent=1) + "\n", encoding="ascii")
    return known


def stands_out(label: Mapping[str, Any], folder: Path) -> list[float]:
    """`sqrt(D^T S^-1 D)` with the true change `D` of what was recorded and the tool's `S` of noise and nuisances.

    Then that of each effect whose change the label tells apart, where the sizes of the others are not known.

    Raises
    ------
    InputError
        If what the tool says was recorded is not what was made.
    """
    with (folder / POINTS).open(encoding="utf-8", newline="") as stream:
        names = np.array([row["recording"] for row in csv.DictReader(stream)])
    with np.load(folder / COVARIANCE) as known:
        covariance, directions = known["covariance"].astype(np.float64), known["direction"]

    def rows(true: Mapping[str, Any]) -> Floats:
        change = np.zeros(len(names))
        for name in dict.fromkeys(names.tolist()):
            own = names == name
            moved = _change(true, name)
            if len(moved) != np.count_nonzero(own):
                raise InputError(
                    f"{folder / POINTS}: {np.count_nonzero(own)} numbers of '{name}', {len(moved)} were made"
                )
            # a force is told by its components, one row each
            along = directions[own] if directions[own].any() else np.tile(np.eye(3), (len(moved) // 3, 1))
            change[own] = np.einsum("ki,ki->k", along, moved)
        return change

    precision = np.linalg.inv(covariance)
    whole = rows(label)
    each = [rows(effect) for effect in label["effects"] if "clean_effect_m" in effect]
    given = [conditional(own, np.delete(each, k, axis=0), precision) for k, own in enumerate(each)]
    return [float(np.sqrt(whole @ precision @ whole)), *given]


def _change(label: Mapping[str, Any], name: str) -> Floats:
    """What the effects change (n, 3) at each number of a recording [mm] or [N], in the order that it was written."""
    key, times, factor = _RECORDED[name]
    return np.repeat(factor * np.array(label[key]).reshape(-1, 3), times, axis=0)
