"""Colours of tissue follow its name, not the order of its label."""

import numpy as np
from shapes import box

from warpbrain.mesh import TetMesh
from warpbrain.report import views


def two_tissues(labels):
    mesh = box((2, 1, 1), (1.0, 0.5, 0.5))
    return TetMesh(mesh.points, mesh.tetrahedra, np.array(labels)[(mesh.centres[:, 0] > 0.5).astype(int)])


def test_grey_matter_is_grey_and_white_matter_white_whatever_their_numbers():
    usual = views.tissue_colours({1: "grey matter", 2: "white matter"}, two_tissues((1, 2)))
    of_freesurfer = views.tissue_colours({2: "white matter", 3: "grey matter"}, two_tissues((2, 3)))
    assert (usual[1], usual[2]) == (of_freesurfer[3], of_freesurfer[2]) == views.TISSUE_COLOURS[:2]


def test_other_tissues_have_colours_of_their_own():
    found = views.tissue_colours({7: "gel", 9: "white matter"}, two_tissues((7, 9)))
    assert found[7] not in (found[9], views.RESECTED)
    colours = views.element_colours(two_tissues((7, 9)), np.zeros(12, dtype=bool), {7: "gel", 9: "white matter"})
    assert set(colours) == set(found.values())


def test_a_tissue_has_its_colour_whatever_else_a_mesh_has():
    alone = views.tissue_colours({5: "gel"}, two_tissues((5, 5)))
    beside = views.tissue_colours({3: "gel", 2: "white matter"}, two_tissues((3, 2)))
    assert alone[5] == beside[3]
    both = views.tissue_colours({3: "gel", 2: "agar"}, two_tissues((3, 2)))
    assert both[3] != both[2]
