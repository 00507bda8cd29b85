"""Reads FEBio's input files (`.feb`, format 3.0 and 4.0) into `Problem`, or says what of one is not supported.

Formats: FEBio User's Manual, versions 3 and 4, chapter 3. Supported are solid elements, one analysis step, fixed,
prescribed and (of prescribed nodes) constrained displacements, nodal forces, pressures, tractions, constant body
forces, linear springs and load curves. What the materials are is read as it stands; whether warpbrain has them is for
`febio.materials` to say.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

from febio.problem import Curve, Problem

#: Corners of the elements that are supported.
ELEMENTS = {"tet4": 4, "tet10": 10, "hex8": 8, "penta6": 6}
#: Parts of a file that change nothing of what is solved.
_IDLE = {"Module", "Control", "Globals", "Material", "Mesh", "MeshDomains", "Boundary", "Loads", "LoadData", "Output"}
_READ = _IDLE | {"Constraints", "Discrete"}


class UnsupportedError(Exception):
    """A file has something that this reader, or warpbrain, does not have."""


def read_feb(text: str, name: str, source: str, commit: str, golden: float) -> Problem:
    """The problem of a file.

    Parameters
    ----------
    text : str
        The file's content. One that declares a document type or entities is refused: no entity is ever expanded.
    name, source, commit, golden
        See `Problem`.

    Raises
    ------
    UnsupportedError
        If something in it is not supported: says what.
    """
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text):
        raise UnsupportedError("a document type, which may name other files")
    root = ET.fromstring(text)
    version = root.get("version", "")
    if root.tag != "febio_spec" or version not in ("3.0", "4.0"):
        raise UnsupportedError(f"format {version or 'unknown'} of {root.tag}")
    for part in root:
        if part.tag not in _READ and len(part):
            raise UnsupportedError(f"section {part.tag}")
    module = _get(root, "Module").get("type")
    if module != "solid":
        raise UnsupportedError(f"module {module}")
    return _Reader(root).problem(name, source, commit, golden)


def _get(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    if found is None:
        raise UnsupportedError(f"no {path} in {element.tag}")
    return found


def _words(text: str | None) -> list[str]:
    return re.split(r"[,\s]+", text.strip()) if text and text.strip() else []


def _value(element: ET.Element) -> Any:
    """A number, numbers, a text, or a tree of these."""
    if len(element):
        tree: dict[str, Any] = {"type": element.get("type")} if element.get("type") else {}
        for child in element:
            if child.tag == "solid":
                tree.setdefault("solids", []).append(_value(child))
            else:
                tree[child.tag] = _value(child)
        return tree
    try:
        numbers: Any = [float(word) for word in _words(element.text)]
    except ValueError:
        numbers = " ".join((element.text or "").split())
    if isinstance(numbers, list) and len(numbers) == 1:
        numbers = numbers[0]
    if curve := element.get("lc"):
        return {"value": numbers, "curve": curve}
    return {"type": element.get("type"), "value": numbers} if element.get("type") else numbers


class _Reader:
    def __init__(self, root: ET.Element) -> None:
        self.root = root
        mesh = _get(root, "Mesh")
        self.nodes: list[list[float]] = []
        self.index: dict[int, int] = {}
        for node in mesh.iterfind("Nodes/node"):
            self.index[int(node.get("id", ""))] = len(self.nodes)
            self.nodes.append([float(word) for word in _words(node.text)])
        self.sets = {s.get("name", ""): self._set(s) for s in mesh.iterfind("NodeSet")}
        self.surfaces = {s.get("name", ""): [self._nodes(face) for face in s] for s in mesh.iterfind("Surface")}

    def _nodes(self, element: ET.Element) -> list[int]:
        return [self.index[int(word)] for word in _words(element.text)]

    def _set(self, element: ET.Element) -> list[int]:
        listed = [self.index[int(n.get("id", ""))] for n in element.iterfind("n")]
        return listed or self._nodes(element)

    def _members(self, name: str) -> list[int]:
        if name.startswith("@surface:"):
            return sorted({node for face in self.surfaces[name.removeprefix("@surface:")] for node in face})
        if name not in self.sets:
            raise UnsupportedError(f"node set {name!r}")
        return self.sets[name]

    def problem(self, name: str, source: str, commit: str, golden: float) -> Problem:
        control = _get(self.root, "Control")
        analysis = (control.findtext("analysis") or "STATIC").lower()
        self.fixed: dict[str, set[int]] = {}
        self.prescribed: list[dict[str, Any]] = []
        for bc in self.root.iterfind("Boundary/bc"):
            self._boundary(bc)
        for constraint in self.root.iterfind("Constraints/constraint"):
            self._tie(constraint)
        loads = self._loads()
        return Problem(
            name=name,
            source=source,
            commit=commit,
            golden=golden,
            analysis=analysis,
            steps=int(_get(control, "time_steps").text or 0),
            step=float(_get(control, "step_size").text or 0.0),
            nodes=self.nodes,
            elements=self._elements(),
            materials={m.get("name", ""): _value(m) for m in self.root.iterfind("Material/material")},
            fixed={axis: sorted(nodes) for axis, nodes in sorted(self.fixed.items())},
            prescribed=self.prescribed,
            springs=self._springs(),
            curves=self._curves(),
            **loads,
        )

    def _elements(self) -> list[dict[str, Any]]:
        domains = {d.get("name"): d for d in self.root.iterfind("MeshDomains/*")}
        blocks = []
        for block in self.root.iterfind("Mesh/Elements"):
            kind, domain = block.get("type", ""), domains.get(block.get("name"))
            if kind not in ELEMENTS or domain is None or domain.tag != "SolidDomain":
                raise UnsupportedError(f"elements {kind}")
            nodes = [self._nodes(element) for element in block]
            blocks.append({"type": kind, "material": domain.get("mat"), "nodes": nodes})
        return blocks

    def _scaled(self, element: ET.Element) -> dict[str, Any]:
        return {"value": float(element.text or 1.0), "curve": element.get("lc")}

    def _boundary(self, bc: ET.Element) -> None:
        kind, nodes = bc.get("type"), bc.get("node_set", "")
        if kind == "fix":
            for axis in _words(_get(bc, "dofs").text):
                if axis not in "xyz":
                    raise UnsupportedError(f"degree of freedom {axis}")
                self.fixed.setdefault(axis, set()).update(self._members(nodes))
        elif kind == "zero displacement":
            for axis in "xyz":
                if bc.findtext(f"{axis}_dof") == "1":
                    self.fixed.setdefault(axis, set()).update(self._members(nodes))
        elif kind in ("prescribe", "prescribed displacement"):
            if bc.findtext("relative", "0") != "0":
                raise UnsupportedError("a displacement relative to the step before")
            size = bc.find("scale") if kind == "prescribe" else bc.find("value")
            if size is None:
                raise UnsupportedError(f"boundary condition {kind} without a value")
            axis = bc.findtext("dof", "")
            self.prescribed.append({"axis": axis, "nodes": self._members(nodes), **self._scaled(size)})
        elif kind == "linear constraint":
            self._constraint(bc)
        else:
            raise UnsupportedError(f"boundary condition {kind}")

    def _constraint(self, bc: ET.Element) -> None:
        """A displacement that is a multiple of one that is prescribed: prescribed itself, at the end of the curves."""
        child = _get(bc, "child_dof")
        node, axis = self.index[int(_get(child, "node").text or 0)], child.findtext("dof")
        curves = self._curves()
        end = float(self.root.findtext("Control/time_steps", "0")) * float(self.root.findtext("Control/step_size", "0"))
        for other in self.prescribed:
            if other["axis"] == axis and node in other["nodes"]:
                factor = _get(child, "value")
                ratio = float(factor.text or 1.0) * (curves[factor.get("lc", "")].at(end) if factor.get("lc") else 1.0)
                own = self.index[int(_get(bc, "node").text or 0)]
                scaled = {**other, "axis": bc.findtext("dof"), "nodes": [own], "value": ratio * other["value"]}
                self.prescribed.append(scaled)
                return
        raise UnsupportedError("a linear constraint between unknown displacements")

    def _tie(self, constraint: ET.Element) -> None:
        """Displacements that are to equal one that is prescribed."""
        if constraint.get("type") != "linear constraint":
            raise UnsupportedError(f"constraint {constraint.get('type')}")
        for equation in constraint.iterfind("linear_constraint"):
            terms = {(self.index[int(t.get("id", ""))], t.get("bc")): float(t.text or 0.0) for t in equation}
            for other in [p for p in self.prescribed if "tied" not in p]:
                given = [term for term in terms if term[0] in other["nodes"] and term[1] == other["axis"]]
                if len(given) == 1 and len(terms) == 2 and sum(terms.values()) == 0.0:
                    ((node, axis),) = terms.keys() - given
                    self.prescribed.append({**other, "axis": axis, "nodes": [node], "tied": True})
                    break
            else:
                raise UnsupportedError("a linear constraint between unknown displacements")

    def _springs(self) -> list[dict[str, Any]]:
        materials = {m.get("id"): m for m in self.root.iterfind("Discrete/discrete_material")}
        sets = {s.get("name"): s for s in self.root.iterfind("Mesh/DiscreteSet")}
        springs = []
        for discrete in self.root.iterfind("Discrete/discrete"):
            material = materials[discrete.get("dmat")]
            if material.get("type") != "linear spring":
                raise UnsupportedError(f"discrete material {material.get('type')}")
            stiffness = float(_get(material, "E").text or 0.0)
            pairs = sets[discrete.get("discrete_set")]
            springs += [{"nodes": self._nodes(pair), "stiffness": stiffness} for pair in pairs]
        return springs

    def _loads(self) -> dict[str, Any]:
        forces, pressures, tractions, body_forces = [], [], [], []
        for load in self.root.iterfind("Loads/*"):
            kind = load.get("type")
            if load.tag == "nodal_load" and kind in ("nodal_load", "nodal_force"):
                size = load.find("scale")
                if size is None:
                    raise UnsupportedError("a nodal force that is a vector")
                axis, nodes = load.findtext("dof", ""), self._members(load.get("node_set", ""))
                forces.append({"axis": axis, "nodes": nodes, **self._scaled(size)})
            elif load.tag == "surface_load" and kind == "pressure":
                faces = self._faces(load)
                linear = load.findtext("linear", "0") == "1"
                pressures.append({"faces": faces, **self._scaled(_get(load, "pressure")), "linear": linear})
            elif load.tag == "surface_load" and kind == "traction":
                if load.findtext("linear", "0") != "0":
                    raise UnsupportedError("a traction for each area at rest")
                part = {**self._scaled(_get(load, "scale")), "faces": self._faces(load)}
                along = [float(word) for word in _words(load.findtext("traction"))]
                tractions.append({**part, "value": [part["value"] * each for each in along]})
            elif load.tag == "body_load" and kind == "const":
                for i, axis in enumerate("xyz"):
                    part = self._scaled(_get(load, axis))
                    if part["value"]:
                        body_forces.append({**part, "value": [part["value"] * (i == j) for j in range(3)]})
            else:
                raise UnsupportedError(f"load {kind}")
        return {"forces": forces, "pressures": pressures, "tractions": tractions, "body_forces": body_forces}

    def _faces(self, load: ET.Element) -> list[list[int]]:
        faces = self.surfaces.get(load.get("surface", ""))
        if faces is None:
            raise UnsupportedError(f"surface {load.get('surface')!r}")
        return faces

    def _curves(self) -> dict[str, Curve]:
        found = {}
        for controller in self.root.iterfind("LoadData/load_controller"):
            if controller.get("type") != "loadcurve":
                raise UnsupportedError(f"load controller {controller.get('type')}")
            points = [[float(word) for word in _words(point.text)] for point in _get(controller, "points")]
            kind = controller.findtext("interpolate", "LINEAR")
            if controller.findtext("extend", "CONSTANT") != "CONSTANT":
                raise UnsupportedError("a load curve that is repeated")
            found[controller.get("id", "")] = Curve(kind, points)
        return found
