"""What a `TetMesh` accepts, refuses, and answers."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.mesh import MeshError, TetMesh

CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TWO = np.vstack([CORNER, [[1.0, 1, 1]]])
TWO_TETS = [[0, 1, 2, 3], [1, 2, 3, 4]]


def two() -> TetMesh:
    return TetMesh(
        TWO,
        TWO_TETS,
        [1, 2],
        {"low": TWO[:, 2] == 0, "far": TWO.sum(axis=1) > 2},
        {"first": np.array([True, False])},
    )


def test_volumes():
    mesh = two()
    np.testing.assert_allclose(mesh.volumes, [1 / 6, 1 / 3])
    assert mesh.volume == pytest.approx(0.5)


def test_tissue_defaults_to_one():
    assert TetMesh(CORNER, [[0, 1, 2, 3]]).tissue.tolist() == [1]


def test_labels_are_those_of_the_tissue_that_is_there():
    assert two().labels == (1, 2)
    assert two().without(np.array([True, False]))[0].labels == (2,)


def test_arrays_are_copied_and_cannot_be_written():
    points = CORNER.copy()
    mesh = TetMesh(points, [[0, 1, 2, 3]])
    points[0] = 9
    assert mesh.points[0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0] = 9


def test_pickles():
    mesh = pickle.loads(pickle.dumps(two()))
    assert mesh.node_sets["far"].tolist() == two().node_sets["far"].tolist()


def test_without_restricts_everything():
    mesh, node_ids, element_ids = two().without(np.array([True, False]))
    assert node_ids.tolist() == [1, 2, 3, 4]
    assert element_ids.tolist() == [1]
    assert mesh.tissue.tolist() == [2]
    np.testing.assert_array_equal(mesh.points, TWO[1:])
    assert mesh.node_sets["far"].tolist() == [False, False, False, True]
    assert mesh.element_sets["first"].tolist() == [False]


def test_without_nothing_is_the_same_mesh():
    mesh, node_ids, _ = two().without(np.zeros(2, dtype=bool))
    np.testing.assert_array_equal(mesh.tetrahedra, two().tetrahedra)
    assert len(node_ids) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": TWO[:, :2]}, "points must have shape"),
        ({"points": np.where(TWO == 1, np.nan, TWO)}, "4 node(s) with a coordinate that is not finite: node 1"),
        ({"points": np.vstack([TWO, [[5, 5, 5]]])}, "1 node(s) belong to no tetrahedron: node 5"),
        ({"tetrahedra": np.zeros((0, 4), dtype=int)}, "empty"),
        ({"tetrahedra": [[0, 1, 2]]}, "tetrahedra must have shape"),
        ({"tetrahedra": [[0, 1, 2, 3], [1, 2, 3, 7]]}, "tetrahedron 1; the first has nodes [1, 2, 3, 7]"),
        ({"tetrahedra": [[0, 1, 2, 3], [1, 2, 3, -1]]}, "does not exist"),
        ({"tetrahedra": [[0, 1, 2, 3], [1, 2, 4, 4]]}, "1 tetrahedra name a node twice: tetrahedron 1"),
        ({"tetrahedra": [[0, 2, 1, 3], [1, 2, 3, 4]]}, "1 tetrahedra are inverted (negative volume): tetrahedron 0"),
        ({"points": np.vstack([CORNER, [[1 / 3] * 3]])}, "1 tetrahedra have zero volume: tetrahedron 1"),
        ({"tetrahedra": [[0.0, 1.0, 2.0, 3.5]]}, "whole numbers"),
        ({"tissue": [1]}, "tissue has shape (1,)"),
        ({"tissue": [1.5, 2]}, "whole numbers"),
        ({"node_sets": {"cap": np.ones(4, dtype=bool)}}, "node set 'cap' has shape (4,), expected (5,)"),
        ({"node_sets": {"cap": np.arange(5)}}, "node set 'cap' must be a boolean array"),
        ({"element_sets": {"cut": np.ones(5, dtype=bool)}}, "element set 'cut' has shape (5,), expected (2,)"),
    ],
)
def test_refuses(change, message):
    parts = {"points": TWO, "tetrahedra": TWO_TETS, **change}
    with pytest.raises(MeshError) as error:
        TetMesh(**parts)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert isinstance(error.value, InputError)


def test_long_lists_are_cut_short():
    with pytest.raises(MeshError, match=r"0, 1, 2, 3, 4, \.\.\. \(12 in all\)"):
        TetMesh(np.full((12, 3), np.inf), [[0, 1, 2, 3]])


def test_without_refuses_wrong_masks():
    with pytest.raises(MeshError, match="leaves no mesh"):
        two().without(np.ones(2, dtype=bool))
    with pytest.raises(MeshError, match="boolean array of shape"):
        two().without(np.array([0, 1]))


def test_import_is_cheap():
    code = "import sys, warpbrain.mesh; print([m for m in ('meshio', 'pyvista', 'scipy', 'warp') if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.strip() == "[]"


def test_other_node_sets_share_what_is_known():
    mesh = two()
    volumes, boundary = mesh.volumes, mesh.boundary
    other = mesh.with_node_sets({"high": TWO[:, 2] > 0.5})
    assert list(other.node_sets) == ["high"]
    assert list(mesh.node_sets) == ["low", "far"]
    assert other.volumes is volumes
    assert other.boundary is boundary
    with pytest.raises(MeshError, match="node set 'high' has shape"):
        mesh.with_node_sets({"high": np.ones(3, dtype=bool)})
    with pytest.raises(ValueError, match="read-only"):
        other.node_sets["high"][0] = True


def test_what_is_asked_again_and_again_is_made_once():
    mesh, asked = two(), []

    def volumes(times: float) -> np.ndarray:
        def make() -> np.ndarray:
            asked.append(times)
            return times * mesh.volumes

        return mesh.with_node_sets({}).made_once(("volumes", times), make)

    assert volumes(2.0) is volumes(2.0)
    with pytest.raises(ValueError, match="read-only"):
        volumes(2.0)[0] = 1.0
    for times in range(3, 12):
        np.testing.assert_array_equal(volumes(times), times * mesh.volumes)
    # only the last ones are kept
    np.testing.assert_array_equal(volumes(2.0), 2.0 * mesh.volumes)
    assert asked == [2.0, *range(3, 12), 2.0]


def test_the_same_part_is_taken_out_once():
    mesh = two()
    first, second = np.array([True, False]), np.array([False, True])
    left = mesh.without(first)
    assert mesh.without(first.copy())[0] is left[0]
    assert mesh.without(second)[0].node_sets["far"].tolist() == [False, False, False, False]
    assert mesh.without(first)[0].node_sets["far"].tolist() == [False, False, False, True]
    # sets of nodes are those of whoever asks
    other = mesh.with_node_sets({"high": TWO[:, 2] > 0.5})
    assert {name: own.tolist() for name, own in other.without(first)[0].node_sets.items()} == {
        "high": [False, False, True, True]
    }
    assert set(mesh.without(first)[0].node_sets) == {"low", "far"}
