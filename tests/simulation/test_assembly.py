"""What systems of one mesh share: the same arrays, and the same bits as of a mesh of its own."""

import numpy as np
from bodies import matrix_of, model_of
from shapes import cube, distorted

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def body(points, tetrahedra, sets) -> TetMesh:
    return TetMesh(points, tetrahedra, None, sets)


def assembled(mesh: TetMesh, modulus: float, mechanisms=()) -> System:
    system = System(model_of(mesh, Material(NeoHookean(modulus)), mechanisms=mechanisms), "cpu")
    system.u.assign(1e-3 * np.random.default_rng(1).normal(size=(system.size, 3)))
    system.evaluate_tangents()
    system.gather_forces()
    system.assemble(1.0, 0.0)
    return system


def test_systems_of_one_mesh_share_what_no_number_changes():
    shape = distorted(cube(2), 0.03)
    sets = {"top": shape.points[:, 2] > 0.9}
    mesh = body(shape.points, shape.tetrahedra, sets)
    first, second = assembled(mesh, 100.0), assembled(mesh, 700.0)
    assert second.inverse_edges is first.inverse_edges
    assert second.matrix.columns is first.matrix.columns
    assert second.matrix.values.ptr != first.matrix.values.ptr
    pressed = (Pressure(nodes="top", value=50.0),)
    third = assembled(mesh, 700.0, pressed)
    # another family of stencils is another pattern, as on a mesh that nobody has placed yet
    assert third.contributions is not first.contributions
    for system, mechanisms in ((second, ()), (third, pressed)):
        alone = assembled(body(shape.points, shape.tetrahedra, sets), 700.0, mechanisms)
        np.testing.assert_array_equal(system.internal.numpy(), alone.internal.numpy())
        np.testing.assert_array_equal(matrix_of(system).toarray(), matrix_of(alone).toarray())
