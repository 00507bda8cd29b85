"""The boundaries of a case, and whether together they make sense."""

import itertools
from typing import Any

import numpy as np

from warpbrain.cases.boundary import BOUNDARIES, Boundary, Displaced, Fixed
from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import BOUNDARY
from warpbrain.cases.parts.named import Named, read_closed_surface
from warpbrain.mesh import TetMesh, components, faces_of
from warpbrain.recordings.tables import read_table
from warpbrain.recordings.text import collected


def read_boundaries(context: Context, named: Named | None) -> tuple[Boundary, ...]:
    """Boundaries in the order of the file, as far as they are right."""
    boundaries: list[Boundary] = []
    names: set[str] = set()
    for table in context.lists(BOUNDARY):
        nodes = None if named is None else named.nodes(table)
        name = table.get("name") or table.get("nodes") or ""
        if name in names:
            table.problem("name", f"a second boundary '{name}'", "recordings name boundaries: give each its own")
        names.add(name)
        if table.variant is None:
            continue
        values = _values(table)
        if values is not None and nodes is not None:
            boundaries.append(BOUNDARIES[table.variant](name=name, nodes=nodes, **values))
    return tuple(boundaries)


def _values(table: Reading) -> dict[str, Any] | None:
    """What a boundary has besides name and nodes; None if something of it is wrong."""
    keys = [key for key in BOUNDARIES[str(table.variant)].keys if key.name != "ramp"]
    if table.variant == Displaced.kind and isinstance(table.get("value"), str):
        if table.has("ramp"):
            table.problem("ramp", "means nothing with a file, which has the times itself")
        return _history(table)
    ramp = table.ramp() if "ramp" in table.keys else ()
    if ramp is None or any(key.needed and not table.has(key.name) for key in keys):
        return None
    if table.variant == Displaced.kind:
        times, factors = zip(*ramp, strict=True) if ramp else ((0.0,), (1.0,))
        return {"times": tuple(times), "values": _triples(np.outer(factors, table.si("value")))}
    values = {key.name: table.si(key.name) for key in keys}
    if "surface" in values:
        path, frame = table.path("surface"), table.context.frame
        surface = None if path is None else read_closed_surface(path, values["surface"], frame, table.context.problems)
        if surface is None:
            return None
        values["surface"] = surface
    return values | ({"ramp": ramp} if "ramp" in table.keys else {})


def _history(table: Reading) -> dict[str, Any] | None:
    """Times [s] and displacements [m] of a file with the columns t, ux, uy, uz."""
    path, problems, columns = table.path("value"), table.context.problems, ("ux", "uy", "uz")
    if path is None:
        return None
    with collected(path, problems) as of_file:
        rows = read_table(path, of_file, ("t", *columns))
        rows.require("t", *columns)
        times, values = rows.times(strictly=True), rows.vectors(*columns)
    if of_file:
        return None
    displacements = _triples(table.context.frame.lengths(values))
    return {"times": tuple(times.tolist()), "values": displacements, "file": table.get("value")}


def _triples(values: Any) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in values)


def check_faces(context: Context, left: TetMesh, boundaries: tuple[Boundary, ...]) -> None:
    """Note boundaries that act on faces of the surface, of what is `left` after a resection, and have none there."""
    for boundary in boundaries:
        if boundary.on_faces and not len(faces_of(left, left.node_sets[boundary.nodes])):
            wall = boundary.nodes in left.element_sets
            message = f"node set '{boundary.nodes}' holds no face of the surface, which '{boundary.kind}' acts on"
            cure = f"take out '{boundary.nodes}' by a [[mechanism]] resection" if wall else ""
            context.problem(f"[[boundary]] '{boundary.name}' nodes", message, cure)


def check_together(context: Context, mesh: TetMesh, boundaries: tuple[Boundary, ...]) -> None:
    """Note boundaries that contradict each other, and parts of the body that nothing holds."""
    fixed = [b for b in boundaries if isinstance(b, Fixed)]
    moved = [b for b in boundaries if isinstance(b, Displaced)]
    for a, b in [*itertools.product(fixed, moved), *itertools.combinations(moved, 2)]:
        shared = int((mesh.node_sets[a.nodes] & mesh.node_sets[b.nodes]).sum())
        if shared and not (isinstance(a, Displaced) and a.values == b.values and a.times == b.times):
            verb = "fixes" if isinstance(a, Fixed) else "displaces"
            message = f"'{a.name}' {verb} {shared} nodes that '{b.name}' displaces"
            context.problem("[[boundary]]", message)
    part = components(mesh.tetrahedra)
    if part.max() == 0:
        return
    held = np.zeros(len(mesh.points), dtype=bool)
    for boundary in boundaries:
        if boundary.holds:
            held |= mesh.node_sets[boundary.nodes]
    sizes = np.bincount(part)
    for number in np.argsort(sizes):
        cells = mesh.tetrahedra[part == number]
        if not held[cells].any():
            first = int(np.flatnonzero(part == number)[0])
            context.problem(
                "[mesh]",
                f"the mesh is in {len(sizes)} parts that no face connects, and nothing holds the one of {len(cells)} "
                f"tetrahedra (first: tetrahedron {first})",
                "join the parts, leave this one out, or hold it by a [[boundary]]",
            )
