"""Numbering that keeps neighbours near each other in memory."""

from __future__ import annotations

import numpy as np

from warpbrain.mesh.tet_mesh import TetMesh


def ordered(mesh: TetMesh) -> TetMesh:
    """The same mesh with nodes in reverse Cuthill-McKee order and tetrahedra sorted by their nodes.

    Meshers number as they go. In this order the entries that an element or a matrix row touches lie close together,
    which saves a fifth of the time of assembly (`docs/benchmarks.md`).
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    count = len(mesh.points)
    rows = np.repeat(mesh.tetrahedra, 4, axis=1).ravel()
    columns = np.tile(mesh.tetrahedra, (1, 4)).ravel()
    graph = csr_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(count, count))
    nodes = np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True))
    number = np.empty(count, dtype=np.int64)
    number[nodes] = np.arange(count)
    tetrahedra = number[mesh.tetrahedra].astype(np.int32)
    elements = np.lexsort(np.sort(tetrahedra, axis=1).T[::-1])
    return TetMesh(
        mesh.points[nodes],
        tetrahedra[elements],
        mesh.tissue[elements],
        {name: members[nodes] for name, members in mesh.node_sets.items()},
        {name: members[elements] for name, members in mesh.element_sets.items()},
        {name: vectors[elements] for name, vectors in mesh.element_vectors.items()},
    )
