"""A conforming mesh of a segmentation: lattice, cuts along every surface, MMG, and what each step left out."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.building.cleaning import crumbs_given_away, cut_body, finished
from warpbrain.cases.building.label_fields import CAVITY, LabelFields, make_fields, make_regions
from warpbrain.cases.building.lattice import bcc_lattice, cut
from warpbrain.cases.building.mmg import Cells, remesh
from warpbrain.cases.building.node_sets import first_sets
from warpbrain.cases.building.tissue_names import RESECTION, Assignment
from warpbrain.errors import InputError
from warpbrain.images.reading import Image
from warpbrain.mesh import TetMesh, ordered
from warpbrain.mesh.quality import mean_edge

# nodes of a mesh whose size is not given: about what the shipped cases have
NODES = 5000
# of a finished mesh: tetrahedra a node, and their mean volume as a share of the cubed mean edge
TETRAHEDRA_A_NODE = 5.0
TETRAHEDRON = 0.0953
# of the element size: spacing of the lattice, largest edge of the pass that takes out needles, and first guess of the
# largest edge that gives this mean edge
LATTICE = 0.75
FIRST_EDGE = 0.9
LARGEST_EDGE = 1.3
# pieces smaller than this many cubed element sizes go to what surrounds them
CRUMB = 2.0
# more are no mistake in principle, but take hours and more memory than there is
MOST_NODES = 300_000
FEWEST_NODES = 60
# how near the mean edge must come to what is wanted, and how often that is tried, each time a little off the last
NEAR = 0.06
TRIALS = 16
STEP = 0.012
# how many lattices are tried
LATTICES = 6
# where to look [element sizes] for what lies beyond an outer face
BEYOND = 0.4
# by how many degrees the bars for the angles may be missed if no trial clears them
EASIER = 7.0


@dataclass(frozen=True, eq=False)
class LabelMesh:
    """A mesh made from labels."""

    mesh: TetMesh  # with numbers of the assignment, `first_sets`, and what is called `RESECTION` as an element set
    #: Volume [m3] of the labels of each tissue, by number, and of the cavities.
    labelled: dict[int, float]
    labelled_cavity: float
    #: Share of the voxels of each tissue that lie in that tissue of the mesh, before the cutting.
    in_place: dict[int, float]
    notes: tuple[str, ...]  # what was mended, left out or not reached


def mesh_labels(
    image: Image, assignment: Assignment, size: float | None = None, progress: Callable[[str], None] = lambda line: None
) -> LabelMesh:
    """Mesh a segmentation with a wanted mean edge [mm], by default one that gives about 5,000 nodes.

    `InputError` if the labels cannot be those of a brain, the size does not suit them, or no good mesh is found.
    """
    regions = make_regions(image, assignment)
    tissue_volume = regions.grid.voxel_volume * float(((regions.codes != 0) & (regions.codes != CAVITY)).sum())
    if tissue_volume == 0:
        raise InputError(f"{image.path}: no tissue is left in the largest piece of the labels")
    chosen = _size_of(tissue_volume, NODES) if size is None else size
    nodes = tissue_volume / (TETRAHEDRA_A_NODE * TETRAHEDRON * chosen**3)
    if nodes > MOST_NODES:
        least = _size_of(tissue_volume, MOST_NODES)
        raise InputError(
            f"--size {chosen:g}: about {nodes:.2g} nodes; {least:.2g} mm would be {MOST_NODES}, the most here"
        )
    if nodes < FEWEST_NODES:
        tissue, most = f"{tissue_volume / 1000:.3g} cm3 of tissue", _size_of(tissue_volume, FEWEST_NODES)
        raise InputError(f"--size {chosen:g}: too large for {tissue}: at most {most:.2g} mm")
    progress(f"smoothing the labels for elements of {chosen:.3g} mm")
    fields = make_fields(regions, chosen)
    progress("cutting the lattice along the surfaces")
    cells, lattice_notes = _without_needles(fields, assignment, chosen)
    notes = [*regions.notes, *lattice_notes]
    progress("meshing")
    made = _made(cells, chosen, notes)

    def opens(centres: Floats, normals: Floats) -> Bools:
        """Whether outer faces are walls of a cavity that opens to the outside."""
        beyond = centres + BEYOND * chosen * normals
        cavity, body = (fields.grid.sampled(field, beyond) for field in (fields.cavity, fields.body))
        return (cavity > 0) & (body > 0)

    numbers = np.array([0, *assignment.tissues], dtype=np.int32)[made.labels]
    resected = [number for number, name in assignment.tissues.items() if name == RESECTION]
    taken = {RESECTION: np.isin(numbers, resected)} if resected else {}
    sets = first_sets(made.points, made.tetrahedra, opens)
    return LabelMesh(
        ordered(TetMesh(made.points * 1e-3, made.tetrahedra.astype(np.int32), numbers, sets, taken)),
        {number: 1e-9 * regions.labelled.get(code, 0.0) for code, number in enumerate(assignment.tissues, 1)},
        1e-9 * regions.labelled.get(CAVITY, 0.0),
        {number: fields.in_place.get(code, 0.0) for code, number in enumerate(assignment.tissues, 1)},
        tuple(notes),
    )


def _size_of(volume: float, nodes: float) -> float:
    """Size [mm] of elements that fill a volume [mm3] with so many nodes."""
    return float((volume / (nodes * TETRAHEDRA_A_NODE * TETRAHEDRON)) ** (1 / 3))


def _without_needles(fields: LabelFields, assignment: Assignment, size: float) -> tuple[Cells, list[str]]:
    """The cut lattice without the needles that cutting leaves, and what is to be noted of it."""
    for trial in range(LATTICES):
        notes: list[str] = []
        cut_lattice = _discretised(fields, assignment, size, LATTICE * size * (1 - trial * STEP), notes)
        # MMG gives up on some lattices and not on one that is a little finer
        if (cells := remesh(cut_lattice, FIRST_EDGE * size)) is not None:
            return cells, notes
    raise InputError(f"MMG could not mesh the labels with elements of about {size:.3g} mm: try another --size")


def _discretised(fields: LabelFields, assignment: Assignment, size: float, spacing: float, notes: list[str]) -> Cells:
    """The lattice cut along every surface; labels are 1, 2, ... in the order of the assignment."""
    crumb = CRUMB * size**3
    sampled = fields.grid.sampled
    body_voxels = fields.grid.positions(np.argwhere(fields.body > 0))
    lower, upper = body_voxels.min(axis=0), body_voxels.max(axis=0)
    points, tetrahedra = bcc_lattice(lower - 1.5 * spacing, upper + 1.5 * spacing, spacing)
    # its least value is that of the far outside
    near = sampled(fields.body, points)[tetrahedra].max(axis=1) > 0.8 * float(fields.body.min())
    cells = Cells(points, tetrahedra, np.zeros(len(tetrahedra), dtype=np.int64))
    cells = cells.part(near).compact()
    cells = cut_body(cells, partial(sampled, fields.body), partial(sampled, fields.cavity), crumb, notes)
    for code in range(1, len(fields.tissues)):
        ahead = fields.tissues[code - 1] - np.max(fields.tissues[code:], axis=0)
        cells, first = cut(cells, partial(sampled, ahead))
        cells.labels[first & (cells.labels == 0)] = code
    cells.labels[cells.labels == 0] = len(fields.tissues)
    labels = crumbs_given_away(cells, crumb)
    for code, name in enumerate(assignment.tissues.values(), start=1):
        if not (labels == code).any():
            raise InputError(
                f"'{name}' is too small or thin for elements of {size:.3g} mm: choose a smaller --size, or give its "
                "labels to another tissue"
            )
    return replace(cells, labels=labels).compact()


def _made(cells: Cells, size: float, notes: list[str]) -> Cells:
    """A good mesh whose mean edge is about the wanted size, or else one that is nearly good."""
    nearly: Cells | None = None
    edge = LARGEST_EDGE * size
    for trial in range(TRIALS):
        made, ratio = remesh(cells, edge), 1.0
        if made is not None:
            ratio = mean_edge(made.points, made.tetrahedra) / size
        if abs(ratio - 1) < NEAR:
            if made is not None:
                if (done := finished(made, cavities=None)) is not None:
                    return done
                nearly = nearly or finished(made, cavities=None, easier=EASIER)
            # MMG gives up, or leaves a needle, at some sizes and not at their neighbours
            edge *= 1 - STEP if trial % 2 else 1 + 0.7 * STEP
        else:
            edge /= min(max(ratio, 0.6), 1.6)
    if nearly is None:
        raise InputError(f"MMG found no good mesh with elements of about {size:.3g} mm: try another --size")
    notes.append("some elements are sharper than those of the shipped meshes: another --size may do better")
    return nearly
