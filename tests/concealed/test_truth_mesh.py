"""The fingerprint of a fine mesh: the same however nodes and elements are numbered."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import box

from concealed.truth_mesh import fingerprint
from warpbrain.mesh import TetMesh


@pytest.fixture
def mesh() -> TetMesh:
    made = box((3, 2, 2), (0.03, 0.02, 0.02))
    return replace(made, tissue=np.arange(len(made.tetrahedra), dtype=np.int32) % 2 + 1)


def test_numbers_do_not_matter(mesh):
    random = np.random.default_rng(0)
    nodes, elements = (random.permutation(len(each)) for each in (mesh.points, mesh.tetrahedra))
    tetrahedra = np.argsort(nodes)[mesh.tetrahedra][elements].astype(np.int32)
    other = TetMesh(mesh.points[nodes], tetrahedra, mesh.tissue[elements])
    assert fingerprint(other) == fingerprint(mesh)


def test_points_and_tissues_do(mesh):
    moved, other = mesh.points.copy(), mesh.tissue.copy()
    moved[3, 1] += 2e-9
    other[5] = 3 - other[5]
    prints = {fingerprint(each) for each in (mesh, replace(mesh, points=moved), replace(mesh, tissue=other))}
    assert len(prints) == 3
