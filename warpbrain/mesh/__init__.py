"""Tetrahedral meshes: the body, its surfaces, its quality, and the files it is kept in.

Importing this package costs NumPy and nothing else; SciPy and meshio are imported by the functions that need them.
"""

from warpbrain.mesh.files import MeshInFile, read_mesh, read_mesh_file, write_mesh
from warpbrain.mesh.half_space import integrals_above, integrals_of_shapes, integrals_on_plane, summed_at_nodes
from warpbrain.mesh.integrals import surface_forces, volume_forces
from warpbrain.mesh.ordering import ordered
from warpbrain.mesh.quadratic import QuadraticMesh
from warpbrain.mesh.quality import Quality, components, dihedral_angles, measure
from warpbrain.mesh.surface import (
    boundary_faces,
    closed_surfaces,
    face_vectors,
    interface_faces,
    node_areas,
    nodes_of,
    pinched_nodes,
    split_boundary,
    tangents,
    vertex_normals,
)
from warpbrain.mesh.tet_mesh import MeshError, TetMesh

__all__ = [
    "MeshError",
    "MeshInFile",
    "QuadraticMesh",
    "Quality",
    "TetMesh",
    "boundary_faces",
    "closed_surfaces",
    "components",
    "dihedral_angles",
    "face_vectors",
    "integrals_above",
    "integrals_of_shapes",
    "integrals_on_plane",
    "interface_faces",
    "measure",
    "node_areas",
    "nodes_of",
    "ordered",
    "pinched_nodes",
    "read_mesh",
    "read_mesh_file",
    "split_boundary",
    "summed_at_nodes",
    "surface_forces",
    "tangents",
    "vertex_normals",
    "volume_forces",
    "write_mesh",
]
