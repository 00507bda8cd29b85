"""Tetrahedral meshes: the body, its surfaces, its quality, and the files it is kept in.

Importing this package costs NumPy and nothing else; SciPy and meshio are imported by the functions that need them.
"""

from warpbrain.mesh.files import MeshInFile, read_mesh, read_mesh_file, write_mesh
from warpbrain.mesh.free_surfaces import faces_of, vertex_normals, wall_nodes
from warpbrain.mesh.half_space import integrals_above, integrals_of_shapes, integrals_on_plane, summed_at_nodes
from warpbrain.mesh.integrals import surface_forces, volume_forces
from warpbrain.mesh.patches import patch_around
from warpbrain.mesh.quadratic import QuadraticMesh
from warpbrain.mesh.quality import Quality, components, dihedral_angles, measure
from warpbrain.mesh.surface import (
    boundary_faces,
    closed_surfaces,
    face_vectors,
    interface_faces,
    node_areas,
    node_vectors,
    nodes_of,
    pinched_nodes,
    rim_edges,
    split_boundary,
    tangents,
)
from warpbrain.mesh.tet_mesh import MeshError, TetMesh, ordered

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
    "faces_of",
    "integrals_above",
    "integrals_of_shapes",
    "integrals_on_plane",
    "interface_faces",
    "measure",
    "node_areas",
    "node_vectors",
    "nodes_of",
    "ordered",
    "patch_around",
    "pinched_nodes",
    "read_mesh",
    "read_mesh_file",
    "rim_edges",
    "split_boundary",
    "summed_at_nodes",
    "surface_forces",
    "tangents",
    "vertex_normals",
    "volume_forces",
    "wall_nodes",
    "write_mesh",
]
