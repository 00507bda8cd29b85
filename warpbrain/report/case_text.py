"""A case in words: all that it says, and what checking it found."""

from __future__ import annotations

from warpbrain.cases.case import Case
from warpbrain.cases.checking import Checked
from warpbrain.mesh import Quality, measure
from warpbrain.recordings.recording import Recording
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.summary import SET_TITLES, STAND_IN


def show_lines(case: Case) -> list[str]:
    """Everything a case says, as printed."""
    origin = STAND_IN if case.origin == "stand-in" else case.origin
    lines = [case.title, f"  file      {case.path}", f"  origin    {origin}"]
    lines += [f"  {line}" for line in _mesh_lines(case, measure(case.mesh))]
    for label, tissue in sorted(case.tissues.items()):
        law = f"mu = {tissue.law.shear_modulus:g} Pa" if tissue.law is not None else f"from the prior '{tissue.prior}'"
        lines.append(
            f"  tissue {label}  {tissue.name}: {tissue.model} ({tissue.formulation}), {law}, nu = {case.poisson:g}"
        )
    lines += [f"  assumed   {sentence}" for sentence in case.assumptions]
    lines += [f"  recorded  {sentence}" for sentence in map(recording_line, case.recordings)]
    lines += [f"  remark    {sentence}" for sentence in case.remarks]
    return lines


def _mesh_lines(case: Case, quality: Quality) -> list[str]:
    units = f"files in {case.frame.unit}, {case.frame.axes}"
    volume, edge = 1e6 * quality.volume, MILLIMETRES * quality.mean_edge
    lines = [
        f"mesh      {quality.nodes} nodes, {quality.tetrahedra} tetrahedra of {edge:.3g} mm edge; {units}",
        f"volume    {volume:.4g} cm3, {case.density * quality.volume:.4g} kg at {case.density:g} kg/m3",
        f"quality   dihedral angles from {quality.min_dihedral:.1f} to {quality.max_dihedral:.1f} degrees, first "
        f"percentile of each tetrahedron's smallest {quality.first_percentile_dihedral:.1f}; "
        f"{quality.components} part(s)",
    ]
    for kind, members in (("node sets", case.mesh.node_sets), ("elements ", case.mesh.element_sets)):
        if members:
            counts = ", ".join(f"{SET_TITLES.get(name, name)} ({inside.sum()})" for name, inside in members.items())
            lines.append(f"{kind} {counts}")
    return lines


def recording_line(recording: Recording) -> str:
    """One line about a recording."""
    role = "" if recording.role == "fit" else "; only checked, never fitted"
    scale, unit = (MILLIMETRES, "mm") if recording.noise_unit == "m" else (1.0, "")
    noise = f"; noise {scale * recording.sigma:g} {unit}".rstrip() if recording.sigma is not None else ""
    return f"{recording.name}: {recording.content}{noise}{role}"


def check_lines(checked: Checked, cannot: str) -> list[str]:
    """What checking found, as printed: problems first; `cannot` says why a sound case cannot be run yet."""
    lines = [str(checked.file)]
    for problem in checked.problems:
        place = f"{problem.file.name}: {problem.place}: " if problem.place else f"{problem.file.name}: "
        lines.append(f"  problem   {place}{problem.message}")
        if problem.cure:
            lines.append(f"            -> {problem.cure}")
    if checked.case is not None and checked.quality is not None:
        lines += [f"  {line}" for line in _mesh_lines(checked.case, checked.quality)]
        lines.append(f"  plausible {1e6 * checked.quality.volume:.4g} cm3: {checked.plausible}")
        lines += [f"  recorded  {sentence}" for sentence in map(recording_line, checked.case.recordings)]
    lines += [f"  look at   {sentence}" for sentence in checked.remarks]
    if cannot:
        lines.append(f"  not yet   it cannot be run as it stands: {cannot}")
    if not checked.problems:
        lines.append("  nothing is wrong with it" + (" otherwise" if cannot else ""))
    return lines
