"""A new case folder, ready to run, from a segmentation or from a mesh."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from jinja2 import Environment

from warpbrain.atomic import check_new_folder, check_writable, whole_folder, write_text
from warpbrain.cases.building.label_fields import label_volumes, read_labels
from warpbrain.cases.building.labels import LabelMesh, mesh_labels
from warpbrain.cases.building.mmg import require_extra
from warpbrain.cases.building.node_sets import first_sets
from warpbrain.cases.building.tissue_names import (
    NO_TISSUE,
    RESECTION,
    VENTRICLE,
    Preset,
    assign,
    parse_names,
    preset,
    usual_name,
)
from warpbrain.cases.parts.anatomy import LARGEST_VOLUME, SMALLEST_VOLUME
from warpbrain.cases.parts.tissues import DENSITY, OTHER_MU
from warpbrain.errors import InputError
from warpbrain.frame import METRES, Frame
from warpbrain.mesh import Quality, TetMesh, components, measure, ordered, split_boundary, write_mesh
from warpbrain.mesh.regions import read_regions
from warpbrain.mesh.surface import face_vectors

CASE_FILE = "case.toml"
# how far the volume of a tissue may be from that of its labels before it is said
FAITHFUL = 0.10
# what share of the voxels of a tissue must lie in that tissue of the mesh before it is said that most do not
IN_PLACE = 0.5
#: Shear moduli [Pa] of the shipped cases, the paper's reference for its multi-tissue phantom.
MU = {"grey matter": 1370.0, "white matter": 1000.0}


@dataclass(frozen=True, eq=False)
class StartedCase:
    """What was written."""

    folder: Path
    mesh: TetMesh
    tissues: dict[int, str]  # names by number
    quality: Quality
    #: Of what was made from labels, for each tissue: volume [m3] of its labels, and the share of its voxels that lie in
    #: that tissue of the mesh.
    labelled: dict[int, float] | None
    in_place: dict[int, float] | None
    #: Volume [m3] of the closed cavities of the mesh, and of the labels of cavities.
    cavity: float
    labelled_cavity: float
    notes: tuple[str, ...]  # what was mended, left out or not reached

    @property
    def volumes(self) -> dict[int, float]:
        """Volume [m3] of each tissue in the mesh, by its number."""
        return {number: _tissue_volume(self.mesh, number) for number in self.tissues}


def start_from_labels(
    folder: Path,
    labels: Path,
    names: Sequence[str] = (),
    others: str | None = None,
    size: float | None = None,
    progress: Callable[[str], None] = lambda line: None,
    *,
    program: str | None = None,
    overwrite: bool = False,
) -> StartedCase:
    """Make a case folder from a label volume.

    `folder`: must not be there yet, or be empty, unless mesh and `case.toml` that are in it may be overwritten.
    `labels`: see `read_labels`.
    `names`, `others`: arguments of `--tissue`, see `parse_names`, and the name of every label that they leave out.
    `size`: wanted mean edge [mm]; by default what gives about 5,000 nodes.
    `progress`: called with one line of text whenever something is begun.
    `program`: whose labels they are, see `preset`; `names` take precedence, and labels that the volume lacks are no
    mistake.

    `InputError` if the folder is not empty, or anything is wrong with the labels or their names; nothing is written
    then.
    """
    _check_folder(folder, overwrite)
    if size is not None and not 0 < size < np.inf:
        raise InputError(f"--size: found {size:g}, expected a positive length [mm]")
    parse_names(names)  # what is wrong with them is known before anything is read
    usual = Preset({}, {}) if program is None else preset(program)
    require_extra(("mmgpy", "nibabel", "scipy", "meshio"))
    progress(f"reading {labels}")
    image = read_labels(labels)
    volumes = label_volumes(image)
    chosen = parse_names(names, volumes)
    for label in sorted(usual.unsure.keys() & volumes.keys() - chosen.keys()):
        raise InputError(f"{labels}: label {label}: {usual.unsure[label]}: say which with --tissue {label}=NAME")
    known = {label: name for label, name in usual.names.items() if label in volumes}
    if program is not None and not (known or chosen):
        raise InputError(
            f"{labels}: has none of the labels of --preset {program}; it has {', '.join(map(str, volumes))}"
        )
    named = known | chosen
    assignment = assign(volumes, named, others)
    made = mesh_labels(image, assignment, size, progress)
    notes = [*image.notes]
    if assignment.outside:
        out = ", ".join(f"{label} ({volumes[label] / 1000.0:.3g} cm3)" for label in assignment.outside)
        total = sum(volumes[label] for label in assignment.outside)
        unnamed = "" if others is None else f"; {len(set(volumes) - set(named))} of them are --others {others}"
        notes.append(f"outside the mesh: {total / 1000.0:.4g} cm3, labels {out}{unnamed}")
    notes += made.notes
    mesh, tissues = made.mesh, dict(assignment.tissues)
    cavity = _cavity_volume(mesh)
    notes += _unfaithful(made, tissues)
    if (wanted := made.labelled_cavity) > 0 and abs(cavity / wanted - 1) > FAITHFUL:
        notes.append(
            f"{VENTRICLE}: {_cm3(cavity)} closed in the mesh, {_cm3(wanted)} in the labels: it is in part thinner than "
            "an element, or opens to the outside; a smaller --size shows more of it"
        )
    _write(folder, mesh, tissues, labels, overwrite)
    return StartedCase(
        folder,
        mesh,
        tissues,
        measure(mesh),
        made.labelled,
        made.in_place,
        cavity,
        made.labelled_cavity,
        tuple(notes),
    )


def start_from_mesh(
    folder: Path,
    file: Path,
    frame: Frame,
    names: Sequence[str] = (),
    array: str | None = None,
    *,
    overwrite: bool = False,
) -> StartedCase:
    """Make a case folder from a volume mesh.

    `folder`, `names`, `overwrite`: as of `start_from_labels`; the labels are those of the mesh. `file`, `frame`: any
    tetrahedral mesh that meshio reads, with its unit and axes; its tissues are those of `read_regions`, its node and
    element sets are kept. `array`: cell array of the labels, where several could be it. `InputError` if the folder is
    not empty or the mesh cannot be used; nothing is written then.
    """
    _check_folder(folder, overwrite)
    parse_names(names)  # what is wrong with them is known before anything is read
    named = read_regions(file, frame.unit, array)
    raw = named.mesh
    _check_volume(file, raw.volume, frame.unit)
    pieces = int(components(raw.tetrahedra).max()) + 1
    if pieces > 1:
        raise InputError(f"{file}: expected one body, found {pieces} pieces that share no face")
    numbers = np.unique(raw.tissue).tolist()
    if numbers[0] < 0:
        raise InputError(f"{file}: expected tissue labels of 0 or more, found {numbers[0]}")
    given = parse_names(names, numbers)
    if absent := [str(label) for label in given if label not in numbers]:
        raise InputError(f"--tissue: the mesh has no tissue {', '.join(absent)}; it has {', '.join(map(str, numbers))}")
    called = dict(given)
    for label, name in named.names.items():
        if label in given:
            continue
        try:
            called[label] = usual_name(name)
        except InputError as error:
            raise InputError(f"{file}: {error}; --tissue {label}=NAME says what it is") from None
    for label, name in called.items():
        if name in NO_TISSUE:
            raise InputError(f"--tissue: {label}={name}: the cells of a mesh are all tissue, name what they are")
    points = raw.points * frame.signs
    notes = list(named.notes)
    if len(numbers) == 1 and array is None and not named.names:
        notes.append("one tissue: if there are more, --array names the cell array of their labels")
    sets = {**first_sets(points, raw.tetrahedra), **raw.node_sets}
    vectors = {name: values * frame.signs for name, values in raw.element_vectors.items()}
    mesh = ordered(TetMesh(points, raw.tetrahedra, raw.tissue, sets, raw.element_sets, vectors))
    tissues = {label: called.get(label, f"tissue {label}") for label in numbers}
    _write(folder, mesh, tissues, file, overwrite)
    return StartedCase(folder, mesh, tissues, measure(mesh), None, None, _cavity_volume(mesh), 0.0, tuple(notes))


def _check_folder(folder: Path, overwrite: bool) -> None:
    """`InputError` if a case cannot be begun there."""
    if overwrite and (folder / CASE_FILE).is_file():
        check_writable(folder / CASE_FILE)
        return
    try:
        check_new_folder(folder)
    except InputError as error:
        if (folder / CASE_FILE).is_file():
            raise InputError(f"{folder}: has a case already: choose another folder, or --overwrite it") from None
        raise error


def _write(folder: Path, mesh: TetMesh, tissues: Mapping[int, str], source: Path, overwrite: bool) -> None:
    if not mesh.node_sets["base"].any():
        raise InputError(f"{source}: found no outer nodes that face down in the lower third: is its z axis up?")
    if RESECTION in mesh.element_sets and mesh.element_sets[RESECTION].all():
        raise InputError(f"{source}: all tissue is a {RESECTION}, so that nothing is left: say by --tissue what stays")
    name = folder.resolve().name
    text = case_text(name, source.name, tissues, "ventricle" in mesh.node_sets, RESECTION in mesh.element_sets)
    if overwrite and (folder / CASE_FILE).is_file():
        # what its user wrote into it, and recordings, are not ours to lose
        (folder / CASE_FILE).replace(folder / f"{CASE_FILE}.old")
        write_mesh(folder / "mesh.vtu", mesh, unit="mm")
        write_text(folder / CASE_FILE, text)
        return
    with whole_folder(folder) as place:
        write_mesh(place / "mesh.vtu", mesh, unit="mm")
        (place / CASE_FILE).write_text(text, encoding="utf-8")
        (place / "recordings").mkdir()


def _check_volume(file: Path, volume: float, unit: str) -> None:
    """`InputError` if a volume [m3], of lengths read in a unit of `METRES`, is no body's: says which unit would do."""
    if SMALLEST_VOLUME < volume < LARGEST_VOLUME:
        return
    hint = "are its lengths in millimetres?"
    for other, metres in METRES.items():
        meant = volume * (metres / METRES[unit]) ** 3
        if SMALLEST_VOLUME < meant < LARGEST_VOLUME:
            hint = f"in {other} it would be {_cm3(meant)}: --units {other}"
    expected = f"{_cm3(SMALLEST_VOLUME).removesuffix(' cm3')} to {_cm3(LARGEST_VOLUME)}"
    raise InputError(f"{file}: the mesh has a volume of {_cm3(volume)} in {unit}, expected {expected}; {hint}")


def _cm3(volume: float) -> str:
    """A volume [m3] as users read it."""
    return f"{volume * 1e6:.4g} cm3"


def _unfaithful(made: LabelMesh, tissues: Mapping[int, str]) -> list[str]:
    """What to say about tissues that the mesh shows with another volume, or elsewhere."""
    notes = []
    for number, name in tissues.items():
        wanted, got = made.labelled[number], _tissue_volume(made.mesh, number)
        if abs(got / wanted - 1) > FAITHFUL:
            notes.append(
                f"{name}: {_cm3(got)} in the mesh, {_cm3(wanted)} in the labels ({100 * (got / wanted - 1):+.0f} %): "
                "parts are thinner than an element; a smaller --size shows more of them"
            )
        elif made.in_place[number] < IN_PLACE:
            notes.append(f"{name}: most of its voxels are thinner than an element and lie in other tissue in the mesh")
    return notes


def _tissue_volume(mesh: TetMesh, number: int) -> float:
    return float(mesh.volumes[mesh.tissue == number].sum())


def case_text(name: str, source: str, tissues: Mapping[int, str], cavities: bool, resected: bool = False) -> str:
    """Text of a `case.toml` that can be run as it is, made from `new_case.txt`: of a mesh that was made from the file
    `source`, names of its tissues by number, whether it has the node set `ventricle`, and the element set `resection`,
    which is then taken out."""
    environment = Environment(trim_blocks=True, keep_trailing_newline=True)
    # a string as TOML writes it: as JSON does, but for one control character that JSON leaves alone
    environment.filters["quoted"] = lambda text: json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    template = environment.from_string((files("warpbrain.cases") / "new_case.txt").read_text(encoding="utf-8"))
    return template.render(
        name=name, source=source, tissues=tissues, cavities=cavities, resected=resected, moduli=MU, other=OTHER_MU,
        density=DENSITY,
    )  # fmt: skip


def _cavity_volume(mesh: TetMesh) -> float:
    """Volume [m3] that the closed surfaces inside exclude."""
    xyz = mesh.points - mesh.points.mean(axis=0)
    walls = split_boundary(mesh.points, mesh.tetrahedra)[1]
    # by the divergence theorem; normals point into the cavity
    return -sum(float((xyz[wall[:, 0]] * face_vectors(xyz, wall)).sum()) / 3 for wall in walls) if walls else 0.0
