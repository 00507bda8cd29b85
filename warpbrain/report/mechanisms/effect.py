"""The record of what mechanisms do to the phantom, and of what their pictures were made from."""

from __future__ import annotations

import hashlib
import inspect
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

from warpbrain.atomic import whole_file
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report.mechanisms import picture

#: The case that examples are said of, and the files that it is.
BASE = "phantom-loaded"
_FILES = ("case-loaded.toml", "multi-loaded.vtu")


@dataclass(frozen=True)
class Effect:
    """What the example of a mechanism does to the phantom.

    Attributes
    ----------
    largest : float
        Largest difference that it makes to a displacement [mm].
    place : tuple of three floats
        Where, in the undeformed phantom [mm].
    steps : int
        After how many steps of 1 ms from rest; 0: in equilibrium.
    made_from : str
        Digest of the mechanism's file, its example, the phantom and the file that draws.
    picture : str
        Digest of the picture.
    """

    largest: float
    place: tuple[float, float, float]
    steps: int
    made_from: str
    picture: str

    @property
    def command(self) -> str:
        """Arguments of the run that are not those of the mechanism."""
        return f"--case {BASE}" + (f" --steps {self.steps}" if self.steps else "")


def made_from(kind: str) -> str:
    """Digest of everything that a picture of a mechanism should be made again for."""
    mechanism = mechanisms()[kind]
    digest = hashlib.sha256(mechanism.example.encode())
    for module in (sys.modules[mechanism.__module__], picture):
        digest.update(inspect.getsource(module).encode())
    for name in _FILES:
        digest.update((files("warpbrain.cases") / "data" / "phantom" / name).read_bytes())
    return digest.hexdigest()


def digest_of(path: Path) -> str:
    """Of a file; empty if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def read_effects(path: Path) -> dict[str, Effect]:
    """Effects by kind of mechanism; none if there is no such file."""
    if not path.exists():
        return {}
    found = json.loads(path.read_text(encoding="utf-8"))
    return {kind: Effect(**{**values, "place": tuple(values["place"])}) for kind, values in found.items()}


def write_effects(path: Path, effects: Mapping[str, Effect]) -> None:
    """Write effects, in the order of the registry."""
    found = {kind: asdict(effects[kind]) for kind in mechanisms() if kind in effects}
    with whole_file(path) as scratch:
        scratch.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
