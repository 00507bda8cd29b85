"""What is said of the error of the mesh: how large it is likely to be, where, and what of it locks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.physics.words import tabled
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES
from warpbrain.simulation.mesh_error import MeshError
from warpbrain.simulation.observation import Observed


def describe_mesh_error(error: MeshError, elements: str, observed: Observed, without: Observed) -> dict[str, Any]:
    """The estimate with units.

    Parameters
    ----------
    error : MeshError
    elements : str
        Of the run.
    observed, without : Observed
        Recordings beside the state, and beside the state with the estimated error taken off.
    """
    return {
        "how": _how(error, elements),
        "displacement_mm": _sizes(error.u, MILLIMETRES),
        "locking_mm": _sizes(error.locking, MILLIMETRES) if elements == "tet4" else None,
        "element_size_mm": None if error.size is None else _sizes(error.size, MILLIMETRES),
        "locking_share": error.locking_share if elements == "tet4" and error.size is not None else None,
        "recordings": [
            {
                "name": here.name,
                "unit": SHOWN[here.unit][1],
                **_sizes(np.nan_to_num(there.residuals_after - here.residuals_after), SHOWN[here.unit][0]),
                "root_mean_square_after": SHOWN[here.unit][0] * here.after.root_mean_square,
                "root_mean_square_without_it": SHOWN[here.unit][0] * there.after.root_mean_square,
            }
            for here, there in zip(observed.comparisons, without.comparisons, strict=True)
        ],
    }


def _how(error: MeshError, elements: str) -> str:
    ways = []
    if elements == "tet4":
        ways.append("elements of averaged gradients on the same mesh, which lock less")
    if error.size is not None:
        ways.append("such elements of half the size, whose difference is taken for three quarters of what is left")
    return f"compared with {' and '.join(ways)}"


def _sizes(vectors: Floats, factor: float) -> dict[str, float]:
    lengths = factor * np.linalg.norm(vectors, axis=1)
    return {
        "median": float(np.median(lengths)),
        "percentile_95": float(np.percentile(lengths, 95.0)),
        "largest": float(lengths.max()),
    }


def mesh_error_lines(said: Mapping[str, Any]) -> list[str]:
    """The estimate, as printed."""
    if "unknown" in said:
        return [f"error of the mesh: not known: {said['unknown']}"]
    lines = ["error of the mesh, estimated  median     95 %      max"]
    for title, key in (
        ("all nodes", "displacement_mm"),
        ("locking", "locking_mm"),
        ("element size", "element_size_mm"),
    ):
        if said[key] is not None:
            lines.append(f"  {title:<24} {_row(said[key])} mm")
    for entry in said["recordings"]:
        lines.append(
            f"  {entry['name']:<24} {_row(entry)} {entry['unit']}; RMSE {tabled(entry['root_mean_square_after'])}, "
            f"without it {tabled(entry['root_mean_square_without_it'])}"
        )
    share = said["locking_share"]
    if share is not None and share > 1.0:
        lines.append(
            "  elements that do not lock move too far on this mesh: all of it may be locking, but not what they say"
        )
    elif share is not None:
        lines.append(f"  {100.0 * share:.0f} % of it is likely to be locking, the rest the size of elements")
    return [*lines, f"  {said['how']}"]


def _row(sizes: Mapping[str, float]) -> str:
    return f"{tabled(sizes['median']):>8} {tabled(sizes['percentile_95']):>8} {tabled(sizes['largest']):>8}"
