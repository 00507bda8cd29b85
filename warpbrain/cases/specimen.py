"""A laboratory specimen: its shape, and the mesh of that shape."""

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.mesh import TetMesh, boundary_faces, nodes_of
from warpbrain.mesh.tet_mesh import signed_volumes

#: Strain at rest of each mode of a test: a stretch of 1, a shear of 0.
REST = {"axial": 1.0, "shear": 0.0, "torsion": 0.0, "confined": 1.0, "biaxial": 1.0}
#: Elements along the longest side of a block, and along the diameter of a cylinder.
CELLS = 12
# a cube is cut into six tetrahedra around one of its diagonals, the same way in every cube, so that faces match
_SIX = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])


@dataclass(frozen=True)
class Specimen:
    """What `[specimen]` says, in SI units."""

    shape: str  # "cylinder" or "block"
    size: tuple[float, float, float]  # extent along x, y and z [m]; a cylinder's axis is z
    grips: str  # whether its ends, the sets `bottom` and `top`, can widen: "glued" or "lubricated"

    @property
    def radius(self) -> float:
        """Radius [m] of the circle that is as large as an end."""
        x, y, _ = self.size
        return 0.5 * x if self.shape == "cylinder" else float(np.sqrt(x * y / np.pi))

    def strain_of(self, mode: str, quantity: str, imposed: Floats) -> Floats:
        """Stretch or shear (n,), of torsion at the rim, of what was imposed (n,)."""
        if quantity == "stretch":
            return imposed
        return REST[mode] + imposed * (self.radius if mode == "torsion" else 1.0) / self.size[2]

    def stress_unit(self, quantity: str) -> float:
        """Nominal stress [Pa], of torsion the torque over `int r dA`, of one unit of what a test answers."""
        r = self.radius
        return {"stress": 1.0, "force": 1.0 / (np.pi * r**2), "torque": 1.5 / (np.pi * r**3)}[quantity]

    def mesh(self) -> TetMesh:
        """The shape in tetrahedra, z from 0, centred on the z axis.

        Node sets: ``bottom`` and ``top``, the ends; ``side``, the rest of the surface.
        """
        size = np.array(self.size)
        if self.shape == "cylinder":
            unit, tetrahedra = _cylinder(CELLS // 2, max(2, round(CELLS * size[2] / size[0])))
        else:
            unit, tetrahedra = _block([max(2, round(CELLS * length / size.max())) for length in size])
        bottom, top = unit[:, 2] == 0.0, unit[:, 2] == 1.0
        side = nodes_of(boundary_faces(tetrahedra), len(unit)) & ~bottom & ~top
        sets = {"bottom": bottom, "top": top, "side": side}
        return TetMesh(unit * size, tetrahedra, node_sets=sets)  # type: ignore[arg-type]  # TetMesh converts


def _block(cells: list[int]) -> tuple[Floats, Ints]:
    """A unit cube about the z axis: nodes on a regular grid, six tetrahedra a cell."""
    i, j, k = np.meshgrid(*(np.arange(n + 1) for n in cells), indexing="ij")
    points = np.stack([i / cells[0] - 0.5, j / cells[1] - 0.5, k / cells[2]], axis=-1).reshape(-1, 3)
    number = np.arange(i.size).reshape(i.shape)
    ends = [(slice(None, -1), slice(1, None))] * 3
    corners = [number[x, y, z].ravel() for z in ends[2] for y in ends[1] for x in ends[0]]
    return points, np.stack(corners, axis=1)[:, _SIX].reshape(-1, 4)


def _cylinder(rings: int, layers: int) -> tuple[Floats, Ints]:
    """A cylinder of diameter 1 and height 1: rings of 6, 12, 18, ... nodes, in layers of prisms."""
    from scipy.spatial import Delaunay

    disc = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        angle = 2.0 * np.pi * np.arange(6 * ring) / (6 * ring)
        disc.append(0.5 * ring / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    sides = 6 * rings
    # the polygon has the circle's area, so that a force over it is the right stress
    flat = np.concatenate(disc) * np.sqrt(np.pi / (0.5 * sides * np.sin(2.0 * np.pi / sides)))
    count = len(flat)
    points = np.concatenate([np.column_stack([flat, np.full(count, k / layers)]) for k in range(layers + 1)])
    # corners in the order of their numbers: each side of a prism is then cut along the same diagonal as its neighbour's
    a, b, c = np.sort(Delaunay(flat).simplices, axis=1).T.astype(np.int64)
    prism = np.stack([(a, b, c, c + count), (a, b, c + count, b + count), (a, a + count, b + count, c + count)])
    layer = prism.transpose(2, 0, 1).reshape(-1, 4)
    tetrahedra = (layer + count * np.arange(layers)[:, None, None]).reshape(-1, 4)
    inverted = signed_volumes(points, tetrahedra) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 1, 3, 2]]
    return points, tetrahedra
