"""An ensemble: what it prints, its JSON, one table of all samples, its fields on the mesh, and their picture."""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file, write_csv
from warpbrain.ensemble.results import EnsembleResult, Fields, Spread
from warpbrain.report import views
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES, body_file, sets_of
from warpbrain.report.page import lines
from warpbrain.report.summary import SET_TITLES, sizes_mm

#: Failures that are printed; all are in the table.
_SHOWN_FAILURES = 3


def describe_ensemble(result: EnsembleResult) -> dict[str, Any]:
    """Counts, failures, and the spread of displacements and errors over the samples, with units."""
    errors = {}
    for comparison in result.done[0].comparisons if result.done else ():
        factor, unit = SHOWN[comparison.unit]
        errors[comparison.name] = {
            "unit": unit,
            "before": factor * comparison.before.root_mean_square,
            "after": _numbers(result.errors[comparison.name], factor),
            "nearest_sample": result.nearest(comparison.name).outcome.number,
        }
    return {
        "samples": len(result.rows),
        "done": len(result.done),
        "failed": {str(row.outcome.number): row.outcome.reason for row in result.failed},
        "percentiles_over_samples": len(result.done),
        "time_steps": sum(row.outcome.steps for row in result.rows),
        "cg_iterations": sum(row.outcome.cg_iterations for row in result.rows),
        "mean_displacement_mm": {name: _numbers(s, MILLIMETRES) for name, s in result.displacement.items()},
        "rmse_at_recordings": errors,
        "not_compared": list(result.not_compared),
    }


def _numbers(spread: Spread, factor: float) -> dict[str, float]:
    levels = {f"p{level:02d}": factor * float(value) for level, value in spread.percentiles.items()}
    return {"mean": factor * float(spread.mean), "sd": factor * float(spread.sd), **levels}


def ensemble_lines(described: Mapping[str, Any]) -> list[str]:
    """What is printed at the end."""
    return lines("ensemble.txt", "ensemble", described, SET_TITLES, _SHOWN_FAILURES)


def table_of(result: EnsembleResult) -> list[dict[str, Any]]:
    """A row for each sample, all with the same columns; None where there is nothing to say. Units are in the names."""
    rows = []
    for row in result.rows:
        outcome, sample = row.outcome, row.sample
        status = "failed" if outcome.failed else "done"
        cells: dict[str, Any] = {"sample": outcome.number, "status": status, "reason": outcome.reason}
        rows.append(cells)
        cells |= {f"tissue_{label}_deviations": deviation for label, deviation in sample.deviations.items()}
        for label, material in sorted((sample.materials or {}).items()):
            cells[f"tissue_{label}_law"] = material.law.name
            cells[f"tissue_{label}_shear_modulus_Pa"] = material.law.shear_modulus
            for name, value in vars(material.law).items():
                # exponents have no unit
                unit = "" if name == "alpha" else "_Pa"
                values = value if isinstance(value, tuple) else (value,)
                for term, number in enumerate(values, 1):
                    cells[f"tissue_{label}_{name}{f'_{term}' if len(values) > 1 else ''}{unit}"] = number
        cells |= {"steps": outcome.steps, "cg_iterations": outcome.cg_iterations, "time_s": outcome.time}
        if outcome.failed:
            continue
        cells |= {"out_of_balance": outcome.residual, "smallest_J": outcome.min_J}
        for name, s in row.displacement.items():
            place = name.replace(" ", "_")
            cells |= {f"displacement_{place}_{key}_mm": size for key, size in sizes_mm(s).items()}
        for comparison in row.comparisons:
            factor, unit = SHOWN[comparison.unit]
            cells[f"rmse_{comparison.name}_before_{unit}"] = factor * comparison.before.root_mean_square
            cells[f"rmse_{comparison.name}_after_{unit}"] = factor * comparison.after.root_mean_square
    columns = dict.fromkeys(name for cells in rows for name in cells)
    return [{name: cells.get(name) for name in columns} for cells in rows]


def write_table(folder: Path, rows: list[dict[str, Any]]) -> list[str]:
    """Write `samples.csv`, and `samples.parquet` where pyarrow is installed; returns the names of the files."""
    write_csv(folder / "samples.csv", [list(rows[0]), *(list(row.values()) for row in rows)])
    if find_spec("pyarrow") is None:
        return ["samples.csv"]
    import pyarrow
    import pyarrow.parquet

    with whole_file(folder / "samples.parquet") as scratch:
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), scratch)
    return ["samples.csv", "samples.parquet"]


def file_of_fields(fields: Fields) -> Any:
    """The fields as a `meshio.Mesh`, coordinates and displacement in mm.

    Point arrays: ``displacement_mean``, ``displacement_sd`` and ``displacement_pNN``, of each component; ``size_mean``
    and so on, of the displacement's size; and the node sets. Cell array: ``tissue``.
    """
    arrays = sets_of(fields.mesh.node_sets)
    for name, spread in (("displacement", fields.components), ("size", fields.size)):
        percentiles = {f"p{level:02d}": values for level, values in spread.percentiles.items()}
        for key, values in {"mean": spread.mean, "sd": spread.sd, **percentiles}.items():
            arrays[f"{name}_{key}"] = MILLIMETRES * values
    return body_file(fields.mesh, arrays)


def write_spread_picture(path: Path, fields: Fields, title: str, subtitle: str) -> None:
    """Draw the median of the displacement's size, and its standard deviation as `displacement_sd.nii.gz` has it.

    Three cuts of the anatomy at rest, as PNG.
    """
    mesh = fields.mesh
    figure, axes = views.panels(2, 3, (13.5, 9.4))
    deviation = np.linalg.norm(fields.components.sd, axis=1)
    places = views.places(mesh)
    for row, name, metres in ((0, "median", fields.size.percentiles[50]), (3, "standard deviation", deviation)):
        values, drawn = MILLIMETRES * metres, None
        top = max(float(np.percentile(values, 99.5)), 1e-6)
        for panel, view, place in zip(axes[row : row + 3], views.VIEWS, places, strict=True):
            drawn = views.draw_values(panel, mesh, values, view, place, top)
            if row == 0:
                panel.set_title(views.heading(mesh, view, place), fontsize=11)
        axes[row].set_ylabel(name, fontsize=13)
        label = f"{name} of the displacement [mm]"
        figure.colorbar(drawn, ax=axes[row : row + 3], location="right", shrink=0.8, aspect=30, pad=0.01, label=label)
    views.save(figure, path, f"{title}\n{subtitle}", 13.0)
