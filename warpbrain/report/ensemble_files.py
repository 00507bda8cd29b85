"""The files of an ensemble: one table of all samples, and its fields on the mesh."""

from __future__ import annotations

import csv
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.ensemble.results import EnsembleResult, Fields, Row
from warpbrain.mesh.vtu import write_vtu
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES


def table_of(result: EnsembleResult) -> list[dict[str, Any]]:
    """A row for each sample, all with the same columns; None where there is nothing to say. Units are in the names."""
    rows = [_described(row) for row in result.rows]
    columns = dict.fromkeys(name for row in rows for name in row)
    return [{name: row.get(name) for name in columns} for row in rows]


def _described(row: Row) -> dict[str, Any]:
    outcome, sample = row.outcome, row.sample
    said: dict[str, Any] = {
        "sample": outcome.number,
        "status": "failed" if outcome.failed else "done",
        "reason": outcome.reason,
    }
    for label, deviation in sample.deviations.items():
        said[f"tissue_{label}_deviations"] = deviation
    for label, material in sorted((sample.materials or {}).items()):
        said[f"tissue_{label}_law"] = material.law.name
        said[f"tissue_{label}_shear_modulus_Pa"] = material.law.shear_modulus
        for name, value in vars(material.law).items():
            # exponents have no unit
            unit = "" if name == "alpha" else "_Pa"
            values = value if isinstance(value, tuple) else (value,)
            for term, number in enumerate(values, 1):
                said[f"tissue_{label}_{name}{f'_{term}' if len(values) > 1 else ''}{unit}"] = number
    said |= {"steps": outcome.steps, "cg_iterations": outcome.cg_iterations, "time_s": outcome.time}
    if outcome.failed:
        return said
    said |= {"out_of_balance": outcome.residual, "smallest_J": outcome.min_J}
    for name, s in row.displacement.items():
        place = name.replace(" ", "_")
        said[f"displacement_{place}_mean_mm"] = MILLIMETRES * s.mean
        said[f"displacement_{place}_root_mean_square_mm"] = MILLIMETRES * s.root_mean_square
        said[f"displacement_{place}_percentile_95_mm"] = MILLIMETRES * s.percentile_95
        said[f"displacement_{place}_largest_mm"] = MILLIMETRES * s.largest
    for comparison in row.comparisons:
        factor, unit = SHOWN[comparison.unit]
        said[f"rmse_{comparison.name}_before_{unit}"] = factor * comparison.before.root_mean_square
        said[f"rmse_{comparison.name}_after_{unit}"] = factor * comparison.after.root_mean_square
    return said


def write_table(folder: Path, rows: list[dict[str, Any]]) -> list[str]:
    """Write `samples.csv`, and `samples.parquet` where pyarrow is installed; returns the names of the files."""
    with whole_file(folder / "samples.csv") as scratch, scratch.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    if find_spec("pyarrow") is None:
        return ["samples.csv"]
    import pyarrow
    import pyarrow.parquet

    with whole_file(folder / "samples.parquet") as scratch:
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), scratch)
    return ["samples.csv", "samples.parquet"]


def write_fields(path: Path, fields: Fields) -> None:
    """Write the fields as compressed VTU, coordinates and displacement in mm.

    Point arrays: ``displacement_mean``, ``displacement_sd`` and ``displacement_pNN``, of each component; ``size_mean``
    and so on, of the displacement's size; and the node sets. Cell array: ``tissue``.
    """
    with whole_file(path) as scratch:
        write_vtu(scratch, file_of_fields(fields))


def file_of_fields(fields: Fields) -> Any:
    """What `write_fields` writes, as a `meshio.Mesh`."""
    import meshio

    mesh = fields.mesh
    arrays: dict[str, Any] = {name: members.astype(np.uint8) for name, members in mesh.node_sets.items()}
    for name, spread in (("displacement", fields.components), ("size", fields.size)):
        arrays[f"{name}_mean"] = MILLIMETRES * spread.mean
        arrays[f"{name}_sd"] = MILLIMETRES * spread.sd
        for level, values in spread.percentiles.items():
            arrays[f"{name}_p{level:02d}"] = MILLIMETRES * values
    return meshio.Mesh(
        MILLIMETRES * mesh.points, [("tetra", mesh.tetrahedra)], point_data=arrays, cell_data={"tissue": [mesh.tissue]}
    )
