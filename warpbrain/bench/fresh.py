"""Bodies that no cache has seen, so that what the bench calls pre-processing is all of it.

Table 3 times everything from a mesh in memory to the first step. Here much of that is kept once it is made, because a
diagnosis asks for the same mesh thousands of times; a second system of a mesh is then several times cheaper than the
first. What is kept, and for how long:

- as long as a `TetMesh` lives: its cached properties (labels, volumes, centres, boundary, node volumes), meshes made of
  it (`shared`: refined, without a resection), which `with_node_sets` passes on; what a device was told of it, the
  elements by device and precision, patterns and patches by what they are of (`warpbrain.simulation.assembly`);
- by mesh, the latest ones: connected parts (`simulation.held`), balls (`physics.regions`), patches of a traction
  (`physics.mechanisms.traction`), and what estimation and diagnosis ask of a mesh;
- by bytes of coordinates: sites of a diagnosis (`diagnosis.sensors`);
- as long as a `Case` or a `Model` lives: what is left of a resection, midside nodes, unit forces of the loads;
- as long as the process lives: kernels, compiled and loaded, and memory that a GPU's pool keeps. Only these are warm
  here: that is paid once on a machine or in a process, not for a mesh.

A fresh mesh is therefore another object, and differs in content from every other: no cache by identity or by bytes,
those above or those to come, can answer for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh

#: How far a body is moved from the one before it [m]: nothing that is computed with it is any harder for that.
SHIFT = 1e-6


def fresh_arrays(mesh: TetMesh, number: int) -> dict[str, Any]:
    """Copies of the arguments of a mesh, of the same body but not the same bytes: `number` differs.

    It is how often `SHIFT` to the right the body lies, and by how many places the numbers of its elements are turned
    round: neighbours in memory stay neighbours.
    """

    def turned(values: NDArray[Any]) -> NDArray[Any]:
        return np.roll(values, number, axis=0)

    return {
        "points": mesh.points + np.array([SHIFT * number, 0.0, 0.0]),
        "tetrahedra": turned(mesh.tetrahedra),
        "tissue": turned(mesh.tissue),
        "node_sets": {name: members.copy() for name, members in mesh.node_sets.items()},
        "element_sets": {name: turned(members) for name, members in mesh.element_sets.items()},
        "element_vectors": {name: turned(vectors) for name, vectors in mesh.element_vectors.items()},
        "cut": mesh.cut.copy(),
    }


def case_of(case: Case, arrays: Mapping[str, Any]) -> Case:
    """The same case of a mesh that is checked anew."""
    return replace(case, mesh=TetMesh(**arrays))
