"""The boundaries of a case, and whether together they make sense."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.cases.boundary import Boundary, Contact, Displaced, Fixed, Forced, Pressed, Sliding
from warpbrain.cases.format.table import Reading
from warpbrain.cases.format.tables import BOUNDARY
from warpbrain.cases.parts.closed_surfaces import read_closed_surface
from warpbrain.cases.parts.context import Context
from warpbrain.cases.parts.node_sets import NodeSets
from warpbrain.cases.parts.ramps import read_ramp
from warpbrain.mesh import TetMesh, components, faces_of
from warpbrain.recordings.tables import read_table
from warpbrain.recordings.text import collected


def read_boundaries(context: Context, sets: NodeSets | None) -> tuple[Boundary, ...]:
    """Boundaries in the order of the file, as far as they are right."""
    boundaries: list[Boundary] = []
    names: set[str] = set()
    for table in context.lists(BOUNDARY):
        nodes = None if sets is None else sets.look_up(table)
        name = table.get("name", table.get("nodes", ""))
        if name in names:
            table.problem("name", f"a second boundary '{name}'", "recordings name boundaries: give each its own")
        names.add(name)
        if table.variant is None:
            continue
        boundary = _READERS[table.variant](context, table, {"name": name, "nodes": nodes or ""})
        if boundary is not None and nodes is not None:
            boundaries.append(boundary)
    return tuple(boundaries)


def _fixed(context: Context, table: Reading, common: dict[str, str]) -> Boundary:
    return Fixed(**common)


def _sliding(context: Context, table: Reading, common: dict[str, str]) -> Boundary:
    return Sliding(**common)


def _displaced(context: Context, table: Reading, common: dict[str, str]) -> Boundary | None:
    value = table.get("value")
    if isinstance(value, str):
        if table.has("ramp"):
            table.problem("ramp", "means nothing with a file, which has the times itself")
        path = context.path(table, "value")
        history = None if path is None else _history(path, context)
        if history is None:
            return None
        return Displaced(**common, times=history[0], values=_triples(history[1]), file=value)
    ramp = read_ramp(table)
    if value is None or ramp is None:
        return None
    final = context.frame.lengths(value)
    times, factors = zip(*ramp, strict=True) if ramp else ((0.0,), (1.0,))
    return Displaced(**common, times=tuple(times), values=_triples(np.outer(factors, final)))


def _history(path: Path, context: Context) -> tuple[tuple[float, ...], Any] | None:
    """Times [s] and displacements (k, 3) [m] of a file with the columns t, ux, uy, uz."""
    columns = ("ux", "uy", "uz")
    with collected(path, context.problems) as found:
        table = read_table(path, found, ("t", *columns))
        if table is None or not table.require("t", *columns):
            return None
        times, values = table.times(strictly=True), table.vectors(*columns)
    return None if found else (tuple(times.tolist()), context.frame.lengths(values))


def _triples(values: Any) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in values)


def _forced(context: Context, table: Reading, common: dict[str, str]) -> Boundary | None:
    ramp = read_ramp(table)
    if not table.has("total") or ramp is None:
        return None
    x, y, z = context.frame.directions(table.get("total")).tolist()
    return Forced(**common, total=(x, y, z), ramp=ramp)


def _pressed(context: Context, table: Reading, common: dict[str, str]) -> Boundary | None:
    ramp = read_ramp(table)
    if not table.has("value") or ramp is None:
        return None
    return Pressed(**common, value=float(table.get("value")), ramp=ramp)


def _contact(context: Context, table: Reading, common: dict[str, str]) -> Boundary | None:
    path = context.path(table, "surface")
    if path is None:
        return None
    surface = read_closed_surface(path, table.get("surface"), context.frame, context.problems)
    return None if surface is None else Contact(**common, surface=surface, friction=float(table.get("friction", 0.0)))


_READERS = {
    "fixed": _fixed,
    "sliding": _sliding,
    "displacement": _displaced,
    "force": _forced,
    "pressure": _pressed,
    "contact": _contact,
}


def check_faces(context: Context, left: TetMesh, boundaries: tuple[Boundary, ...]) -> None:
    """Note boundaries that act on faces of the surface, of what is `left` after a resection, and have none there."""
    for boundary in boundaries:
        if isinstance(boundary, Sliding | Pressed) and not len(faces_of(left, left.node_sets[boundary.nodes])):
            wall = boundary.nodes in left.element_sets
            context.problems.add(
                context.file,
                f"[[boundary]] '{boundary.name}' nodes",
                f"node set '{boundary.nodes}' holds no face of the surface, which '{boundary.kind}' acts on",
                f"take out '{boundary.nodes}' by a [[mechanism]] resection" if wall else "",
            )


def check_together(context: Context, mesh: TetMesh, boundaries: tuple[Boundary, ...]) -> None:
    """Note boundaries that contradict each other, and parts of the body that nothing holds."""
    fixed = [b for b in boundaries if isinstance(b, Fixed)]
    moved = [b for b in boundaries if isinstance(b, Displaced)]
    for a, b in [*itertools.product(fixed, moved), *itertools.combinations(moved, 2)]:
        shared = int((mesh.node_sets[a.nodes] & mesh.node_sets[b.nodes]).sum())
        if shared and not (isinstance(a, Displaced) and a.values == b.values and a.times == b.times):
            verb = "fixes" if isinstance(a, Fixed) else "displaces"
            context.problems.add(
                context.file, "[[boundary]]", f"'{a.name}' {verb} {shared} nodes that '{b.name}' displaces"
            )
    part = components(mesh.tetrahedra)
    if part.max() == 0:
        return
    held = np.zeros(len(mesh.points), dtype=bool)
    for boundary in boundaries:
        if not isinstance(boundary, Forced | Pressed):
            held |= mesh.node_sets[boundary.nodes]
    sizes = np.bincount(part)
    for number in np.argsort(sizes):
        own = mesh.tetrahedra[part == number]
        if not held[own].any():
            first = int(np.flatnonzero(part == number)[0])
            context.problems.add(
                context.file,
                "[mesh]",
                f"the mesh is in {len(sizes)} parts that no face connects, and nothing holds the one of {len(own)} "
                f"tetrahedra (first: tetrahedron {first})",
                "join the parts, leave this one out, or hold it by a [[boundary]]",
            )
