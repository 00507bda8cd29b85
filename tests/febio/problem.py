"""A test problem of FEBio's in a form of its own: numbers and names, without the file that it was read from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AXES = "xyz"


@dataclass(frozen=True)
class Curve:
    """A load curve: factors at times, linear, smooth or in steps between them, constant or continued outside."""

    interpolate: str
    points: list[list[float]]

    def at(self, time: float) -> float:
        times, values = np.array(self.points).T
        if self.interpolate == "LINEAR":
            return float(np.interp(time, times, values))
        if self.interpolate == "STEP":
            return float(values[min(int(np.searchsorted(times, time - 1e-12)), len(times) - 1)])
        # "SMOOTH" is only known here at its own points: between them FEBio has a spline
        here = np.flatnonzero(np.abs(times - time) < 1e-9)
        if len(here):
            return float(values[here[0]])
        if time > times[-1]:
            return float(values[-1])
        raise NotImplementedError("between the points of a smooth load curve")


@dataclass(frozen=True)
class Problem:
    """One test problem, in the units of its file.

    Attributes
    ----------
    name, source, commit : str
        Its name in FEBio's table of golden numbers, its path in the repository of the test suite, and the commit that
        was read.
    golden : float
        FEBio's golden number: the norm of the displacements that are solved for, at the end.
    analysis : str
        ``"static"`` or ``"dynamic"``.
    steps, step : int, float
        Number and size of the time steps.
    nodes : list of [x, y, z]
    elements : list of {type, material, nodes}
        Blocks of elements of one type and material; nodes count from 0.
    materials : dict of str to dict
        Type and parameters by name, as FEBio names them; a parameter with a load curve is `{"value", "curve"}`.
    fixed : dict of str to list of int
        Nodes that are held, by axis.
    prescribed, forces : list of {axis, nodes, value, curve}
        Displacements, and forces on each node. Displacements with `tied` are those of nodes that FEBio ties to others
        that are prescribed: it solves for them, so they count in its number.
    pressures : list of {faces, value, curve, linear}
        Positive pushes on the faces, which are oriented outwards; they follow the deformation unless `linear`.
    tractions : list of {faces, value, curve}
        Forces [x, y, z] for each area of the faces as it is deformed.
    body_forces : list of {value, curve}
        Forces [x, y, z] for each mass, as FEBio takes them: a body is accelerated by their negative.
    springs : list of {nodes, stiffness}
        Two nodes pulled together by the stiffness times their distance's increase.
    curves : dict of str to Curve
    """

    name: str
    source: str
    commit: str
    golden: float
    analysis: str
    steps: int
    step: float
    nodes: list[list[float]]
    elements: list[dict[str, Any]]
    materials: dict[str, Any]
    fixed: dict[str, list[int]]
    prescribed: list[dict[str, Any]] = field(default_factory=list)
    forces: list[dict[str, Any]] = field(default_factory=list)
    pressures: list[dict[str, Any]] = field(default_factory=list)
    tractions: list[dict[str, Any]] = field(default_factory=list)
    body_forces: list[dict[str, Any]] = field(default_factory=list)
    springs: list[dict[str, Any]] = field(default_factory=list)
    curves: dict[str, Curve] = field(default_factory=dict)

    @property
    def end(self) -> float:
        """The last time."""
        return self.steps * self.step

    def factor(self, curve: str | None, time: float) -> float:
        """Factor of a load at a time: 1 without a curve."""
        return 1.0 if curve is None else self.curves[curve].at(time)

    def constraints(self, time: float) -> tuple[NDArray[np.bool_], Floats]:
        """Components that are held or prescribed, and their values, each (n, 3)."""
        held = np.zeros((len(self.nodes), 3), dtype=bool)
        values = np.zeros((len(self.nodes), 3))
        for axis, nodes in self.fixed.items():
            held[nodes, AXES.index(axis)] = True
        for each in self.prescribed:
            place = each["nodes"], AXES.index(each["axis"])
            held[place] = True
            values[place] = each["value"] * self.factor(each["curve"], time)
        return held, values

    def norm(self, u: Floats) -> float:
        """FEBio's golden number of displacements (n, 3)."""
        counted = ~self.constraints(self.end)[0]
        for each in self.prescribed:
            if each.get("tied"):
                counted[each["nodes"], AXES.index(each["axis"])] = True
        return float(np.linalg.norm(u[counted]))

    def nodal_forces(self, time: float) -> Floats:
        """Dead forces on the nodes, (n, 3)."""
        forces = np.zeros((len(self.nodes), 3))
        for each in self.forces:
            forces[each["nodes"], AXES.index(each["axis"])] += each["value"] * self.factor(each["curve"], time)
        return forces

    def traction_forces(self, u: Floats, time: float) -> Floats:
        """Forces of the tractions on the nodes, (n, 3), for displacements."""
        x = np.array(self.nodes) + u
        forces = np.zeros_like(x)
        for each in self.tractions:
            force = np.array(each["value"]) * self.factor(each["curve"], time)
            for face in each["faces"]:
                forces[face] += np.outer(areas_of_corners(x[face]), force)
        return forces


def areas_of_corners(corners: Floats) -> Floats:
    """What of a face's area each of its corners bears: the integrals of their shape functions."""
    if len(corners) == 3:
        area = 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        return np.full(3, area / 3.0)
    if len(corners) != 4:
        raise NotImplementedError("a quadratic face")
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    total = np.zeros(4)
    for r, s in signs / np.sqrt(3.0):
        along = 0.25 * (signs[:, 0] * (1.0 + signs[:, 1] * s)) @ corners
        across = 0.25 * (signs[:, 1] * (1.0 + signs[:, 0] * r)) @ corners
        total += 0.25 * (1.0 + signs[:, 0] * r) * (1.0 + signs[:, 1] * s) * np.linalg.norm(np.cross(along, across))
    return total


def read_problems(folder: Path) -> list[Problem]:
    """All problems of a folder of JSON files, one a family."""
    found = []
    for path in sorted(folder.glob("*.json")):
        for entry in json.loads(path.read_text(encoding="utf-8")):
            curves = {name: Curve(**curve) for name, curve in entry.pop("curves", {}).items()}
            found.append(Problem(**{"fixed": {}, **entry}, curves=curves))
    return found


def write_problems(path: Path, problems: Sequence[Problem]) -> None:
    """One line for each field of each problem."""
    texts = []
    for problem in problems:
        lines = [f"  {json.dumps(k)}: {json.dumps(v, separators=(',', ':'))}" for k, v in asdict(problem).items() if v]
        texts.append("{\n" + ",\n".join(lines) + "\n }")
    path.write_text("[" + ", ".join(texts) + "]\n", encoding="utf-8")
