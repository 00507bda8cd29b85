"""What `warpbrain diagnose` says of the 15 patients of RESECT before resection, beside a least-squares rigid motion.

    python -m bench.real.resect [NAME ...]     # writes bench/results/real_resect.json, and goes on; then the table

What these landmarks show is an error of registration (docs/proof-recordings.md): a name, or the unknown, is false.
"""

from __future__ import annotations

import json
import platform
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench.real.tables import landmarks
from warpbrain.atomic import whole_file
from warpbrain.cases.shipped import RESECT, find_case
from warpbrain.diagnosis.checking import HeldOut
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.estimation.registration import moved_back, registration_of
from warpbrain.inference.predict import predict
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.recordings.recording import PointsRecording
from warpbrain.worlds.body.effects import width_of
from warpbrain.worlds.body.weighted_set import WeightedSet

Floats = NDArray[np.float64]

FILE = Path(__file__).resolve().parents[1] / "results" / "real_resect.json"


def rigid(points: Floats, moved: Floats) -> tuple[Rotation, Floats, Floats]:
    """The least-squares rigid motion `x -> R (x - a) + b` of points (n, 3) to others (Kabsch, by SciPy)."""
    a, b = points.mean(axis=0), moved.mean(axis=0)
    return Rotation.align_vectors(moved - b, points - a)[0], a, b


def left_out_by_rigid(points: Floats, moved: Floats) -> Floats:
    """Distance (n,) [m] of each landmark to where a rigid motion of all others takes it."""
    errors = []
    for k in range(len(points)):
        others = np.arange(len(points)) != k
        R, a, b = rigid(points[others], moved[others])
        errors.append(float(np.linalg.norm(R.apply(points[k] - a) + b - moved[k])))
    return np.array(errors)


def most_probable(found: Diagnosis) -> WeightedSet:
    """The most probable set of causes."""
    return found.search.weighted_sets[int(np.argmax(found.search.probabilities))]


def rigid_of(found: Diagnosis, best: WeightedSet, points: Floats) -> Floats:
    """Where the rigid part of a set of causes takes points (n, 3).

    Recordings were realigned by a finite motion; what its coordinates are beyond that is linear about it, and so are
    those of a registration that is far wrong.
    """
    base = found.base
    nuisances, centre, motion = base.nuisances, base.states.centre, base.states.motion
    part = nuisances.part("registration")
    deviations = registration_of(found.case).deviations
    rest = (best.coordinates[part] - base.states.motion_coordinates) * deviations
    if "registration" in best.names:
        # columns of what is no mechanism stand between those of nuisances and effects
        linear = slice(nuisances.columns.shape[1], best.columns.shape[1] - width_of(best.effects))
        rows = base.at.sensors.is_displacement
        wrong = best.columns[rows, linear] @ best.coordinates[linear]
        rest = rest + np.linalg.lstsq(base.at.sensors.rigid[rows], wrong, rcond=None)[0]
    # the inverse of what takes a recording back, about the centre of what was recorded
    there = Rotation.from_rotvec(motion[3:]).apply(points - centre) + centre + motion[:3]
    assert np.allclose(moved_back(there, motion, centre), points)
    return np.asarray(there + rest[:3] + np.cross(rest[3:], points - centre))


def diagnosed(name: str) -> dict[str, Any]:
    """Of one case."""
    case = find_case(name, "multi")
    [recording] = case.recordings
    assert isinstance(recording, PointsRecording)
    points, moved = recording.points, recording.points + recording.displacement
    R, a, b = rigid(points, moved)
    exact = R.apply(points - a) + b
    began, worked = time.perf_counter(), time.process_time()
    found = Diagnosing(case, device="cpu").run()
    best = most_probable(found)
    left_out = HeldOut(found.base.at.sensors, local=True)
    # a landmark is a block: each from all others
    assert np.array_equal(np.unique(left_out.blocks), np.arange(len(points)))
    prediction = predict(best.marginal.model, best.residual, left_out.blocks)
    squared = np.bincount(left_out.blocks, weights=prediction.errors**2)
    by_rigid = left_out_by_rigid(points, moved)
    worse = 1e6 * (squared - by_rigid**2)
    return {
        "case": name,
        "title": case.title,
        "landmarks": len(points),
        "verdict": found.verdict,
        "causes": list(found.decision.causes),
        "group": list(found.group),
        "p_value": found.p_value,
        "sentence": found.sentence,
        "sets": [{"causes": list(one.causes), "probability": one.probability} for one in found.combinations[:4]],
        "as_recorded_mm": 1e3 * root_mean_square(np.linalg.norm(moved - points, axis=1)),
        "rigid_shift_mm": 1e3 * float(np.linalg.norm(b - a)),
        "rigid_turn_degrees": float(np.degrees(R.magnitude())),
        "rigid_left_mm": 1e3 * root_mean_square(np.linalg.norm(exact - moved, axis=1)),
        "rigid_left_out_mm": 1e3 * root_mean_square(by_rigid),
        "left_out_mm": 1e3 * left_out.error(prediction),
        "left_out_worse_mm2": float(worse.mean()),
        "left_out_worse_sd_mm2": float(worse.std(ddof=1) / np.sqrt(len(worse))),
        "left_out_of_nothing_mm": 1e3 * found.fit.refitted[1],
        "rigid_apart_mm": 1e3 * root_mean_square(np.linalg.norm(rigid_of(found, best, points) - exact, axis=1)),
        "smallest": {kind: [one.size, one.unit, one.name] for kind, one in found.smallest.items()},
        "seconds": time.perf_counter() - began,
        "processor_seconds": time.process_time() - worked,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "machine": platform.processor() or platform.machine(),
    }


def main() -> None:
    """All that are asked for and not there yet."""
    done = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else []
    for name in sys.argv[1:] or RESECT:
        if any(one["case"] == name for one in done):
            continue
        done.append(diagnosed(name))
        print(landmarks(done[-1:])[-1], flush=True)
        with whole_file(FILE) as temporary:
            temporary.write_text(json.dumps(done, indent=1) + "\n", encoding="utf-8")
    print(*landmarks(done), sep="\n")


if __name__ == "__main__":
    main()
