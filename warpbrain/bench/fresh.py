"""Bodies that no cache has seen, so that what the bench calls pre-processing is all of it.

Table 3 times everything from a mesh in memory to the first step. Here much of that is kept once it is made, because a
diagnosis asks for the same mesh thousands of times; a second system of a mesh is then several times cheaper than the
first. What is kept, and for how long:

- as long as a `TetMesh` lives: its cached properties (labels, volumes, centres, boundary, node volumes), meshes made of
  it (`_made`: refined, without a resection), which `with_node_sets` passes on; what a device was told of it, the
  elements by device and precision, patterns by the bytes of their stencils (`warpbrain.simulation.placed`);
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
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh

#: How far a body is moved from the one before it [m]: nothing that is computed with it is any harder for that.
SHIFT = 1e-6


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """A mesh in memory: the arguments of `TetMesh`, of which nothing is known yet."""

    points: NDArray[np.float64]
    tetrahedra: NDArray[np.int32]
    tissue: NDArray[np.int32]
    node_sets: Mapping[str, NDArray[np.bool_]]
    element_sets: Mapping[str, NDArray[np.bool_]]
    element_vectors: Mapping[str, NDArray[np.float64]]


def fresh_arrays(mesh: TetMesh, number: int) -> MeshArrays:
    """Copies of the arrays of a mesh, of the same body but not the same bytes.

    Parameters
    ----------
    mesh : TetMesh
    number : int
        How often `SHIFT` to the right the body lies, and by how many places the numbers of its elements are turned
        round: neighbours in memory stay neighbours. Different numbers give different bytes.
    """

    def turned(values: NDArray[Any]) -> NDArray[Any]:
        return np.roll(values, number, axis=0)

    return MeshArrays(
        mesh.points + np.array([SHIFT * number, 0.0, 0.0]),
        turned(mesh.tetrahedra),
        turned(mesh.tissue),
        {name: members.copy() for name, members in mesh.node_sets.items()},
        {name: turned(members) for name, members in mesh.element_sets.items()},
        {name: turned(vectors) for name, vectors in mesh.element_vectors.items()},
    )


def case_of(case: Case, arrays: MeshArrays) -> Case:
    """The same case of a mesh that is checked anew."""
    return replace(case, mesh=TetMesh(**vars(arrays)))
