"""A folder of results opened again, and what of it can be laid beside that of another."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.state_files import FILES, SavedState, read_state

#: Files that say what a result is, and the command that wrote them; an ensemble's has the same name as a run's.
_KINDS = {"diagnosis.json": "diagnose", "estimate.json": "estimate", "summary.json": "run"}
#: Keys of what is said of the case and of the solution that are outcomes, or are said elsewhere.
_NO_INPUT = ("tissues", "left_out", "title", "file", "first_step", "history", "relative_residual", "stored_energy_J")
_INPUTS = ("solution", "options", "prior", "method", "seed", "chosen", "course", "device", "workers")


@dataclass(frozen=True)
class Quantity:
    """A number of a result.

    Attributes
    ----------
    value : float
    unit : str
    interval : (low, high) or None
        That holds it with 95 %.
    """

    value: float
    unit: str
    interval: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class SavedResult:
    """A result.

    Attributes
    ----------
    folder : Path
    command : str
        That wrote it.
    said : mapping
        Its JSON.
    state : SavedState or None
        The deformed body, if there is one.
    """

    folder: Path
    command: str
    said: Mapping[str, Any]
    state: SavedState | None

    def inputs(self) -> dict[str, str]:
        """What it was made from and how, as text by name."""
        said = self.said
        found = {"command": self.command}
        found |= {f"sha256 of {name}": digest[:16] for name, digest in (said.get("inputs_sha256") or {}).items()}
        for part in ("case", *_INPUTS):
            value = said.get(part)
            if isinstance(value, dict):
                value = {key: item for key, item in value.items() if key not in _NO_INPUT and "iterations" not in key}
            found |= dict(_flat(part, value))
        return found | dict(_flat("version of", said.get("versions", {})))

    def errors(self) -> dict[str, Quantity]:
        """Root mean square differences from what was recorded, by what they are of."""
        by_name: dict[str, Quantity] = {}
        recordings = self.said.get("recordings") or {}
        for one in recordings.get("compared", []):
            by_name[f"{one['name']}, nothing moved"] = Quantity(one["before"]["root_mean_square"], one["unit"])
            by_name[one["name"]] = Quantity(one["after"]["root_mean_square"], one["unit"])
        for one in self.said.get("predictions", []):
            by_name[f"{one['name']}, nothing moved"] = Quantity(one["root_mean_square_before"], one["unit"])
            by_name[one["name"]] = Quantity(one["root_mean_square_of_run"], one["unit"])
            by_name[f"{one['name']}, moved back"] = Quantity(one["root_mean_square_after"], one["unit"])
        for name, one in ((self.said.get("result") or {}).get("rmse_at_recordings") or {}).items():
            after = one["after"]
            by_name[f"{name}, nothing moved"] = Quantity(one["before"], one["unit"])
            by_name[name] = Quantity(after["p50"], one["unit"], (after["p05"], after["p95"]))
        for kind, where in (("rmse_m", "all fitted"), ("heldout_rmse_m", "held out"), ("check_rmse_m", "check")):
            for stage, value in ((self.said.get("fit") or {}).get(kind) or {}).items():
                if value is not None:
                    by_name[f"{where}, {stage}"] = Quantity(MILLIMETRES * value, "mm")
        return by_name

    def tissue(self) -> dict[str, Quantity]:
        """Parameters of the tissues, by tissue and name."""
        by_name: dict[str, Quantity] = {}
        for one in ((self.said.get("case") or {}).get("tissues") or {}).values():
            by_name[f"{one['name']}, shear modulus"] = Quantity(one["shear_modulus_Pa"], "Pa")
        for one in self.said.get("parameters") or [] if self.command == "estimate" else []:
            low, high = one["interval_95"]
            by_name[f"{one['tissue']}, {one['name']}"] = Quantity(one["estimate"], one["unit"], (low, high))
        for one in (self.said.get("nothing_else") or {}).get("tissue") or []:
            low, high = one["interval_95"]
            name = f"{one['tissue']}, {one['name']}, over what may act"
            by_name[name] = Quantity(one["middle"], one["unit"], (low, high))
        return by_name

    def verdict(self) -> tuple[str, str]:
        """What a diagnosis says, in a word and in a sentence; empty for other results."""
        return str(self.said.get("verdict", "")), str(self.said.get("sentence", ""))


def read_result(folder: Path) -> SavedResult:
    """Open a folder of results.

    Raises
    ------
    InputError
        If it holds none, or they cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    name = next((name for name in _KINDS if (folder / name).is_file()), None)
    if name is None:
        raise InputError(f"{folder}: found none of {', '.join(_KINDS)}: it is no folder of results")
    try:
        said = json.loads((folder / name).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{folder / name}: cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(said, dict) or not isinstance(said.get("case"), dict):
        raise InputError(f"{folder / name}: is no summary of a result")
    command = "ensemble" if (folder / "ensemble.json").is_file() and name == "summary.json" else _KINDS[name]
    with_body = any((folder / file).is_file() for file in FILES)
    return SavedResult(folder, command, said, read_state(folder) if with_body else None)


def _flat(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Leaves of nested dictionaries by their path; a list is one leaf."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _flat(f"{name} {key}", item)
    elif isinstance(value, list):
        yield name, "; ".join(map(str, value))
    elif value is not None and value != "":
        yield name, str(value)
