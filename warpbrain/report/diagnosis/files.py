"""The files of a diagnosis beside its JSON: the map, tables of what was recorded, and the case with what was named."""

import contextlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.atomic import UNFINISHED, whole_file, write_csv
from warpbrain.cases.case import Case
from warpbrain.cases.writing import write_case
from warpbrain.diagnosis.locating import ScoreMap
from warpbrain.diagnosis.result import EXPLAINED, REFITTED, Diagnosis
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.files import MILLIMETRES, body_file, write_body
from warpbrain.worlds.body.uncertainty import displacement_deviation
from warpbrain.worlds.specimen.result import SpecimenDiagnosis


def write_map(path: Path, diagnosis: Diagnosis) -> None:
    """Write `file_of_map`."""
    write_body(path, file_of_map(diagnosis))


def file_of_map(diagnosis: Diagnosis) -> Any:
    """Where the mismatch is, and what the data can see, as a `meshio.Mesh` with coordinates in mm.

    Point arrays: ``score`` (chi-squared of three degrees of freedom of the nearest place), ``significant`` (above the
    threshold of all places), ``region`` (cannot be told from the best place), ``detectable_force`` [mN] and
    ``blind`` (no force of the size that is seen elsewhere would be), ``displacement`` of the base state [mm].
    """
    mesh, where = diagnosis.base.at.system.model.mesh, diagnosis.map
    nearest, known = nearest_site(where, mesh), seen(where, mesh)
    return body_file(
        mesh,
        {
            "score": where.scores[nearest],
            "significant": known["significant"],
            "region": (where.region[nearest] & where.significant).astype(np.uint8),
            "detectable_force": 1000.0 * where.detectable[nearest],
            "blind": known["blind"],
            "displacement": diagnosis.base.at.u * MILLIMETRES,
        },
    )


def write_diagnosed_state(path: Path, diagnosis: Diagnosis) -> None:
    """Write the last state of a diagnosis, with all that is named, as VTU with coordinates in mm.

    Point arrays: ``displacement`` [mm], ``displacement_sd`` of its components [mm] as of `displacement_deviation`,
    where that state can be linearised, ``significant`` and ``blind`` as in `map.vtu`.
    """
    refit = diagnosis.best.refit
    state = diagnosis.base.at if refit is None else refit.state
    mesh = state.system.model.mesh
    arrays = {"displacement": MILLIMETRES * state.u, **seen(diagnosis.map, mesh)}
    # a state at the edge of what is stable has an equilibrium, and none beside it
    with contextlib.suppress(SolveError):
        arrays["displacement_sd"] = MILLIMETRES * displacement_deviation(diagnosis.best, diagnosis.base)
    write_body(path, body_file(mesh, arrays))


def seen(where: ScoreMap, mesh: TetMesh) -> dict[str, Any]:
    """What the map says at each node: whether what is left is significant, and whether recordings see no force."""
    nearest = nearest_site(where, mesh)
    return {
        "significant": (where.scores[nearest] > where.threshold).astype(np.uint8),
        "blind": (where.detectable[nearest] > where.blind_above).astype(np.uint8),
    }


def nearest_site(where: ScoreMap, mesh: TetMesh) -> Ints:
    """Index (n,) of the place of the map that is nearest to each node."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(where.sites).query(mesh.points)[1])


@dataclass(frozen=True, eq=False)
class Vectors:
    """Points (k, 3) [m] that were recorded at the last time."""

    where: Floats
    #: What was observed less what was computed (k, 3) [m], by state: of a surface the part along its normal.
    left: dict[str, Floats]
    #: Set aside as gross errors (k,).
    aside: Bools


class Recorded(dict[str, Any]):
    """Numbers that were recorded: components of points, distances to surfaces, components of forces.

    They are columns (n,) by the names that `points.csv` has for them; NaN where it has nothing.
    """

    @classmethod
    def of(cls, diagnosis: Diagnosis) -> Self:
        """Of a diagnosis, lengths in mm, forces in N, axes RAS.

        `observed` is along `direction`; `declared`, `refitted` and `explained` are what was computed of it: in the case
        as declared, with its tissue refitted beside all that is no physics, and with what is named. A held-out error is
        what was observed less what is predicted without the point and those around it.
        """
        sensors = diagnosis.base.declared.sensors
        moved, nothing = sensors.is_displacement, np.full(len(sensors), np.nan)
        factors = np.where(moved, MILLIMETRES, 1.0)
        observed = sensors.computed + sensors.residual
        computed, held = {"declared": factors * sensors.computed}, {}
        for state in (REFITTED, EXPLAINED):
            known, predicted = diagnosis.weighted_sets.get(state), diagnosis.held_out.get(state)
            computed[state] = nothing if known is None else factors * (observed - known.best_residual)
            errors = nothing if predicted is None else np.where(moved, predicted.errors, np.nan)
            held[f"heldout_error_{state}"] = factors * errors
        return cls(
            {
                "recording": np.array(sensors.names)[sensors.recordings],
                "point": sensors.groups,
                "time_s": np.where(np.isfinite(sensors.times), sensors.times, np.nan),
                "unit": np.where(moved, "mm", "N"),
                **{f"{axis}_mm": MILLIMETRES * sensors.positions[:, k] for k, axis in enumerate("xyz")},
                **{f"direction_{axis}": sensors.directions[:, k] for k, axis in enumerate("xyz")},
                "observed": factors * observed,
                **computed,
                **held,
                "set_aside": diagnosis.gross.astype(int),
            }
        )

    @property
    def states(self) -> list[str]:
        """Of which something was computed, in the order in which they are shown."""
        return [state for state in STATES if not np.isnan(self[state]).all()]

    @property
    def lengths(self) -> Bools:
        """Which rows are of displacements."""
        return np.asarray(self["unit"] == "mm")

    @property
    def counted(self) -> Bools:
        """Which of these are not set aside."""
        return self.lengths & (self["set_aside"] == 0)

    @property
    def aside(self) -> list[tuple[str, int, str]]:
        """Recording, number and place [mm] of each point that was set aside as a gross error."""
        places = [", ".join(f"{value:.1f}" for value in row) for row in self._axes("{}_mm")]
        points = zip(self["recording"].tolist(), self["point"].tolist(), places, self["set_aside"], strict=True)
        return list(dict.fromkeys(point[:3] for point in points if point[3]))

    def _axes(self, name: str) -> Floats:
        return np.column_stack([self[name.format(axis)] for axis in "xyz"])

    @property
    def vectors(self) -> Vectors:
        """The points of the last time of each recording."""
        times = np.where(np.isnan(self["time_s"]), np.inf, self["time_s"])
        ends = {name: times[self["recording"] == name].max() for name in np.unique(self["recording"])}
        rows = self.lengths & (times == [ends[name] for name in self["recording"]])
        points, first, which = np.unique(self["point"][rows], return_index=True, return_inverse=True)
        where, along = (self._axes(name)[rows] for name in ("{}_mm", "direction_{}"))
        left = {}
        for state in self.states:
            left[state] = np.zeros((len(points), 3))
            np.add.at(left[state], which, along * (self["observed"] - self[state])[rows][:, None] / MILLIMETRES)
        return Vectors(where[first] / MILLIMETRES, left, self["set_aside"][rows][first] > 0)


def write_points(path: Path, diagnosis: Diagnosis) -> None:
    """Write `Recorded`, one row for each number; what does not apply is empty."""
    _write_columns(path, Recorded.of(diagnosis), "{:.6g}")


def write_curves(path: Path, diagnosis: SpecimenDiagnosis) -> None:
    """Write one row for each that was compared; times [s] are empty where there are none, stresses are nominal [Pa]."""
    tests = diagnosis.protocol.tests
    counts = [len(test.strain) for test in tests]
    columns: dict[str, Any] = {
        "test": np.repeat([test.name for test in tests], counts),
        "mode": np.repeat([test.mode for test in tests], counts),
        "role": np.repeat(["fit" if test.fitted else "check" for test in tests], counts),
        "time_s": np.concatenate([np.full(len(t.strain), np.nan) if t.time is None else t.time for t in tests]),
        "strain": np.concatenate([test.strain for test in tests]),
        "recorded_pa": diagnosis.protocol.observed,
    }
    columns |= {f"{name.replace(' ', '_')}_pa": values for name, values in diagnosis.stresses.items()}
    _write_columns(path, columns, "{:.9g}")


def _write_columns(path: Path, columns: Mapping[str, Any], digits: str) -> None:
    texts = [
        ["" if np.isnan(x) else digits.format(x) for x in values] if values.dtype.kind == "f" else values.tolist()
        for values in columns.values()
    ]
    write_csv(path, [list(columns), *zip(*texts, strict=True)], lineterminator="\n")


def write_covariance(path: Path, diagnosis: Diagnosis) -> None:
    """Write the `covariance` (n, n) of noise and nuisances, its rows those of `points.csv` in their units, mm and N.

    With `change` (n,) what an effect changes there, of displacements along `direction` (n, 3), the effect stands out by
    `sqrt(change @ solve(covariance, change))`. Walls have other normals than in the case as declared, which
    `points.csv` tells. Gross errors are in it with the noise that was declared, and all noise is as many
    times larger as was found.
    """
    base = diagnosis.base
    sensors = base.at.sensors
    without = diagnosis.weighted_sets[REFITTED].marginal
    noise = without.scale * without.model.noise_factor
    factors = np.where(sensors.is_displacement, MILLIMETRES, 1.0)[:, None]
    parts = factors * np.column_stack([noise, base.nuisances.columns])
    # half the digits: variances are a million times the least of them, not more
    covariance = (parts @ parts.T).astype(np.float32)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, covariance=covariance, direction=sensors.directions)


def write_explained(folder: Path, case: Case) -> None:
    """Write the case with what was named; one that is there of an earlier diagnosis is replaced."""
    unfinished = folder.with_name(f"{UNFINISHED}{folder.name}")
    shutil.rmtree(unfinished, ignore_errors=True)
    write_case(unfinished, case)
    shutil.rmtree(folder, ignore_errors=True)
    unfinished.rename(folder)
