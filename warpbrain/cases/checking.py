"""Checks a case completely: what is wrong with it, how good its mesh is, what a person should look at again, and
whether its recordings hold enough numbers: the one count that all commands share."""

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.cases.boundary import Displaced, Fixed, Forced
from warpbrain.cases.case import Case
from warpbrain.cases.reading import examine_case
from warpbrain.errors import require_kind
from warpbrain.mesh import Quality, faces_of, measure
from warpbrain.mesh.quality import extent
from warpbrain.physics.load import Load
from warpbrain.problems import Problem, Problems
from warpbrain.recordings.points import distinct_rows
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording
from warpbrain.recordings.times import compared_rows

#: Volumes [cm3] of brains without their ventricles: the paper's Table 4 has 1060 to 1609; heads differ.
BRAIN = (800.0, 1800.0)
#: Shear moduli [Pa] of soft tissue and gels; published ones for brain are 80 to 15 000 Pa (literature.md, table).
SOFT = (20.0, 100_000.0)
#: Displacement [m] beyond any brain shift: the largest published ones are 25 mm (Miga et al. 2016).
LARGEST_SHIFT = 0.05
#: Displacement [m] that nobody would record: a tenth of the best tracking.
SMALLEST_SHIFT = 1e-5
#: What a case without loads should be told, before it is run.
NOTHING_ACTS = (
    "nothing acts: no [[boundary]] moves, pushes or presses and no [[mechanism]] loads the body, so that a run leaves "
    "it as it is; --with or case.toml can add what is assumed"
)
#: Dihedral angles [degrees] below which elements make a solver slow and stresses wrong.
SHARP = 5.0


@dataclass(frozen=True)
class Checked:
    """What checking found."""

    file: Path
    problems: tuple[Problem, ...]  # what is wrong: the case cannot be used
    remarks: tuple[str, ...]  # what is allowed and should be looked at
    case: Case | None  # as far as it could be read
    quality: Quality | None  # of its mesh
    plausible: str  # a word on its volume


def check_case(file: str | os.PathLike[str]) -> Checked:
    """Check a `case.toml` with everything that it names.

    Parameters
    ----------
    file : path
        A `case.toml`, or the folder that holds it.
    """
    require_kind(file, (str, os.PathLike), "file", "the path of a case.toml or its folder")
    file = Path(file)
    problems = Problems()
    case = examine_case(file, problems)
    remarks = list(problems.remarks)
    quality, plausible = None, ""
    if case is not None:
        quality = measure(case.mesh)
        plausible = volume_word(1e6 * quality.volume)
        remarks += _look_again(case, quality)
        if not problems:
            remarks += _nothing_there(case)
    return Checked(file, tuple(problems.found), tuple(remarks), case, quality, plausible)


def volume_word(cm3: float) -> str:
    """What a volume [cm3] may be."""
    if BRAIN[0] <= cm3 <= BRAIN[1]:
        return "plausible for a whole brain without its ventricles"
    if cm3 < 20.0:
        return "a specimen? A whole brain has about 1000 to 1600 cm3"
    if cm3 < BRAIN[0]:
        return "small for a whole brain (about 1000 to 1600 cm3): a child's, a part or a phantom?"
    return "large for a brain (about 1000 to 1600 cm3): are the units right, is the skull in it?"


def _look_again(case: Case, quality: Quality) -> list[str]:
    remarks = []
    if quality.min_dihedral < SHARP:
        remarks.append(
            f"the sharpest tetrahedron has a dihedral angle of {quality.min_dihedral:.2g} degrees: it slows the solver "
            "and spoils the stress around it"
        )
    small = {label: n for label, n in quality.tissue_components.items() if n > 20}
    if small:
        label, count = next(iter(small.items()))
        remarks.append(f"tissue {label} is in {count} pieces: a noisy segmentation?")
    for label, tissue in sorted(case.tissues.items()):
        mu = tissue.law.shear_modulus if tissue.law is not None else None
        if mu is not None and not SOFT[0] <= mu <= SOFT[1]:
            kilo = f"; {mu:g} kPa is {1000.0 * mu:g} Pa" if mu < SOFT[0] else ""
            remarks.append(f"[tissue.{label}] shear modulus {mu:g} Pa: not that of soft tissue{kilo}")
    size = extent(case.mesh.points)
    for recording in case.recordings:
        if not isinstance(recording, PointsRecording):
            continue
        largest = float(np.linalg.norm(recording.displacement, axis=1).max())
        if largest > min(LARGEST_SHIFT, 0.5 * size):
            remarks.append(f"recording '{recording.name}': a point moves {1000.0 * largest:.3g} mm: is the unit right?")
        if largest < SMALLEST_SHIFT:
            remarks.append(f"recording '{recording.name}': no point moves more than {1000.0 * largest:.2g} mm")
        starts = zip(recording.ids or (), recording.points.tolist(), strict=recording.ids is not None)
        # an id that has more than one: the place at the time was given where the first place belongs
        if len({(name, *place) for name, place in starts}) > len(set(recording.ids or ())):
            remarks.append(f"recording '{recording.name}': one id starts at several places; x, y, z are where it began")
        if len(np.unique(recording.points, axis=0)) < len(recording.points) and recording.time is None:
            remarks.append(f"recording '{recording.name}': a point is recorded twice")
    return remarks


def remarks_on_loads(case: Case) -> list[str]:
    """Remarks on loads: that none acts, implausible parameters, and what part of a load acts on nodes that are held."""
    mesh = case.remaining[0]
    moving, held = [], np.zeros(len(mesh.points), dtype=bool)
    for boundary in case.boundaries:
        if isinstance(boundary, Fixed | Displaced):
            held |= mesh.node_sets[boundary.nodes]
        else:
            moving.append((f"[[boundary]] '{boundary.name}'", boundary.nodes, isinstance(boundary, Forced)))
    for mechanism in case.mechanisms:
        for name, spec in mechanism.parameters().items():
            # one without which all of the surface is meant is no place of a load
            if spec.kind == "node set" and not spec.absent and (nodes := getattr(mechanism, name)):
                moving.append((mechanism.kind, nodes, isinstance(mechanism, Load)))
    remarks = [NOTHING_ACTS] if case.nothing_acts else []
    remarks += [f"{each.kind}: {doubt}" for each in case.mechanisms if (doubt := each.doubt(case.mesh))]
    for name, nodes, shared in moving:
        members = mesh.node_sets[nodes]
        # what nodes share is of each of them, all else of faces, whose rim may well be held
        faces = faces_of(mesh, members)
        parts = held[members] if shared or not len(faces) else held[faces].all(axis=1)
        if parts.any():
            share = "all" if parts.all() else f"{100.0 * parts.mean():.2g} %"
            remarks.append(f"{name} does nothing on {share} of '{nodes}', which a [[boundary]] fixes or displaces")
    return remarks


def _nothing_there(case: Case) -> list[str]:
    remarks = []
    if not case.boundaries and case.specimen is None:
        remarks.append("no [[boundary]]: nothing holds the body, so it cannot be simulated")
    remarks += remarks_on_loads(case)
    if case.recordings and case.specimen is None:
        fitted = [recording for recording in case.recordings if recording.role == "fit"]
        remarks += [why for recording in fitted if (why := too_few_for_noise(case, recording))]
        if why := too_few_to_diagnose(case):
            remarks.append(f"`diagnose` will refuse: {why}")
    if not case.recordings:
        remarks.append("no [[recording]]: there is nothing to compare a simulation with")
    return remarks


#: Noise can be estimated from no fewer numbers than this.
_FOR_NOISE = 10
#: Numbers below which nothing but registration and stiffness can be told: a dozen, and one point more.
_TO_DIAGNOSE = 15


def numbers_in(case: Case, recording: Recording) -> int:
    """Numbers of a recording that tell of a body: every component of every row, at all times; copies tell no more.

    The resultant of a boundary whose force the case gives tells nothing.
    """
    if isinstance(recording, ForceRecording) and isinstance(case.boundary(recording.boundary), Forced):
        return 0
    rows = compared_rows(recording)
    if isinstance(recording, PointsRecording):
        rows, _ = distinct_rows(recording, rows)
    return recording.components * len(rows)


def numbers_to_fit(case: Case) -> int:
    """Numbers of all recordings to which a body is fitted."""
    return sum(numbers_in(case, recording) for recording in case.recordings if recording.role == "fit")


def too_few_for_noise(case: Case, recording: Recording) -> str:
    """Why the noise of a recording cannot be estimated; empty if it can, or is declared."""
    declared = recording.sigma is not None or getattr(recording, "sigmas", None) is not None
    count = numbers_in(case, recording)
    if declared or not 0 < count < _FOR_NOISE:
        return ""
    return (
        f"recording '{recording.name}' holds {count} numbers: too few to estimate their noise from, which takes "
        f"{_FOR_NOISE}; give its sigma"
    )


def too_few_to_diagnose(case: Case) -> str:
    """Why nothing can be concluded from what a body's case has to fit; empty if something can."""
    count = numbers_to_fit(case)
    if count >= _TO_DIAGNOSE:
        return ""
    points = math.ceil((_TO_DIAGNOSE - count) / 3)
    return (
        f"[[recording]] role = 'fit': {count} numbers: too few for any conclusion, since registration and stiffness "
        f"alone take a dozen; {points} more tracked points, spread over the body, or as many more times would do"
    )
