"""The recordings of a case, each from its table and its file; and tests whose magnitude is not that of their unit."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from warpbrain.cases.case import Tissue
from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import RECORDING
from warpbrain.cases.parts.named import Named
from warpbrain.cases.parts.tissues import OTHER_MU
from warpbrain.cases.specimen import REST, Specimen
from warpbrain.recordings.recording import RECORDINGS, Recording, TestRecording
from warpbrain.recordings.times import compared_rows, times_of


def read_recordings(context: Context, named: Named | None, boundaries: set[str]) -> tuple[Recording, ...]:
    """Recordings in the order of the file, as far as they are right; a force names one of the `boundaries`."""
    recordings: list[Recording] = []
    names: set[str] = set()
    specimen = "specimen" in context.tables
    for table in context.lists(RECORDING):
        name = table.get("name") or ""
        if name and name in names:
            table.problem("name", f"a second recording '{name}'")
        names.add(name)
        if table.variant is None:
            continue
        kind = RECORDINGS[table.variant]
        if kind.of_specimen != specimen:
            other = "a case with [specimen]" if kind.of_specimen else "a case with [mesh]"
            table.problem("kind", f"'{table.variant}' belongs to {other}")
            continue
        given = _given(table, kind, named, boundaries)
        if given is None:
            continue
        if fault := kind.fault_of_keys(given):
            table.problem(*fault)
            continue
        recording = kind.read(frame=context.frame, problems=context.problems, **given)
        if recording is None:
            continue
        for key, fault in recording.without_meaning().items():
            if table.named(key):
                table.problem(key, *fault)
        if not specimen and not (times_of(recording) > 0.0).any():
            message = "no row is of a time after 0 s, when loads come: there is nothing to compare"
            table.problem("file", message, "leave t out of what was recorded in the end")
        elif not specimen and recording.reference is not None and not len(compared_rows(recording)):
            at = f"{recording.reference:g} s"
            table.problem("reference", f"no row is of another time than {at}: there is no difference to compare")
        recordings.append(recording)
    return tuple(recordings)


def _given(table: Reading, kind: type[Recording], named: Named | None, boundaries: set[str]) -> dict[str, Any] | None:
    """Path and keys as `Recording.read` takes them; None, and problems noted, if something of them is wrong."""
    given: dict[str, Any] = {"path": table.path("file")}
    given |= {key: table.get(key) for key in ("name", "file", "role")}
    right = given["path"] is not None and table.has("name")
    for key in kind.keys:
        value = table.si(key.name)
        if key.name == "nodes":
            value = None if named is None else named.nodes(table)
        elif key.name == "boundary" and value is not None and value not in boundaries:
            known = ", ".join(f"'{known}'" for known in sorted(boundaries)) or "none"
            table.problem("boundary", f"no [[boundary]] is called '{value}' (there are: {known})")
            right = False
        elif "file" in key.kinds:
            given[f"{key.name}_file"], value = value, table.path(key.name)
            right &= value is not None or not table.named(key.name)
        right &= value is not None or not key.needed
        given[key.name] = value
    sigma = table.get("sigma")
    return given | {"sigma": None if sigma is None else float(sigma)} if right else None


#: A response that is so many times off is not that of another tissue: a unit that is off by 1000 is so of any tissue
#: that is up to ten times softer or stiffer than was declared.
_OFF = 100.0
#: Strain up to which responses are compared: beyond it tissue stiffens more than a unit can be off (an Ogden law with
#: an exponent of -20, as of brain, answers 30 % of compression with 200 times what its small-strain modulus does).
_SMALL = 0.1


def check_magnitudes(
    context: Context, specimen: Specimen, tissues: Mapping[int, Tissue], nu: float, recordings: Sequence[Recording]
) -> None:
    """Note tests whose response is far from what the declared tissue would answer at small strain."""
    laws = [tissue.law for tissue in tissues.values() if tissue.law is not None]
    mu = laws[0].shear_modulus if laws else OTHER_MU
    # of a shear modulus of 1 Pa; in torsion the shear grows from the axis to the rim
    moduli = {"axial": 2.0 * (1.0 + nu), "shear": 1.0, "torsion": 0.75}
    moduli |= {"confined": 2.0 * (1.0 - nu) / (1.0 - 2.0 * nu), "biaxial": 2.0 * (1.0 + nu) / (1.0 - nu)}
    tables = context.tables.get("recording", [])
    for recording in recordings:
        if not isinstance(recording, TestRecording):
            continue
        mode, (imposed, answer) = recording.mode, recording.quantities
        strain = specimen.strain_of(mode, imposed, recording.imposed) - REST[mode]
        rows = np.abs(strain) <= max(_SMALL, float(np.abs(strain)[strain != 0.0].min(initial=np.inf)))
        # the answer to a strain of 1 of a linear elastic specimen
        factor = mu * moduli[mode] / specimen.stress_unit(answer)
        expected, response = factor * strain[rows], recording.response[rows]
        if not expected.any() or not response.any():
            continue
        times = float(np.sqrt(response @ response / (expected @ expected)))
        if 1.0 / _OFF < times < _OFF:
            continue
        number, unit = next(
            (k, table.get("unit", "Pa"))
            for k, table in enumerate(tables, 1)
            # what is no table is a problem that was noted when it was read
            if isinstance(table, dict) and table.get("name") == recording.name
        )
        message = f"the {answer} is {times:.2g} times what the declared tissue (mu = {mu:g} Pa) answers"
        if answer != "stress":
            cure = "forces are in N, torques in N m, lengths in units"
            context.problem(f"[recording {number}] file", message, cure)
            continue
        other = "kPa" if times < 1.0 else "Pa"
        cure = f'perhaps unit = "{other}"' if other != unit else "is mu in Pa?"
        context.problem(f"[recording {number}] unit", f"{message} if it is in {unit}", cure)
