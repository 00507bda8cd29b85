"""Two results side by side: inputs, distance from the recordings, displacement, tissue, verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.recordings.location import locate
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.saved_result import Quantity, SavedResult
from warpbrain.report.state_files import SavedState

#: Of two meshes in the same place: how far apart nodes may be in parts of the mesh's size, by rounding in files.
_SAME = 1e-6


@dataclass(frozen=True)
class Difference:
    """How far the displacement of the second result is from that of the first, in the first's body.

    Attributes
    ----------
    root_mean_square_mm, largest_mm : float
        Over the nodes that are in both bodies; the root mean square by the volume that belongs to each.
    at_mm : tuple of float
        Where it is largest, RAS.
    first_mm, second_mm : float
        Root mean square of either displacement there.
    nodes, outside : int
        How many are compared, and how many are not in the second body.
    same_mesh : bool
    """

    root_mean_square_mm: float
    largest_mm: float
    at_mm: tuple[float, float, float]
    first_mm: float
    second_mm: float
    nodes: int
    outside: int
    same_mesh: bool


def difference(first: SavedState, second: SavedState) -> Difference:
    """Compare two deformed bodies.

    Raises
    ------
    InputError
        If they are nowhere in one place.
    """
    mesh, other = first.mesh, second.mesh
    size = float(np.ptp(mesh.points, axis=0).max())
    same = mesh.tetrahedra.shape == other.tetrahedra.shape and np.array_equal(mesh.tetrahedra, other.tetrahedra)
    same = same and mesh.points.shape == other.points.shape
    same = same and bool(np.abs(mesh.points - other.points).max() <= _SAME * size)
    if same:
        there, inside = second.u, np.ones(len(mesh.points), dtype=bool)
    else:
        location = locate(other.points, other.tetrahedra, mesh.points)
        inside = location.distance <= _SAME * size
        there = location.interpolate(second.u)
    if not inside.any():
        raise InputError(f"{first.path} and {second.path}: the bodies are nowhere in one place")
    apart = np.linalg.norm(there - first.u, axis=1)
    worst = int(np.flatnonzero(inside)[apart[inside].argmax()])
    weights = mesh.node_volumes * inside
    x, y, z = (MILLIMETRES * mesh.points[worst]).tolist()
    return Difference(
        _mean_square(apart, weights),
        MILLIMETRES * float(apart[worst]),
        (x, y, z),
        _mean_square(np.linalg.norm(first.u, axis=1), weights),
        _mean_square(np.linalg.norm(there, axis=1), weights),
        int(np.count_nonzero(inside)),
        int(np.count_nonzero(~inside)),
        same,
    )


def _mean_square(lengths: Floats, weights: Floats) -> float:
    """Root mean square [mm] of lengths [m]."""
    return MILLIMETRES * float(np.sqrt((weights * lengths**2).sum() / weights.sum()))


def describe_two(first: SavedResult, second: SavedResult) -> dict[str, Any]:
    """Everything that is compared, as plain values; RMSE are of the simulation alone, but those "moved back"."""
    one, two = first.inputs(), second.inputs()
    names = [*one, *(name for name in two if name not in one)]
    bodies = first.state is not None and second.state is not None
    return {
        "folders": [str(first.folder), str(second.folder)],
        "inputs_that_differ": {n: [one.get(n), two.get(n)] for n in names if one.get(n) != two.get(n)},
        "rmse": _pairs(first.errors(), second.errors()),
        "displacement": asdict(difference(first.state, second.state)) if bodies else None,  # type: ignore[arg-type]
        "tissue": _pairs(first.tissue(), second.tissue()),
        "verdict": [first.verdict()[0] or None, second.verdict()[0] or None],
        "sentence": [first.verdict()[1] or None, second.verdict()[1] or None],
    }


def _pairs(one: dict[str, Quantity], two: dict[str, Quantity]) -> dict[str, Any]:
    pairs = {}
    for name in [*one, *(name for name in two if name not in one)]:
        both = [one.get(name), two.get(name)]
        pairs[name] = {
            "unit": next(each.unit for each in both if each is not None),
            "values": [None if each is None else each.value for each in both],
            "intervals_95": [None if each is None else each.interval for each in both],
        }
    return pairs


def two_lines(said: dict[str, Any]) -> list[str]:
    """What is printed."""
    lines = [f"A  {said['folders'][0]}", f"B  {said['folders'][1]}", ""]
    differ = said["inputs_that_differ"]
    if differ:
        lines.append("inputs that differ")
        for name, (a, b) in differ.items():
            lines += [
                f"  {name}",
                f"    A  {a if a is not None else 'not said'}",
                f"    B  {b if b is not None else 'not said'}",
            ]
    else:
        lines.append("inputs that differ: none")
    if said["rmse"]:
        lines += ["", f"{'RMSE at recordings':<44}{'A':>22}{'B':>22}", *_table(said["rmse"])]
    apart = said["displacement"]
    if apart is not None:
        at = ", ".join(f"{x:.0f}" for x in apart["at_mm"])
        body = "on the same mesh" if apart["same_mesh"] else f"at {apart['nodes']} nodes of A that are in B"
        lines += [
            "",
            f"displacement, {body}",
            f"  B minus A   RMS {apart['root_mean_square_mm']:.4g} mm, at most {apart['largest_mm']:.4g} mm "
            f"at ({at}) mm",
            f"  alone       RMS A {apart['first_mm']:.4g} mm, B {apart['second_mm']:.4g} mm",
        ]
        if apart["outside"]:
            lines.append(f"  {apart['outside']} nodes of A are outside of B and not compared")
    if said["tissue"]:
        lines += ["", f"{'tissue (95 % interval)':<44}{'A':>22}{'B':>22}", *_table(said["tissue"])]
    if any(said["verdict"]):
        lines += ["", "verdict"]
        for letter, verdict, sentence in zip("AB", said["verdict"], said["sentence"], strict=True):
            lines.append(f"  {letter}  {'none: no diagnosis' if verdict is None else f'{verdict}: {sentence}'}")
    return lines


def _table(pairs: dict[str, Any]) -> list[str]:
    rows = []
    for name, pair in pairs.items():
        cells = []
        for value, interval in zip(pair["values"], pair["intervals_95"], strict=True):
            cell = "-" if value is None else f"{value:.4g}"
            cells.append(cell if interval is None else f"{cell} ({interval[0]:.4g} to {interval[1]:.4g})")
        rows.append(f"  {name:<42}{cells[0]:>22}{cells[1]:>22} {pair['unit']}".rstrip())
    return rows
