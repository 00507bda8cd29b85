"""Tetrahedral meshes: the body, its surfaces, its quality, and the files it is kept in.

Importing this package costs NumPy and nothing else; SciPy and meshio are imported by the functions that need them.
"""

from warpbrain.mesh.files import MeshInFile as MeshInFile
from warpbrain.mesh.files import read_mesh as read_mesh
from warpbrain.mesh.files import read_mesh_file as read_mesh_file
from warpbrain.mesh.files import write_mesh as write_mesh
from warpbrain.mesh.free_surfaces import faces_of as faces_of
from warpbrain.mesh.free_surfaces import vertex_normals as vertex_normals
from warpbrain.mesh.free_surfaces import wall_nodes as wall_nodes
from warpbrain.mesh.half_space import integrals_above as integrals_above
from warpbrain.mesh.half_space import integrals_of_shapes as integrals_of_shapes
from warpbrain.mesh.half_space import integrals_on_plane as integrals_on_plane
from warpbrain.mesh.half_space import summed_at_nodes as summed_at_nodes
from warpbrain.mesh.integrals import surface_forces as surface_forces
from warpbrain.mesh.integrals import volume_forces as volume_forces
from warpbrain.mesh.patches import patch_around as patch_around
from warpbrain.mesh.quadratic import QuadraticMesh as QuadraticMesh
from warpbrain.mesh.quality import Quality as Quality
from warpbrain.mesh.quality import components as components
from warpbrain.mesh.quality import dihedral_angles as dihedral_angles
from warpbrain.mesh.quality import measure as measure
from warpbrain.mesh.surface import boundary_faces as boundary_faces
from warpbrain.mesh.surface import closed_surfaces as closed_surfaces
from warpbrain.mesh.surface import face_vectors as face_vectors
from warpbrain.mesh.surface import interface_faces as interface_faces
from warpbrain.mesh.surface import node_areas as node_areas
from warpbrain.mesh.surface import node_vectors as node_vectors
from warpbrain.mesh.surface import nodes_of as nodes_of
from warpbrain.mesh.surface import pinched_nodes as pinched_nodes
from warpbrain.mesh.surface import rim_edges as rim_edges
from warpbrain.mesh.surface import split_boundary as split_boundary
from warpbrain.mesh.surface import tangents as tangents
from warpbrain.mesh.tet_mesh import MeshError as MeshError
from warpbrain.mesh.tet_mesh import TetMesh as TetMesh
from warpbrain.mesh.tet_mesh import ordered as ordered
