"""Two results side by side: folders opened again, inputs, distance from recordings, displacement, tissue, verdict."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.recordings.location import locate
from warpbrain.report.files import FILES, MILLIMETRES, SavedState, read_state

#: Files that say what a result is, and the command that wrote them; an ensemble's has the same name as a run's.
_KINDS = {"diagnosis.json": "diagnose", "estimate.json": "estimate", "summary.json": "run"}
#: Keys of what is said of the case and of the solution that are outcomes, or are said elsewhere.
_NO_INPUT = ("tissues", "left_out", "title", "file", "first_step", "history", "relative_residual", "stored_energy_J")
_INPUTS = ("solution", "options", "prior", "method", "seed", "chosen", "course", "device", "workers")
#: Of two meshes in the same place: how far apart nodes may be in parts of the mesh's size, by rounding in files.
_SAME = 1e-6
#: A number of a result, its unit, and the interval (low, high) that holds it with 95 % if there is one.
Quantity = tuple[float, str, tuple[float, float] | None]


@dataclass(frozen=True, eq=False)
class SavedResult:
    """A folder of results, the command that wrote it, its JSON, and the deformed body, if there is one."""

    folder: Path
    command: str
    summary: Mapping[str, Any]
    state: SavedState | None

    def inputs(self) -> dict[str, str]:
        """What it was made from and how, as text by name."""
        summary = self.summary
        inputs = {"command": self.command}
        inputs |= {f"sha256 of {name}": digest[:16] for name, digest in (summary.get("inputs_sha256") or {}).items()}
        for part in ("case", *_INPUTS):
            value = summary.get(part)
            if isinstance(value, dict):
                value = {key: item for key, item in value.items() if key not in _NO_INPUT and "iterations" not in key}
            inputs |= dict(_flat(part, value))
        return inputs | dict(_flat("version of", summary.get("versions", {})))

    def errors(self) -> dict[str, Quantity]:
        """Root mean square differences from what was recorded, by what they are of."""
        by_name: dict[str, Quantity] = {}
        nothing = ", nothing moved"
        for entry in (self.summary.get("recordings") or {}).get("compared", []):
            for name, key in ((f"{entry['name']}{nothing}", "before"), (entry["name"], "after")):
                by_name[name] = entry[key]["root_mean_square"], entry["unit"], None
        for entry in self.summary.get("predictions", []):
            for name, key in ((nothing, "before"), ("", "of_run"), (", moved back", "after")):
                by_name[entry["name"] + name] = entry[f"root_mean_square_{key}"], entry["unit"], None
        for name, entry in ((self.summary.get("result") or {}).get("rmse_at_recordings") or {}).items():
            after = entry["after"]
            by_name[name + nothing] = entry["before"], entry["unit"], None
            by_name[name] = after["p50"], entry["unit"], (after["p05"], after["p95"])
        for kind, where in (("rmse_m", "all fitted"), ("heldout_rmse_m", "held out"), ("check_rmse_m", "check")):
            for stage, value in ((self.summary.get("fit") or {}).get(kind) or {}).items():
                if value is not None:
                    by_name[f"{where}, {stage}"] = MILLIMETRES * value, "mm", None
        return by_name

    def tissue(self) -> dict[str, Quantity]:
        """Parameters of the tissues, by tissue and name."""
        by_name: dict[str, Quantity] = {}
        for parameter in ((self.summary.get("case") or {}).get("tissues") or {}).values():
            by_name[f"{parameter['name']}, shear modulus"] = parameter["shear_modulus_Pa"], "Pa", None
        estimated = (self.summary.get("parameters") or []) if self.command == "estimate" else []
        averaged = (self.summary.get("nothing_else") or {}).get("tissue") or []
        for parameters, key, more in ((estimated, "estimate", ""), (averaged, "middle", ", over what may act")):
            for parameter in parameters:
                name, (low, high) = f"{parameter['tissue']}, {parameter['name']}{more}", parameter["interval_95"]
                by_name[name] = parameter[key], parameter["unit"], (low, high)
        return by_name


def read_result(folder: Path) -> SavedResult:
    """Open a folder of results; `InputError` if it holds none, or they cannot be read."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    name = next((name for name in _KINDS if (folder / name).is_file()), None)
    if name is None:
        raise InputError(f"{folder}: found none of {', '.join(_KINDS)}: it is no folder of results")
    try:
        summary = json.loads((folder / name).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{folder / name}: cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(summary, dict) or not isinstance(summary.get("case"), dict):
        raise InputError(f"{folder / name}: is no summary of a result")
    command = "ensemble" if (folder / "ensemble.json").is_file() and name == "summary.json" else _KINDS[name]
    with_body = any((folder / file).is_file() for file in FILES)
    return SavedResult(folder, command, summary, read_state(folder) if with_body else None)


def _flat(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Leaves of nested dictionaries by their path; a list is one leaf."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _flat(f"{name} {key}", item)
    elif isinstance(value, list):
        yield name, "; ".join(map(str, value))
    elif value is not None and value != "":
        yield name, str(value)


def difference(first: SavedState, second: SavedState) -> dict[str, Any]:
    """How far the displacement of the second result is from that of the first, in the first's body.

    Over the ``nodes`` that are in both bodies, ``outside`` those that are not in the second: root mean squares, by the
    volume that belongs to each node, of the difference and of either displacement there, and where it is largest (RAS).

    `InputError` if they are nowhere in one place.
    """
    mesh, second_mesh = first.mesh, second.mesh
    size = float(np.ptp(mesh.points, axis=0).max())
    there, inside = second.u, np.ones(len(mesh.points), dtype=bool)
    same = (
        np.array_equal(mesh.tetrahedra, second_mesh.tetrahedra)
        and mesh.points.shape == second_mesh.points.shape
        and bool(np.abs(mesh.points - second_mesh.points).max() <= _SAME * size)
    )
    if not same:
        location = locate(second_mesh.points, second_mesh.tetrahedra, mesh.points)
        there, inside = location.interpolate(second.u), location.distance <= _SAME * size
    if not inside.any():
        raise InputError(f"{first.path} and {second.path}: the bodies are nowhere in one place")
    weights = mesh.node_volumes * inside

    def root_mean_square(u: Floats) -> float:
        return MILLIMETRES * float(np.sqrt((weights * np.linalg.norm(u, axis=1) ** 2).sum() / weights.sum()))

    apart = np.linalg.norm(there - first.u, axis=1)
    worst = int(np.flatnonzero(inside)[apart[inside].argmax()])
    return {
        "root_mean_square_mm": root_mean_square(there - first.u),
        "largest_mm": MILLIMETRES * float(apart[worst]),
        "at_mm": (MILLIMETRES * mesh.points[worst]).tolist(),
        "first_mm": root_mean_square(first.u),
        "second_mm": root_mean_square(there),
        "nodes": int(np.count_nonzero(inside)),
        "outside": int(np.count_nonzero(~inside)),
        "same_mesh": same,
    }


def describe_two(first: SavedResult, second: SavedResult) -> dict[str, Any]:
    """Everything that is compared, as plain values; RMSE are of the simulation alone, but those "moved back"."""
    inputs, two = first.inputs(), second.inputs()
    names = dict.fromkeys([*inputs, *two])
    return {
        "folders": [str(first.folder), str(second.folder)],
        "inputs_that_differ": {n: [inputs.get(n), two.get(n)] for n in names if inputs.get(n) != two.get(n)},
        "rmse": _pairs(first.errors(), second.errors()),
        "displacement": None if first.state is None or second.state is None else difference(first.state, second.state),
        "tissue": _pairs(first.tissue(), second.tissue()),
        # of a diagnosis, in a word and in a sentence
        **{key: [result.summary.get(key) or None for result in (first, second)] for key in ("verdict", "sentence")},
    }


def _pairs(first: dict[str, Quantity], two: dict[str, Quantity]) -> dict[str, Any]:
    pairs = {}
    for name in dict.fromkeys([*first, *two]):
        both = [quantities.get(name) for quantities in (first, two)]
        pairs[name] = {
            "unit": next(quantity[1] for quantity in both if quantity is not None),
            "values": [quantity and quantity[0] for quantity in both],
            "intervals_95": [quantity and quantity[2] for quantity in both],
        }
    return pairs
